//! How fast a job gets on.

use std::collections::VecDeque;
use std::time::Duration;

/// What left longer ago says nothing of how fast it leaves now.
const WINDOW: Duration = Duration::from_secs(15);
/// Under this, what left says more of blocks than of a rate.
const LEAST: Duration = Duration::from_secs(2);
/// What has not moved for so long has no rate.
const STILL: Duration = Duration::from_secs(5);

/// How much of a job had left, at moments of the last seconds.
#[derive(Clone, Debug, Default)]
pub(crate) struct Rate(VecDeque<(Duration, u64)>);

impl Rate {
    /// So many bytes have left by now.
    pub(crate) fn take(&mut self, now: Duration, left: u64) {
        // It began anew, or stands since long.
        let has_gone_back = self.0.back().is_some_and(|(_, before)| *before > left);
        let since = self.0.iter().find(|(_, before)| *before == left);
        if has_gone_back || since.is_some_and(|(since, _)| now.saturating_sub(*since) >= STILL) {
            self.0.clear();
        }
        self.0.push_back((now, left));
        while self.0.front().is_some_and(|(at, _)| now.saturating_sub(*at) > WINDOW) {
            self.0.pop_front();
        }
    }

    /// Bytes in a second over the last seconds; none while nothing moves, or nobody knows yet.
    pub(crate) fn bytes_a_second(&self) -> Option<u64> {
        let ((first, before), (last, now)) = (self.0.front()?, self.0.back()?);
        let span = last.saturating_sub(*first);
        if span < LEAST || now == before {
            return None;
        }
        let rate = u128::from(now - before) * 1_000_000 / span.as_micros();
        u64::try_from(rate).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(lefts: impl IntoIterator<Item = u64>) -> Rate {
        let mut rate = Rate::default();
        for (second, left) in lefts.into_iter().enumerate() {
            rate.take(Duration::from_secs(second as u64), left);
        }
        rate
    }

    #[test]
    fn it_is_what_left_over_the_last_seconds() {
        assert_eq!(after([0, 960]).bytes_a_second(), None, "too early to tell");
        assert_eq!(after((0..60).map(|second| second * 960)).bytes_a_second(), Some(960));
        // It has become slower: the first minute is forgotten.
        let slower = (0..60).map(|second| if second < 30 { second * 960 } else { 28_800 + second });
        assert_eq!(after(slower).bytes_a_second(), Some(1));
    }

    #[test]
    fn what_stands_has_none_and_begins_anew() {
        let stood =
            |seconds: u64| (0..10).map(|second| second * 960).chain((0..seconds).map(|_| 8_640));
        assert!(after(stood(3)).bytes_a_second().is_some());
        assert_eq!(after(stood(6)).bytes_a_second(), None);
        let again = stood(60).chain((1..=4).map(|second| 8_640 + second * 480));
        let rate = after(again).bytes_a_second().unwrap();
        assert!((200..=480).contains(&rate), "{rate}");
        assert_eq!(after([5_000, 6_000, 7_000, 100]).bytes_a_second(), None, "another job");
    }
}
