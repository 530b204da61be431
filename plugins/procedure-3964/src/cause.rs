//! Why something failed: a failure with the protocol's own number beside it.

use softplug_plugin::{Context, Failure, NoteLevel, StateReader, StateWriter};

/// A failure and its status: event class and number.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Cause {
    pub(crate) failure: Failure,
    pub(crate) status: u16,
}

const fn cause(failure: Failure, status: u16) -> Cause {
    Cause { failure, status }
}

pub(crate) const ABORTED: Cause = cause(Failure::Aborted, 0);
pub(crate) const LINK_DOWN: Cause = cause(Failure::LinkDown, 0);
pub(crate) const NOT_SUPPORTED: Cause = cause(Failure::NotSupported, 0);
pub(crate) const BAD_JOB: Cause = cause(Failure::BadJob, 0);
pub(crate) const BAD_LENGTH: Cause = cause(Failure::BadJob, 0x050E);
pub(crate) const JOB_TOO_LONG: Cause = cause(Failure::TooLong, 0x0517);
/// Without doubling, `DLE ETX` in data would end the block.
pub(crate) const END_IN_DATA: Cause = cause(Failure::UnsupportedCharacter, 0);
pub(crate) const SET_UP_REFUSED: Cause = cause(Failure::Refused, 0x0702);
pub(crate) const SET_UP_UNANSWERED: Cause = cause(Failure::NoAnswer, 0x0703);
pub(crate) const DISTURBED: Cause = cause(Failure::Protocol, 0x0704);
pub(crate) const STOPPED: Cause = cause(Failure::Refused, 0x0705);
pub(crate) const END_REFUSED: Cause = cause(Failure::Refused, 0x0706);
pub(crate) const END_UNANSWERED: Cause = cause(Failure::NoAnswer, 0x0707);
pub(crate) const ATTEMPTS_USED_UP: Cause = cause(Failure::AttemptsUsedUp, 0x070A);
pub(crate) const BOTH_HIGH: Cause = cause(Failure::Conflict, 0x070B);
pub(crate) const BOTH_LOW: Cause = cause(Failure::Conflict, 0x070C);
pub(crate) const TOO_EARLY: Cause = cause(Failure::Protocol, 0x0802);
pub(crate) const LONE_DLE: Cause = cause(Failure::Protocol, 0x0805);
pub(crate) const SILENCE: Cause = cause(Failure::NoAnswer, 0x0806);
pub(crate) const WRONG_BCC: Cause = cause(Failure::Checksum, 0x0808);
pub(crate) const NO_BUFFER: Cause = cause(Failure::NoBuffer, 0x080A);
pub(crate) const DAMAGED: Cause = cause(Failure::LineError, 0x080C);
pub(crate) const BREAK: Cause = cause(Failure::Break, 0x080D);
pub(crate) const BLOCK_TOO_LONG: Cause = cause(Failure::TooLong, 0);
pub(crate) const NO_REACTION: Cause = cause(Failure::NoAnswer, 0);
pub(crate) const WRONG_REACTION: Cause = cause(Failure::Protocol, 0);

/// Number of the note that the first repetition is under way.
pub(crate) const FIRST_REPETITION: u16 = 0x0701;
/// Number of the note that NAK was sent and a repetition is expected.
pub(crate) const NAK_SENT: u16 = 0x0801;
/// Number of the note on characters in idle.
pub(crate) const IDLE_GARBAGE: u16 = 0x0802;

/// Room in the output that notes leave free: what must be said goes first.
const KEPT_FREE: usize = 2_048;

impl Cause {
    pub(crate) fn save(cause: Option<Self>, state: &mut StateWriter<'_>) {
        state.failure(cause.map(|cause| cause.failure));
        state.u16(cause.map_or(0, |cause| cause.status));
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Option<Self> {
        let failure = state.failure();
        let status = state.u16();
        failure.map(|failure| Self { failure, status })
    }
}

/// A line for the log, if there is space for it.
#[inline(never)]
pub(crate) fn note(link: &mut Context<'_>, level: NoteLevel, status: u16, text: &str) {
    if link.output_room() > KEPT_FREE {
        link.note(level, status, text);
    }
}

/// A warning for the log, if there is space for it.
pub(crate) fn warn(link: &mut Context<'_>, status: u16, text: &str) {
    note(link, NoteLevel::Warning, status, text);
}
