//! A link's clock: whole microseconds since its first open, monotonic.

#[cfg(target_os = "linux")]
use rustix::time::{ClockId, Timespec, clock_gettime};
use softplug_abi::Micros;

/// A clock over the system's monotonic one; on Linux that is CLOCK_MONOTONIC.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Clock {
    origin_nanos: i64,
}

impl Clock {
    /// A clock that reads zero now.
    pub fn start() -> Self {
        Self { origin_nanos: monotonic_nanos() }
    }

    /// Time since the start.
    pub fn now(&self) -> Micros {
        Micros((monotonic_nanos() - self.origin_nanos) / 1_000)
    }

    /// An instant of this clock as CLOCK_MONOTONIC has it; never 0 or less,
    /// which a timerfd would take for "no deadline".
    #[cfg(target_os = "linux")]
    pub(crate) fn timespec(self, at: Micros) -> Timespec {
        let nanos = at.0.saturating_mul(1_000).saturating_add(self.origin_nanos).max(1);
        Timespec { tv_sec: nanos / 1_000_000_000, tv_nsec: nanos % 1_000_000_000 }
    }
}

/// Since the system began: enough for 292 years.
#[cfg(target_os = "linux")]
fn monotonic_nanos() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

/// Since this was asked first.
#[cfg(not(target_os = "linux"))]
fn monotonic_nanos() -> i64 {
    use std::sync::LazyLock;
    use std::time::Instant;

    static FIRST: LazyLock<Instant> = LazyLock::new(Instant::now);
    i64::try_from(FIRST.elapsed().as_nanos()).unwrap_or(i64::MAX)
}
