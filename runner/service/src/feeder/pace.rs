//! When the next packet may go: the pacing delay, without a clock of its own.

use std::time::{Duration, Instant};

/// So many packets may be made up for when the feeder was late.
const MADE_UP: u32 = 4;

/// How a job is fed.
#[derive(Copy, Clone, PartialEq, Debug)]
pub struct Pace {
    /// Bytes of a packet (Cp).
    pub packet: usize,
    /// Characters that the line takes in a second (Vc); `None` where it has no known rate.
    pub characters_a_second: Option<f64>,
}

impl Pace {
    /// The time in which the line takes a packet (Tg).
    pub fn packet_time(&self) -> Duration {
        let rate = self.characters_a_second.filter(|rate| rate.is_finite() && *rate > 0.0);
        let seconds = rate.map_or(0.0, |rate| self.packet as f64 / rate);
        Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX).min(Duration::from_mins(1))
    }
}

/// The times of one job's packets. Between the beginnings of two packets lies Ts + Tp, with
/// Tp = max(0, Tg − Ts): the time for a packet on the line, or for sending it if that is longer.
#[derive(Copy, Clone, Debug)]
pub(super) struct Schedule {
    packet_time: Duration,
    due: Instant,
    /// The latest packet took so long to send (Ts).
    pub(super) sending: Duration,
}

impl Schedule {
    pub(super) fn new(pace: &Pace, now: Instant) -> Self {
        Self { packet_time: pace.packet_time(), due: now, sending: Duration::ZERO }
    }

    /// When the next packet may go.
    pub(super) fn due(&self) -> Instant {
        self.due
    }

    /// A packet was sent between these times, while the buffer was being filled: no delay.
    pub(super) fn filled(&mut self, begin: Instant, end: Instant) {
        self.sending = end - begin;
        self.due = end;
    }

    /// A packet that the line had made room for was sent between these times.
    pub(super) fn sent(&mut self, begin: Instant, end: Instant) {
        self.sending = end - begin;
        let cycle = self.packet_time.max(self.sending);
        // From when it was due, so that being late once is not being late for ever; but not
        // from long ago, which would be a burst.
        let earliest = begin.checked_sub(self.packet_time * MADE_UP).unwrap_or(begin);
        self.due = self.due.max(earliest) + cycle;
    }

    /// The delay after the latest packet (Tp).
    pub(super) fn delay(&self) -> Duration {
        self.packet_time.saturating_sub(self.sending)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_time_for_a_packet_follows_from_the_line() {
        let time = |packet, characters_a_second| Pace { packet, characters_a_second }.packet_time();
        // 19,200 baud, 7E2: 11 bits a character.
        assert_eq!(time(512, Some(19_200.0 / 11.0)).as_millis(), 293);
        assert_eq!(time(512, None), Duration::ZERO);
        assert_eq!(time(512, Some(0.0)), Duration::ZERO);
        assert_eq!(time(usize::MAX, Some(1e-9)), Duration::from_mins(1));
    }

    #[test]
    fn sending_counts_into_the_delay() {
        let pace = Pace { packet: 100, characters_a_second: Some(1_000.0) };
        let start = Instant::now();
        let mut schedule = Schedule::new(&pace, start);
        schedule.sent(start, start + Duration::from_millis(30));
        assert_eq!(schedule.delay(), Duration::from_millis(70));
        assert_eq!(schedule.due() - start, Duration::from_millis(100));
        // Slower than the line: no delay, and no debt.
        let begin = schedule.due();
        schedule.sent(begin, begin + Duration::from_millis(250));
        assert_eq!(schedule.delay(), Duration::ZERO);
        assert_eq!(schedule.due() - begin, Duration::from_millis(250));
    }

    proptest! {
        /// However late the packets are: never more than the line takes, but for a few.
        #[test]
        fn the_average_is_the_lines_rate(
            lates in proptest::collection::vec(0..2_000_u64, 1..200),
        ) {
            let pace = Pace { packet: 100, characters_a_second: Some(1_000.0) };
            let start = Instant::now();
            let mut schedule = Schedule::new(&pace, start);
            let mut times = Vec::new();
            for late in lates {
                let last = times.last().copied().unwrap_or(start);
                let now = schedule.due().max(last) + Duration::from_millis(late / 10);
                times.push(now);
                schedule.sent(now, now);
            }
            for (first, from) in times.iter().enumerate() {
                for (count, to) in (0_u32..).zip(&times[first..]) {
                    let least = pace.packet_time() * count.saturating_sub(MADE_UP);
                    prop_assert!(*to - *from >= least, "{count} packets in {:?}", *to - *from);
                }
            }
        }
    }
}
