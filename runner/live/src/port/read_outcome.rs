//! What a read of a port found.

use softplug_abi::LinkDownReason;

/// What a read found.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum ReadOutcome {
    /// So many bytes were read, marks included; there may be more.
    Read(usize),
    /// Nothing is there.
    Empty,
    /// The port is gone for good: drop it at once, which frees its name.
    Gone(LinkDownReason),
}
