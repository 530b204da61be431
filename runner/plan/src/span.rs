//! Spans of time as people write them.
//!
//! A bus switches in microseconds or milliseconds, so these are finer than the spans of a
//! gateway's configuration, and may have decimals.

/// The form, as errors say it.
pub const FORM: &str = "a number and a unit, such as \"250us\", \"2ms\" or \"0.5s\"";

/// Why a text is no span that can be meant.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum NoSpan {
    /// It has another form.
    Form,
    /// There is no number that is so large.
    Large,
}

/// `40ns`, `250us`, `2ms`, `1.5 ms` or `0.5s`, in seconds.
///
/// # Errors
/// It has another form, or is too large.
///
/// ```
/// use softplug_plan::span;
///
/// assert_eq!(span::seconds("2ms"), Ok(0.002));
/// assert_eq!(span::shown(0.000_05), "50us");
/// ```
pub fn seconds(text: &str) -> Result<f64, NoSpan> {
    let end = text.find(|c: char| !c.is_ascii_digit() && c != '.').ok_or(NoSpan::Form)?;
    let (number, unit) = (&text[..end], text[end..].trim_start());
    let (whole, decimals) = number.split_once('.').unwrap_or((number, "0"));
    let is_number =
        |digits: &str| !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit());
    if !is_number(whole) || !is_number(decimals) {
        return Err(NoSpan::Form);
    }
    let number: f64 = number.parse().map_err(|_| NoSpan::Form)?;
    let seconds = match unit {
        "ns" => number / 1e9,
        "us" | "µs" | "μs" => number / 1e6,
        "ms" => number / 1e3,
        "s" => number,
        "min" => number * 60.0,
        _ => return Err(NoSpan::Form),
    };
    if seconds.is_finite() { Ok(seconds) } else { Err(NoSpan::Large) }
}

/// A span in seconds, as people write it.
pub fn shown(seconds: f64) -> String {
    let (number, unit) = match seconds {
        s if s >= 1.0 => (s, "s"),
        s if s >= 1e-3 || s == 0.0 => (s * 1e3, "ms"),
        s if s >= 1e-6 => (s * 1e6, "us"),
        s => (s * 1e9, "ns"),
    };
    // Spans are given to the nanosecond at most, and what a multiplication adds is not shown.
    let text = format!("{number:.3}");
    format!("{}{unit}", text.trim_end_matches('0').trim_end_matches('.'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spans_have_units() {
        let near = |text, is: f64| assert!((seconds(text).unwrap() - is).abs() < 1e-12, "{text}");
        near("40ns", 40e-9);
        near("250us", 250e-6);
        near("250 µs", 250e-6);
        near("2ms", 2e-3);
        near("1.5 ms", 1.5e-3);
        near("0.5s", 0.5);
        near("1min", 60.0);
        near("0ms", 0.0);
        for text in ["", "2", "ms", "-1ms", "1.ms", ".5ms", "1.2.3s", "1e3s", "nan s", "inf", "2h"]
        {
            assert_eq!(seconds(text), Err(NoSpan::Form), "{text}");
        }
        assert_eq!(seconds(&format!("{}s", "9".repeat(400))), Err(NoSpan::Large));
        assert_eq!(
            seconds("12345678901234567890123456s"),
            Ok(12_345_678_901_234_567_890_123_456.0)
        );
    }

    #[test]
    fn spans_are_shown_as_they_are_written() {
        assert_eq!(
            [0.0, 4e-8, 2.5e-4, 2e-3, 1.5].map(shown),
            ["0ms", "40ns", "250us", "2ms", "1.5s"]
        );
    }
}
