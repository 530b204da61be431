//! How jobs end.

use softplug_abi::{Failure, JobId};

/// How a job ended.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct JobEnd {
    /// The job.
    pub job: JobId,
    /// How.
    pub outcome: JobOutcome,
    /// Bytes of its data that the plug-in took.
    pub taken: u64,
    /// Bytes that left for it, as the plug-in counts; of a job that is not done
    /// no more than surely have.
    pub sent: u64,
    /// Characters that may have left the line since it began, the protocol's
    /// own ones included.
    pub maybe_left: u64,
    /// Characters that surely have.
    pub surely_left: u64,
    /// Bytes of its data of which some may have left, or may leave yet.
    pub bytes_maybe_left: u64,
    /// Bytes of its data that surely had when the lane last looked before the end.
    pub bytes_surely_left: u64,
}

impl JobEnd {
    /// Of a job that was never begun.
    pub(crate) fn unbegun(job: JobId, outcome: JobOutcome, sent: u64) -> Self {
        Self {
            job,
            outcome,
            taken: 0,
            sent,
            maybe_left: 0,
            surely_left: 0,
            bytes_maybe_left: 0,
            bytes_surely_left: 0,
        }
    }
}

/// How a job ended.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum JobOutcome {
    /// The last bit has left.
    Done,
    /// It was given up, or aborted.
    Failed {
        /// Why.
        failure: Failure,
        /// The protocol's own code, 0 without.
        status: u16,
    },
    /// The program cannot be sent; nothing was.
    CheckFailed {
        /// Why.
        failure: Failure,
        /// The protocol's own code, 0 without.
        status: u16,
        /// Line of the fault, from 1; 0 without.
        line: u32,
        /// Column of the fault in bytes, from 1; 0 without.
        column: u32,
    },
    /// Its data could not be read to the end; the job was aborted.
    SourceFailed(String),
}
