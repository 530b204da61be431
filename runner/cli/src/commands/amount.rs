//! How much is asked for: so many, or for so long.

use std::str::FromStr;
use std::time::Duration;

/// A number of sessions, or a span of time.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Amount {
    Count(u32),
    For(Duration),
}

impl FromStr for Amount {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || {
            format!(
                "\"{text}\" is no number of sessions such as 2000, and no time such as 90s, 10min or 1h"
            )
        };
        if let Ok(count) = text.parse() {
            return Ok(Self::Count(count));
        }
        span(text).map(Self::For).ok_or_else(wrong)
    }
}

/// A time such as 90s, 10min or 1h.
pub(crate) fn time(text: &str) -> Result<Duration, String> {
    span(text).ok_or_else(|| format!("\"{text}\" is no time such as 90s, 10min or 1h"))
}

fn span(text: &str) -> Option<Duration> {
    let (number, unit) = text.split_at(text.find(|c: char| !c.is_ascii_digit())?);
    let unit: u64 = match unit {
        "s" => 1,
        "min" => 60,
        "h" => 3_600,
        _ => return None,
    };
    number.parse::<u64>().ok()?.checked_mul(unit).map(Duration::from_secs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_times_are_read() {
        let read = |text: &str| text.parse::<Amount>();
        assert_eq!(read("2000"), Ok(Amount::Count(2_000)));
        assert_eq!(read("10min"), Ok(Amount::For(Duration::from_mins(10))));
        assert_eq!(read("1h"), Ok(Amount::For(Duration::from_hours(1))));
        for wrong in ["", "h", "1 h", "-3", "99999999999", "3d", "99999999999999999999h"] {
            assert!(read(wrong).unwrap_err().contains("no number of sessions"), "{wrong}");
        }
    }
}
