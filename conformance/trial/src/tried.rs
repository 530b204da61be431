//! What came of a trial.

use softplug_abi::{Failure, Micros, NoteLevel};
use softplug_machines::pulse_lathe::Lathe;

use crate::exchange::Side;

/// What came of it.
#[derive(Debug)]
pub struct Tried {
    /// `None`: the plug-in waits for something that only a real partner sends.
    pub end: Option<End>,
    /// Bytes of the program that were taken.
    pub supplied: u64,
    /// What was on the wire.
    pub wire: Vec<u8>,
    /// What was said both ways; empty if the protocol is no dialogue.
    pub dialogue: Vec<(Side, Vec<u8>)>,
    /// Bytes that answered the job.
    pub answered: u64,
    /// How long it took on the line.
    pub took: Micros,
    /// What the plug-in said of it.
    pub notes: Vec<Note>,
    /// The lathe that took its pulses, if that is what the program is.
    pub lathe: Option<Box<Lathe>>,
}

/// How a job ended.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum End {
    /// All of it was sent.
    Done,
    /// The plug-in failed it.
    Failed {
        /// Why.
        failure: Failure,
        /// The protocol's own code of it; 0 without one.
        status: u16,
    },
    /// The plug-in looked at the program, and sends nothing of it.
    CheckFailed {
        /// Why.
        failure: Failure,
        /// The protocol's own code of it; 0 without one.
        status: u16,
        /// The line, counted from 1; 0 is unknown.
        line: u32,
        /// The column, counted from 1; 0 is unknown.
        column: u32,
    },
}

impl End {
    pub(crate) fn is_unanswered(&self) -> bool {
        let unanswered = [Failure::NoAnswer, Failure::AttemptsUsedUp];
        matches!(self, Self::Failed { failure, .. } if unanswered.contains(failure))
    }
}

/// Something that a plug-in said.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Note {
    /// How grave it is.
    pub level: NoteLevel,
    /// The plug-in's own number of it.
    pub code: u16,
    /// Its text.
    pub text: String,
}
