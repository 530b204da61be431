//! Waiting for a port, a deadline and a wake-up from another thread.

#[cfg(not(target_os = "linux"))]
mod elsewhere;
#[cfg(target_os = "linux")]
mod linux;

#[cfg(not(target_os = "linux"))]
pub use elsewhere::{Poller, Source, Waker};
#[cfg(target_os = "linux")]
pub use linux::{Poller, Source, Waker};

/// What to wait for on a port. Hang-ups are always told.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Interest {
    /// Bytes to read.
    pub read: bool,
    /// Room to write.
    pub write: bool,
}

impl Interest {
    /// Bytes to read only.
    pub const READ: Self = Self { read: true, write: false };
    /// Bytes to read or room to write.
    pub const BOTH: Self = Self { read: true, write: true };
}

/// Why waiting ended; at least one is set, or a signal came.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub struct Ready {
    /// The port can be read.
    pub readable: bool,
    /// The port takes bytes.
    pub writable: bool,
    /// The port has hung up: reading tells why.
    pub hangup: bool,
    /// The deadline has passed.
    pub timer: bool,
    /// Somebody woke us.
    pub woken: bool,
}
