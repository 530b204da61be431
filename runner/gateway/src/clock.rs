//! A link's clock: whole microseconds since its first open, monotonic.

use rustix::time::{ClockId, Timespec, clock_gettime};
use softplug_abi::Micros;

/// A clock over CLOCK_MONOTONIC.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Clock {
    origin_nanos: i128,
}

impl Clock {
    /// A clock that reads zero now.
    pub fn start() -> Self {
        Self { origin_nanos: monotonic_nanos() }
    }

    /// Time since the start.
    pub fn now(&self) -> Micros {
        Micros(((monotonic_nanos() - self.origin_nanos) / 1_000) as i64)
    }

    /// An instant of this clock as CLOCK_MONOTONIC has it; never 0 or less,
    /// which a timerfd would take for "no deadline".
    pub(crate) fn timespec(&self, at: Micros) -> Timespec {
        let nanos = (self.origin_nanos + i128::from(at.0) * 1_000).max(1);
        let seconds = i64::try_from(nanos / 1_000_000_000).unwrap_or(i64::MAX);
        Timespec { tv_sec: seconds, tv_nsec: (nanos % 1_000_000_000) as _ }
    }
}

fn monotonic_nanos() -> i128 {
    let now = clock_gettime(ClockId::Monotonic);
    i128::from(now.tv_sec) * 1_000_000_000 + i128::from(now.tv_nsec)
}
