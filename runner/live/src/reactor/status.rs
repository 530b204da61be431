//! What a lane is doing, for whoever looks from another thread.

use softplug_abi::{JobId, LineErrorKind, Micros};
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU32, AtomicU64, Ordering};

use super::AlarmKind;
use crate::channel::Counters;

const LINE_ERRORS: usize = LineErrorKind::ALL.len();
/// Bytes that a plug-in may have taken and not yet passed on.
const IN_THE_PLUGIN: u64 = 1_024;

/// How a lane is.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Condition {
    /// Its port has never been open yet.
    Opening,
    /// It works.
    Up,
    /// Its port is lost; it is tried again.
    Down,
    /// Its plug-in has ended; it waits for another.
    Faulted,
    /// It is being closed.
    Closing,
    /// It has ended.
    Removed,
}

impl Condition {
    const ALL: [Self; 6] =
        [Self::Opening, Self::Up, Self::Down, Self::Faulted, Self::Closing, Self::Removed];

    /// Its name, as metrics and interfaces have it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Opening => "opening",
            Self::Up => "up",
            Self::Down => "down",
            Self::Faulted => "faulted",
            Self::Closing => "closing",
            Self::Removed => "removed",
        }
    }
}

macro_rules! figures {
    ($($(#[$doc:meta])* $name:ident: $atomic:ident $plain:ident,)*) => {
        /// The lane's figures, each an atomic that the lane stores after a turn that did
        /// more than to write on: they are not of one instant together.
        #[derive(Debug, Default)]
        pub struct LaneStatus {
            condition: AtomicU8,
            alarms: AtomicU8,
            is_held: AtomicBool,
            is_starved: AtomicBool,
            line_errors: [AtomicU64; LINE_ERRORS],
            $($name: $atomic,)*
        }

        /// Figures of a lane, read at one time.
        #[derive(Clone, PartialEq, Eq, Debug)]
        pub struct LaneFigures {
            /// How it is.
            pub condition: Condition,
            /// Whether the partner holds it.
            pub is_held: bool,
            /// Whether its job waits for data while the line stands idle.
            pub is_starved: bool,
            /// Line errors, by [`LineErrorKind`] in the order of their codes.
            pub line_errors: [u64; LINE_ERRORS],
            /// Alarms that are raised.
            pub alarms: Vec<AlarmKind>,
            $($(#[$doc])* pub $name: $plain,)*
        }

        impl LaneStatus {
            /// All figures.
            pub fn read(&self) -> LaneFigures {
                let alarms = self.alarms.load(Ordering::Relaxed);
                LaneFigures {
                    condition: Condition::ALL
                        [usize::from(self.condition.load(Ordering::Relaxed)) % 6],
                    is_held: self.is_held.load(Ordering::Relaxed),
                    is_starved: self.is_starved.load(Ordering::Relaxed),
                    line_errors: std::array::from_fn(|at| {
                        self.line_errors[at].load(Ordering::Relaxed)
                    }),
                    alarms: AlarmKind::ALL
                        .into_iter()
                        .filter(|kind| alarms & kind.bit() != 0)
                        .collect(),
                    $($name: self.$name.load(Ordering::Relaxed),)*
                }
            }
        }
    };
}

figures! {
    /// Good bytes received.
    bytes_in: AtomicU64 u64,
    /// Bytes that the port took.
    bytes_out: AtomicU64 u64,
    /// How often the partner held us.
    holds: AtomicU64 u64,
    /// For how long in all, in µs.
    held_micros: AtomicU64 u64,
    /// Characters that were beyond recall when the partner held us, in all.
    after_hold: AtomicU64 u64,
    /// The most at one time.
    after_hold_most: AtomicU64 u64,
    /// How often the line stood still for a character or longer although bytes waited.
    gaps: AtomicU64 u64,
    /// The longest of these times, in µs.
    longest_gap_micros: AtomicU64 u64,
    /// How often a job waited for data while the line stood idle.
    starvations: AtomicU64 u64,
    /// For how long in all, in µs.
    starved_micros: AtomicU64 u64,
    /// Events that the plug-in was given.
    events: AtomicU64 u64,
    /// Units of fuel that it used.
    fuel: AtomicU64 u64,
    /// How often another plug-in took the place of one that had ended.
    restarts: AtomicU64 u64,
    /// How often the port was opened.
    opened: AtomicU64 u64,
    /// Notes and states that were left out because there were too many.
    left_out: AtomicU64 u64,
    /// What the endpoint's clients sent: jobs that have ended.
    endpoint_jobs: AtomicU64 u64,
    /// Those of them that failed.
    endpoint_failed: AtomicU64 u64,
    /// Bytes that the plug-in took of them.
    endpoint_bytes: AtomicU64 u64,
    /// Sights that a watcher had no room for.
    unseen: AtomicU64 u64,
    /// Bytes that have come and wait to be put away.
    to_put_away: AtomicU64 u64,
    /// The job under way, or 0.
    job: AtomicU32 u32,
    /// Bytes of its data that the plug-in took.
    job_taken: AtomicU64 u64,
    /// Bytes that wait in the transmit queue.
    waiting: AtomicU64 u64,
    /// Characters that may have left since the job began.
    job_maybe_left: AtomicU64 u64,
    /// Characters that surely have.
    job_surely_left: AtomicU64 u64,
    /// Bytes of its data that surely have: no more than either of two counts, as a
    /// plug-in adds characters to them.
    job_bytes_surely_left: AtomicU64 u64,
    /// Bytes of its data that the plug-in had taken when all that it had made of them had left.
    job_drained: AtomicU64 u64,
    /// Bytes in the buffer between the job's source and the plug-in.
    level: AtomicU64 u64,
}

/// What a lane counts by itself, to be shown; beside the channel's counters.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct LaneCounters {
    pub(super) starvations: u64,
    pub(super) starved: Micros,
    pub(super) restarts: u64,
    pub(super) opened: u64,
    pub(super) left_out: u64,
    pub(super) endpoint_jobs: u64,
    pub(super) endpoint_failed: u64,
    pub(super) endpoint_bytes: u64,
    pub(super) unseen: u64,
}

/// The job under way, as it is shown.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct JobFigures {
    pub(super) job: JobId,
    pub(super) taken: u64,
    pub(super) maybe_left: u64,
    pub(super) surely_left: u64,
    pub(super) bytes_surely_left: u64,
    pub(super) drained: u64,
    pub(super) level: u64,
}

impl JobFigures {
    /// Bytes of its data that have surely left: no more than the characters that
    /// have, nor than what the plug-in took less all that may still be on its way.
    pub(super) fn count_bytes(&mut self, waiting: usize) {
        let under_way = self.maybe_left.saturating_sub(self.surely_left);
        let behind = waiting as u64 + under_way + IN_THE_PLUGIN;
        self.bytes_surely_left = self.taken.saturating_sub(behind).min(self.surely_left);
    }
}

/// What a unit tells of the job under way.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(crate) struct UnitFigures {
    pub(crate) job: JobId,
    pub(crate) taken: u64,
    pub(crate) maybe_left: u64,
    pub(crate) surely_left: u64,
    pub(crate) bytes_left: u64,
    pub(crate) level: u64,
    pub(crate) is_held: bool,
    pub(crate) is_starved: bool,
}

impl UnitFigures {
    /// The unit waits for data, and nothing is on its way.
    fn is_drained(&self) -> bool {
        self.is_starved && self.maybe_left == self.surely_left && self.level == 0
    }
}

impl LaneStatus {
    /// How many bytes of this job's data the plug-in had taken when all that it had made of them had left;
    /// none while the lane does something else.
    pub fn drained(&self, job: JobId) -> Option<u64> {
        let is_its = self.job.load(Ordering::Acquire) == job.0;
        is_its.then(|| self.job_drained.load(Ordering::Relaxed))
    }

    pub(crate) fn store_unit_job(&self, figures: &UnitFigures) {
        self.store_job(&JobFigures {
            job: figures.job,
            taken: figures.taken,
            maybe_left: figures.maybe_left,
            surely_left: figures.surely_left,
            bytes_surely_left: figures.bytes_left,
            drained: if figures.is_drained() { figures.taken } else { 0 },
            level: figures.level,
        });
        self.is_held.store(figures.is_held, Ordering::Relaxed);
        self.is_starved.store(figures.is_starved, Ordering::Relaxed);
    }

    /// Bytes in and out, holds, µs held, starvations, µs starved.
    pub(crate) fn store_unit_counters(&self, counters: [u64; 6]) {
        let places = [
            &self.bytes_in,
            &self.bytes_out,
            &self.holds,
            &self.held_micros,
            &self.starvations,
            &self.starved_micros,
        ];
        for (place, count) in places.into_iter().zip(counters) {
            place.store(count, Ordering::Relaxed);
        }
    }

    /// How the lane is.
    pub fn condition(&self) -> Condition {
        Condition::ALL[usize::from(self.condition.load(Ordering::Relaxed)) % 6]
    }

    pub(crate) fn set_condition(&self, condition: Condition) {
        self.condition.store(condition as u8, Ordering::Relaxed);
    }

    /// Of this job's bytes, those that had surely left when it was last shown.
    pub(super) fn bytes_surely_left(&self, job: JobId) -> u64 {
        let is_shown = self.job.load(Ordering::Relaxed) == job.0;
        if is_shown { self.job_bytes_surely_left.load(Ordering::Relaxed) } else { 0 }
    }

    pub(super) fn set_alarms(&self, raised: impl Iterator<Item = AlarmKind>) {
        let bits = raised.fold(0, |bits, kind| bits | kind.bit());
        self.alarms.store(bits, Ordering::Relaxed);
    }

    pub(super) fn store_counters(&self, counters: &Counters) {
        self.bytes_in.store(counters.bytes_in, Ordering::Relaxed);
        self.bytes_out.store(counters.bytes_out, Ordering::Relaxed);
        self.holds.store(counters.holds, Ordering::Relaxed);
        self.after_hold.store(counters.after_hold, Ordering::Relaxed);
        self.after_hold_most.store(counters.after_hold_most, Ordering::Relaxed);
        self.held_micros.store(counters.held.0.max(0) as u64, Ordering::Relaxed);
        self.gaps.store(counters.gaps, Ordering::Relaxed);
        self.longest_gap_micros.store(counters.longest_gap.0.max(0) as u64, Ordering::Relaxed);
        self.is_held.store(counters.is_held(), Ordering::Relaxed);
        for (shown, count) in self.line_errors.iter().zip(counters.line_errors) {
            shown.store(count, Ordering::Relaxed);
        }
    }

    pub(super) fn store_plugin(&self, events: u64, fuel: u64, waiting: usize, to_put_away: u64) {
        self.events.store(events, Ordering::Relaxed);
        self.fuel.store(fuel, Ordering::Relaxed);
        self.waiting.store(waiting as u64, Ordering::Relaxed);
        self.to_put_away.store(to_put_away, Ordering::Relaxed);
    }

    pub(super) fn store_own(&self, own: &LaneCounters, starved_since: Option<Micros>, now: Micros) {
        let starved = own.starved + starved_since.map_or(Micros::ZERO, |since| now - since);
        self.starvations.store(own.starvations, Ordering::Relaxed);
        self.starved_micros.store(starved.0.max(0) as u64, Ordering::Relaxed);
        self.is_starved.store(starved_since.is_some(), Ordering::Relaxed);
        self.restarts.store(own.restarts, Ordering::Relaxed);
        self.opened.store(own.opened, Ordering::Relaxed);
        self.left_out.store(own.left_out, Ordering::Relaxed);
        self.endpoint_jobs.store(own.endpoint_jobs, Ordering::Relaxed);
        self.endpoint_failed.store(own.endpoint_failed, Ordering::Relaxed);
        self.endpoint_bytes.store(own.endpoint_bytes, Ordering::Relaxed);
        self.unseen.store(own.unseen, Ordering::Relaxed);
    }

    pub(super) fn store_job(&self, job: &JobFigures) {
        // First: who sees the job must not see another one's.
        self.job_drained.store(job.drained, Ordering::Relaxed);
        self.job.store(job.job.0, Ordering::Release);
        self.job_taken.store(job.taken, Ordering::Relaxed);
        self.job_maybe_left.store(job.maybe_left, Ordering::Relaxed);
        self.job_surely_left.store(job.surely_left, Ordering::Relaxed);
        self.job_bytes_surely_left.store(job.bytes_surely_left, Ordering::Relaxed);
        self.level.store(job.level, Ordering::Relaxed);
    }
}

impl AlarmKind {
    fn bit(self) -> u8 {
        1 << (self as u8)
    }
}
