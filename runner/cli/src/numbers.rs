//! Numbers as people read them.

use std::time::Duration;

/// Whole numbers with commas.
pub(crate) fn count(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::with_capacity(digits.len() * 4 / 3);
    for (at, digit) in digits.char_indices() {
        if at > 0 && (digits.len() - at).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// `1 byte`, `1,024 bytes`.
pub(crate) fn bytes(number: u64) -> String {
    things(number, "byte")
}

/// `1 thing`, `2 things`.
pub(crate) fn things(number: u64, thing: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{} {thing}{plural}", count(number))
}

/// Seconds with as many digits as matter, minutes above two.
pub(crate) fn span(time: Duration) -> String {
    let seconds = time.as_secs_f64();
    if seconds < 120.0 {
        return format!("{seconds:.1} s");
    }
    let whole = time.as_secs();
    match whole / 3_600 {
        0 => format!("{} min {} s", whole / 60, whole % 60),
        hours => format!("{hours} h {} min", whole % 3_600 / 60),
    }
}

/// As [`span`], in milliseconds below a second.
pub(crate) fn short_span(time: Duration) -> String {
    if time < Duration::from_secs(1) { format!("{} ms", time.as_millis()) } else { span(time) }
}

/// Seconds for machines, to the microsecond.
pub(crate) fn seconds(time: Duration) -> f64 {
    time.as_micros() as f64 / 1e6
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!([0, 999, 1_000, 1_234_567].map(count), ["0", "999", "1,000", "1,234,567"]);
        assert_eq!([1, 2, 4_096].map(bytes), ["1 byte", "2 bytes", "4,096 bytes"]);
        let spans = [90, 150, 7_260].map(|seconds| span(Duration::from_secs(seconds)));
        assert_eq!(spans, ["90.0 s", "2 min 30 s", "2 h 1 min"]);
        assert!((seconds(Duration::from_millis(1_500)) - 1.5).abs() < 1e-9);
    }
}
