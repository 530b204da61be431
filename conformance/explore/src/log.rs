//! What happened at one end of the line, written down for a trace.

use crate::end::JobGiven;
use softplug_abi::{LineErrorKind, Micros};
use softplug_link::{Observed, Recorder};

/// All that one plug-in was given, and what it did.
#[derive(Debug, Default)]
pub struct Log {
    pub(crate) inputs: Vec<(Micros, Input)>,
    pub(crate) recorder: Recorder,
}

/// Something that a plug-in was given.
#[derive(Clone, Debug)]
pub(crate) enum Input {
    Byte(u8),
    Damaged(LineErrorKind, Option<u8>),
    Job(u32, JobGiven),
    Abort(u32),
    Pause(u32),
    Resume(u32),
    Force,
    Down,
    Up,
    Swap,
}

impl Log {
    /// What it did, in order.
    pub fn observed(&self) -> &[(Micros, Observed)] {
        &self.recorder.observed
    }
}
