//! Spans of time and numbers of bytes as people write them.

use std::time::Duration;

/// Spans above this are slips, and their sums must not overflow.
const MOST: Duration = Duration::from_hours(366 * 24);

/// A span: `500ms`, `2s`, `10m`, `1h` or `7d`.
///
/// ```
/// use softplug_live::quantity::span;
/// use std::time::Duration;
///
/// assert_eq!(span("500ms"), Ok(Duration::from_millis(500)));
/// assert_eq!(span("10 m"), Ok(Duration::from_mins(10)));
/// assert!(span("1.5s").is_err());
/// ```
///
/// # Errors
/// It is none, or is longer than 366 days: what to write, in one sentence.
pub fn span(text: &str) -> Result<Duration, &'static str> {
    const FORM: &str = "write a number and a unit: 500ms, 2s, 10m, 1h or 7d";
    let (number, unit) = split(text).ok_or(FORM)?;
    let millis = match unit {
        "ms" => 1,
        "s" => 1_000,
        "m" | "min" => 60_000,
        "h" => 3_600_000,
        "d" => 24 * 3_600_000,
        _ => return Err(FORM),
    };
    let span = number.checked_mul(millis).map(Duration::from_millis).ok_or(FORM)?;
    if span > MOST { Err("at most 366d") } else { Ok(span) }
}

/// A number of bytes: `512`, `16k`, `16KiB` or `64M`.
///
/// ```
/// use softplug_live::quantity::bytes;
///
/// assert_eq!(bytes("16KiB"), Ok(16_384));
/// assert!(bytes("1T").is_err());
/// ```
///
/// # Errors
/// It is none, or too many: what to write, in one sentence.
pub fn bytes(text: &str) -> Result<u64, &'static str> {
    const FORM: &str = "write a number of bytes: 512, 16KiB or 64MiB";
    let (number, unit) = split(text).ok_or(FORM)?;
    let factor = match unit {
        "" | "B" => 1,
        "k" | "K" | "KiB" => 1 << 10,
        "M" | "MiB" => 1 << 20,
        "G" | "GiB" => 1 << 30,
        _ => return Err(FORM),
    };
    number.checked_mul(factor).ok_or(FORM)
}

fn split(text: &str) -> Option<(u64, &str)> {
    let end = text.find(|c: char| !c.is_ascii_digit()).unwrap_or(text.len());
    Some((text[..end].parse().ok()?, text[end..].trim_start()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_and_bytes_have_units() {
        assert_eq!(span("500ms"), Ok(Duration::from_millis(500)));
        assert_eq!(span("10 m"), Ok(Duration::from_mins(10)));
        assert_eq!(span("1h"), Ok(Duration::from_hours(1)));
        for text in ["", "5", "m", "-1s", "1.5s", "400d", "99999999999999999999s", "1y"] {
            assert!(span(text).is_err(), "{text}");
        }
        assert_eq!(bytes("512"), Ok(512));
        assert_eq!(bytes("16KiB"), Ok(16_384));
        assert_eq!(bytes("64 M"), Ok(64 << 20));
        for text in ["", "k", "-1", "1T", "99999999999999999999", "9999999999999999999G"] {
            assert!(bytes(text).is_err(), "{text}");
        }
    }
}
