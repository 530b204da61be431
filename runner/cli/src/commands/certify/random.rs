//! How many random sessions are asked for.

use std::str::FromStr;
use std::time::Duration;

/// A number of sessions, or a span of time.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Amount {
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
        let place = text.find(|c: char| !c.is_ascii_digit()).ok_or_else(wrong)?;
        let (number, unit) = text.split_at(place);
        let unit: u64 = match unit {
            "s" => 1,
            "min" => 60,
            "h" => 3_600,
            _ => return Err(wrong()),
        };
        let seconds = number.parse::<u64>().ok().and_then(|number| number.checked_mul(unit));
        seconds.map(|seconds| Self::For(Duration::from_secs(seconds))).ok_or_else(wrong)
    }
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
