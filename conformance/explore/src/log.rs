//! What happened at one end of the line, written down for a trace.

use softplug_abi::{LineErrorKind, Micros};
use softplug_link::{Observed, Recorder};

/// All that one plug-in was given on a way, and what it did.
///
/// The example of [`Exploration`](crate::Exploration) looks for a way.
#[derive(Debug, Default)]
pub struct Log {
    /// What it was given after its link was opened, in order.
    pub inputs: Vec<(Micros, Input)>,
    /// When the way ended.
    pub end: Micros,
    pub(crate) recorder: Recorder,
}

/// Something that a plug-in was given.
///
/// The example of [`Exploration`](crate::Exploration) looks for a way.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Input {
    /// A character.
    Byte(u8),
    /// A damaged one, or a break.
    Damaged(LineErrorKind, Option<u8>),
    /// A job begins.
    Job {
        /// Its id.
        id: u32,
        /// Place of its kind in the manifest.
        kind: u16,
        /// Its fields as value records.
        fields: Vec<u8>,
        /// All of its data.
        data: Vec<u8>,
    },
    /// The job, or with 0 the delivery, is aborted.
    Abort(u32),
    /// The job is to pause.
    Pause(u32),
    /// The job goes on.
    Resume(u32),
    /// The hold of the partner is passed over.
    Force,
    /// A request is granted.
    Grant(u32, Vec<u8>),
    /// The port is gone.
    Down,
    /// The port is back.
    Up,
    /// A new instance takes over.
    Swap,
}

impl Log {
    /// What it did, in order.
    pub fn observed(&self) -> &[(Micros, Observed)] {
        &self.recorder.observed
    }
}
