//! What each link did: sampled once a second, kept for a day.

use std::collections::VecDeque;
use std::time::Duration;

use crate::view::{BufferView, CountersView, HistorySpan, HistoryView, TimeMs};

/// From one sample to the next.
pub(super) const STEP: Duration = Duration::from_secs(1);
/// Samples by the second that are kept: ten minutes.
const SECONDS: usize = 600;
/// Samples by the minute that are kept: a day.
const MINUTES: usize = 1_440;
/// Seconds of a minute.
const MINUTE: usize = 60;

/// A second, or a minute.
#[derive(Copy, Clone, Default, Debug)]
struct Sample {
    level: u32,
    sent: u32,
    received: u32,
    held_ms: u16,
    line_errors: u16,
}

/// What was counted at one moment.
#[derive(Copy, Clone, Default, Debug)]
struct Counted {
    sent: u64,
    received: u64,
    held_us: u64,
    line_errors: u64,
}

/// What one link did: 16 bytes a sample, 34 KB when a day has passed.
#[derive(Debug, Default)]
pub(crate) struct History {
    seconds: VecDeque<Sample>,
    minutes: VecDeque<Sample>,
    /// Of the minute that is not over.
    minute: Vec<Sample>,
    before: Option<Counted>,
    end_ms: TimeMs,
    minute_end_ms: TimeMs,
}

impl History {
    /// A second has passed, or more: then nothing is known of the others.
    pub(super) fn take(
        &mut self,
        counters: &CountersView,
        buffer: &BufferView,
        counts_hold: bool,
        (missed, now): (usize, TimeMs),
    ) {
        let counted = Counted {
            sent: counters.bytes_out,
            received: counters.bytes_in,
            held_us: counters.held_us,
            line_errors: counters.line_errors.values().sum(),
        };
        // The first has nothing before it.
        let before = self.before.replace(counted).unwrap_or(counted);
        let since = |of: fn(&Counted) -> u64| of(&counted).saturating_sub(of(&before));
        let sample = Sample {
            level: short(buffer.level),
            sent: short(since(|counted| counted.sent)),
            received: short(since(|counted| counted.received)),
            held_ms: if counts_hold { few(since(|counted| counted.held_us) / 1_000) } else { 0 },
            line_errors: few(since(|counted| counted.line_errors)),
        };
        self.end_ms = now;
        for _ in 0..missed.min(SECONDS) {
            self.push(Sample { level: sample.level, ..Sample::default() });
        }
        self.push(sample);
    }

    fn push(&mut self, sample: Sample) {
        keep(&mut self.seconds, sample, SECONDS);
        self.minute.push(sample);
        if self.minute.len() == MINUTE {
            let sum = |of: fn(&Sample) -> u64| -> u64 { self.minute.iter().map(of).sum() };
            let minute = Sample {
                level: short(sum(|sample| sample.level.into()) / MINUTE as u64),
                sent: short(sum(|sample| sample.sent.into())),
                received: short(sum(|sample| sample.received.into())),
                held_ms: few(sum(|sample| sample.held_ms.into())),
                line_errors: few(sum(|sample| sample.line_errors.into())),
            };
            keep(&mut self.minutes, minute, MINUTES);
            self.minute.clear();
            self.minute_end_ms = self.end_ms;
        }
    }

    pub(super) fn view(&self) -> HistoryView {
        HistoryView {
            seconds: span(&self.seconds, STEP, self.end_ms),
            minutes: span(&self.minutes, STEP * MINUTE as u32, self.minute_end_ms),
        }
    }
}

fn keep(samples: &mut VecDeque<Sample>, sample: Sample, most: usize) {
    if samples.len() == most {
        samples.pop_front();
    }
    if samples.len() == samples.capacity() {
        // As it grows: most of a day is yet to come.
        samples.reserve_exact(MINUTE.min(most - samples.len()));
    }
    samples.push_back(sample);
}

fn short(number: u64) -> u32 {
    u32::try_from(number).unwrap_or(u32::MAX)
}

/// A minute has 60,000 ms; of more damaged characters than fit nobody counts each.
fn few(number: u64) -> u16 {
    u16::try_from(number).unwrap_or(u16::MAX)
}

fn span(samples: &VecDeque<Sample>, step: Duration, end_ms: TimeMs) -> HistorySpan {
    let column = |of: fn(&Sample) -> u32| samples.iter().map(of).collect();
    HistorySpan {
        step_ms: step.as_millis() as u64,
        end_ms,
        level: column(|sample| sample.level),
        sent: column(|sample| sample.sent),
        received: column(|sample| sample.received),
        held_ms: column(|sample| sample.held_ms.into()),
        line_errors: column(|sample| sample.line_errors.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(seconds: u64, missed: usize) -> HistoryView {
        let mut history = History::default();
        for second in 1..=seconds {
            let counters = CountersView {
                bytes_out: second * 960,
                bytes_in: 2 * second,
                held_us: second * 250_000,
                ..CountersView::default()
            };
            let buffer = BufferView { level: second, ..BufferView::default() };
            history.take(&counters, &buffer, true, (missed, second * 1_000));
        }
        history.view()
    }

    #[test]
    fn the_last_ten_minutes_by_the_second_and_a_day_by_the_minute() {
        let view = after(3, 0);
        assert_eq!(view.seconds.sent, [0, 960, 960], "of the time before it nothing is known");
        assert_eq!((view.seconds.end_ms, &*view.seconds.level), (3_000, &[1, 2, 3][..]));
        assert_eq!(view.minutes.sent.len(), 0);

        let view = after(2 * 60 * MINUTES as u64, 0);
        assert_eq!((view.seconds.sent.len(), view.minutes.sent.len()), (SECONDS, MINUTES));
        assert!(view.minutes.sent.iter().all(|sent| *sent == 60 * 960));
        assert!(view.minutes.received.iter().all(|received| *received == 120));
        assert!(view.minutes.held_ms.iter().all(|held| *held == 15_000));
        assert_eq!(view.minutes.end_ms, view.seconds.end_ms);
    }

    #[test]
    fn what_was_missed_is_no_news() {
        let view = after(2, 3);
        assert_eq!(view.seconds.sent, [0, 0, 0, 0, 0, 0, 0, 960]);
        assert_eq!(view.seconds.step_ms, 1_000);
        // A computer that slept for years keeps nothing of them.
        assert_eq!(after(1, usize::MAX).seconds.sent.len(), SECONDS);
    }
}
