//! What a plug-in leaves behind that has ended.

use softplug_abi::EventKind;

use crate::recorder::Recording;

/// The end of a plug-in.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct LaneFault {
    /// The event that it failed on, if it was one.
    pub event: Option<EventKind>,
    /// What happened, in one sentence.
    pub sentence: String,
    /// What the plug-in said last.
    pub last_words: Option<String>,
    /// What led there, as the flight recorder has it; empty without one.
    pub recording: Recording,
    /// It was on probation. As a [fault](super::Report::Fault): the plug-in before it could
    /// not go on either.
    pub on_probation: bool,
}
