//! Why something failed: a failure with the protocol's own number beside it.

use core::num::NonZeroU32;
use softplug_plugin::{Failure, State, StateReader, StateWriter};

/// A failure and its status, event class and number, in one word: it is passed
/// on and kept in many places.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Cause(NonZeroU32);

pub(crate) const fn cause(failure: Failure, status: u16) -> Cause {
    match NonZeroU32::new((failure.code() as u32) << 16 | status as u32) {
        Some(word) => Cause(word),
        None => unreachable!(),
    }
}

pub(crate) const ABORTED: Cause = cause(Failure::Aborted, 0);
pub(crate) const LINK_DOWN: Cause = cause(Failure::LinkDown, 0);
pub(crate) const NOT_SUPPORTED: Cause = cause(Failure::NotSupported, 0);
pub(crate) const BAD_JOB: Cause = cause(Failure::BadJob, 0);
pub(crate) const BAD_LENGTH: Cause = cause(Failure::BadJob, 0x050E);
pub(crate) const JOB_TOO_LONG: Cause = cause(Failure::TooLong, 0x0517);
/// Without doubling, `DLE ETX` in data would end the block.
pub(crate) const END_IN_DATA: Cause = cause(Failure::UnsupportedCharacter, 0);
/// A character of the line has fewer bits than a byte of data.
pub(crate) const TOO_WIDE: Cause = cause(Failure::UnsupportedCharacter, 0);
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

impl Cause {
    pub(crate) fn failure(self) -> Failure {
        Failure::from_code((self.0.get() >> 16) as u16).unwrap_or(Failure::Internal)
    }

    pub(crate) fn status(self) -> u16 {
        self.0.get() as u16
    }
}

/// A cause, or none, that lasts longer than an event.
#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Kept(pub(crate) Option<Cause>);

impl State for Kept {
    fn save(&self, state: &mut StateWriter<'_>) {
        state.u32(self.0.map_or(0, |cause| cause.0.get()));
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        self.0 = NonZeroU32::new(state.u32()).map(Cause);
    }
}
