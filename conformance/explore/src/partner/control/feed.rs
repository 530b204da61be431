//! What must leave the plug-in for a job, and when nothing may.

use super::{DC1, DC2, DC3, EOB};
use crate::hash::Hash128;
use crate::promise::{Breach, Wrong};
use softplug_abi::{Failure, Micros};
use std::hash::Hash;
use std::sync::Arc;

/// Excused: a DC2 that comes while a job waits for its final DC3 begins no capture, whatever
/// the control says behind it. With `false` that is held against the plug-in.
const IS_DEAF_AT_END: bool = true;

/// A job as the control sees it, by what leaves the plug-in and what arrives there.
#[derive(Clone, Debug, Default)]
pub(super) struct Feed {
    state: State,
    /// What is to leave for the job.
    tape: Arc<[u8]>,
    /// How much of it has begun to leave.
    left: usize,
    /// When the stop bit of the last character ends.
    last_end: Option<Micros>,
    /// The host went on although it was held: whether the plug-in waits is not known until the next
    /// DC1 or DC3.
    pub(super) is_forced: bool,
}

#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
enum State {
    /// There is no job. A DC1 came that the next one starts with, or none.
    Idle {
        is_ready: bool,
    },
    /// The job waits for its first DC1.
    Waiting,
    Sending,
    /// A DC3 came.
    Held,
    /// The final DC3 came: nothing is left but to tell that the job is done.
    Ended,
}

impl Default for State {
    fn default() -> Self {
        Self::Idle { is_ready: false }
    }
}

impl Feed {
    pub(super) fn hash(&self, now: Micros, state: &mut Hash128) {
        (self.state, &self.tape, self.left, self.is_forced).hash(state);
        self.last_end.filter(|end| *end >= now).map(|end| end.0 - now.0).hash(state);
    }

    pub(super) fn begin(&mut self, data: &[u8]) {
        let is_ready = self.state == State::Idle { is_ready: true };
        let state = if is_ready { State::Sending } else { State::Waiting };
        *self = Self { state, tape: tape(data).into(), left: 0, last_end: None, is_forced: false };
    }

    /// A character begins to leave. The plug-in has no cause to send codes of its own: nothing
    /// that the control punches is too much for the host.
    pub(super) fn leaves(&mut self, end: Micros, byte: u8) -> Option<Breach> {
        let is_idle = matches!(self.state, State::Idle { .. });
        let expected = self.tape.get(self.left).copied().filter(|_| !is_idle);
        let is_held = matches!(self.state, State::Waiting | State::Held | State::Ended);
        self.left += 1;
        self.last_end = Some(end);
        if expected != Some(byte) {
            let what = match expected {
                Some(expected) => format!("{byte:02X} where {expected:02X} had to come"),
                None => format!("{byte:02X} where nothing had to come"),
            };
            return Some(Breach::WrongOnLine { what });
        }
        if is_held {
            self.state = State::Sending;
            return Some(Breach::SentWhileHeld);
        }
        None
    }

    /// A sound character arrives at the plug-in.
    pub(super) fn arrives(&mut self, now: Micros, byte: u8) {
        self.is_forced &= !matches!(byte, DC1 | DC3);
        self.state = match (self.state, byte) {
            (State::Idle { .. }, DC1) => State::Idle { is_ready: true },
            (State::Idle { .. }, DC2 | DC3) => State::Idle { is_ready: false },
            (State::Waiting | State::Held, DC1) => State::Sending,
            (State::Sending, DC3) if self.has_left(now) => State::Ended,
            (State::Sending, DC3) => State::Held,
            (state, _) => state,
        };
    }

    /// Whether a DC1 that arrives lets the job begin or go on.
    pub(super) fn awaits_dc1(&self) -> bool {
        matches!(self.state, State::Waiting | State::Held)
    }

    /// Whether a DC2 that arrives begins a capture; if so, whether that is certain. In the very
    /// instant in which the last bit leaves, it can come before that or behind it.
    pub(super) fn lets_capture(&self, now: Micros) -> Option<bool> {
        let behind = self.lets_capture_if(self.has_left(now));
        if self.last_end != Some(now) {
            return behind.then_some(!self.is_forced);
        }
        let before = self.lets_capture_if(false);
        (before || behind).then_some(before && behind)
    }

    fn lets_capture_if(&self, has_left: bool) -> bool {
        match self.state {
            State::Idle { .. } | State::Waiting => true,
            State::Held => !(IS_DEAF_AT_END && has_left),
            State::Sending | State::Ended => !IS_DEAF_AT_END && has_left,
        }
    }

    pub(super) fn done(&mut self) -> Option<Breach> {
        self.state = State::default();
        (self.left < self.tape.len()).then_some(Breach::NotDelivered)
    }

    pub(super) fn failed(&mut self, failure: Failure, wrong: &Wrong) -> Option<Breach> {
        let state = std::mem::take(&mut self.state);
        let is_right = match failure {
            Failure::NoAnswer => state == State::Waiting,
            Failure::HeldTooLong => state == State::Held,
            Failure::Aborted | Failure::LinkDown => wrong.asked[0],
            _ => false,
        };
        let is_for_nothing = !is_right || *wrong == Wrong::default();
        is_for_nothing.then_some(Breach::FailedForNothing { failure })
    }

    /// Whether the stop bit of the closing `%` has ended.
    fn has_left(&self, now: Micros) -> bool {
        self.left == self.tape.len() && self.last_end.is_some_and(|end| end <= now)
    }
}

/// What leaves for blocks that need no more than the `%` around them.
fn tape(data: &[u8]) -> Vec<u8> {
    let mut tape = vec![b'%', EOB];
    tape.extend_from_slice(data);
    if tape.last() != Some(&EOB) {
        tape.push(EOB);
    }
    tape.push(b'%');
    tape
}
