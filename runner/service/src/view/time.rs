//! Times of day.

use std::time::{SystemTime, UNIX_EPOCH};

use time::OffsetDateTime;

/// A time of day, in milliseconds since 1970 (UTC).
pub type TimeMs = u64;

/// In milliseconds.
pub(crate) const DAY: TimeMs = 24 * 60 * 60 * 1_000;

/// Now.
pub fn now_ms() -> TimeMs {
    // A clock before 1970 is one that was never set.
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |span| span.as_millis() as u64)
}

/// The day (UTC).
///
/// ```
/// use softplug_service::view::day;
///
/// assert_eq!(day(951_868_799_999), "2000-02-29");
/// assert_eq!(day(u64::MAX), "9999-12-31", "what no calendar has");
/// ```
pub fn day(at: TimeMs) -> String {
    let date = calendar(at).date();
    format!("{:04}-{:02}-{:02}", date.year(), u8::from(date.month()), date.day())
}

/// Day and time to the second (UTC).
///
/// ```
/// use softplug_service::view::utc;
///
/// assert_eq!(utc(1_795_813_512_345), "2026-11-27 21:05:12 UTC");
/// ```
pub fn utc(at: TimeMs) -> String {
    let (hour, minute, second) = calendar(at).time().as_hms();
    format!("{} {hour:02}:{minute:02}:{second:02} UTC", day(at))
}

/// The last that there is, for what lies beyond.
fn calendar(at: TimeMs) -> OffsetDateTime {
    const LAST: i64 = 253_402_300_799;
    let seconds = i64::try_from(at / 1_000).unwrap_or(LAST).min(LAST);
    OffsetDateTime::from_unix_timestamp(seconds).unwrap_or(OffsetDateTime::UNIX_EPOCH)
}
