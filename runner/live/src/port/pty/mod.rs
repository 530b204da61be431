//! Ptys: a pair for simulators, and its master as a port. Only Linux has them here.

#[cfg(not(target_os = "linux"))]
mod elsewhere;
#[cfg(target_os = "linux")]
mod linux;

#[cfg(not(target_os = "linux"))]
pub use elsewhere::{PtyPair, PtyPort};
#[cfg(target_os = "linux")]
pub use linux::{PtyPair, PtyPort};

/// The rate that Linux gives a new terminal.
pub(crate) const FRESH_BAUD: u32 = 38_400;
