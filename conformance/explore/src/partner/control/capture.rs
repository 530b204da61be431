//! What a plug-in must deliver of what the control punches.

use super::{DC1, DC2, DC3, DC4, EOB};
use crate::hash::Hash128;
use crate::promise::Breach;
use softplug_abi::{Failure, Micros};
use std::cmp::Ordering;
use std::collections::VecDeque;
use std::hash::Hash;

/// As the plan sets `quiet_time`, the only setting that is known here.
const QUIET_TIME: Micros = Micros(31_000);

/// Excused: a DC2 behind the closing `%` ends the capture and begins another, but is nothing as
/// long as no EOB has told the code. With `false` that is held against the plug-in.
const IS_DC2_NOTHING_WITHOUT_CODE: bool = true;

/// The captures that come of what arrived at the plug-in.
#[derive(Clone, Debug, Default)]
pub(super) struct Captures {
    /// Captures that have ended and must be told of now.
    ended: VecDeque<Tape>,
    state: State,
    /// Between DC2 and `%`: after so much silence there is no capture any more.
    quiet_at: Option<Micros>,
}

#[derive(Clone, Hash, Debug, Default)]
enum State {
    #[default]
    Idle,
    /// DC2 came and no `%` yet.
    Punching { is_certain: bool },
    /// A `%` came.
    Receiving(Tape),
    /// DC4 came.
    Leaving(Tape),
}

/// A capture, from its first `%` on.
#[derive(Clone, Hash, Debug)]
struct Tape {
    /// Its characters, and `None` where one was damaged.
    text: Vec<Option<u8>>,
    /// A break came, which has no character.
    is_broken: bool,
    /// The closing `%` came.
    is_closed: bool,
    /// An EOB came behind that; another program that follows has it behind its `%`.
    has_eob_behind: bool,
    /// An EOB told the code. Before that, 13 can be EIA's digit 3 and is no DC3.
    has_code: bool,
    is_certain: bool,
}

impl Captures {
    pub(super) fn hash(&self, now: Micros, state: &mut Hash128) {
        (&self.ended, &self.state).hash(state);
        self.quiet_at.map(|at| if at < now { -1 } else { at.0 - now.0 }).hash(state);
    }

    /// A sound character arrives; `capture` says whether a DC2 begins one, and whether that is
    /// certain.
    pub(super) fn arrives(&mut self, now: Micros, byte: u8, capture: Option<bool>) {
        self.end_silence(now);
        self.state = match (std::mem::take(&mut self.state), byte) {
            (State::Leaving(tape), DC1 | DC2) => {
                self.ended.push_back(tape);
                if byte == DC2 { State::punching(capture) } else { State::Idle }
            }
            // The page says nothing of a DC2 between the closing % and DC4: it is the next one's.
            (State::Receiving(tape), DC2)
                if tape.is_closed && (tape.has_code || !IS_DC2_NOTHING_WITHOUT_CODE) =>
            {
                self.ended.push_back(tape);
                State::punching(capture)
            }
            (State::Idle, DC2) => State::punching(capture),
            (State::Punching { .. }, DC2) if capture == Some(true) => State::punching(capture),
            (State::Punching { .. }, DC4) => State::Idle,
            (State::Receiving(tape), DC4) => State::Leaving(tape),
            (state, DC1 | DC2 | DC4) => state,
            (State::Receiving(tape), DC3) if tape.has_code => State::Receiving(tape),
            (State::Punching { is_certain }, b'%') => State::Receiving(Tape::new(is_certain)),
            (State::Receiving(mut tape), byte) if tape.is_closed => {
                tape.has_code |= byte == EOB;
                if is_blank(byte) {
                    tape.has_eob_behind |= byte == EOB;
                    State::Receiving(tape)
                } else {
                    // Another program, with the closing % as its first if it has none.
                    let mut next = Tape { has_code: tape.has_code, ..Tape::new(tape.is_certain) };
                    if byte != b'%' {
                        next.text.extend(tape.has_eob_behind.then_some(Some(EOB)));
                        next.text.push(Some(byte));
                    }
                    self.ended.push_back(tape);
                    State::Receiving(next)
                }
            }
            (State::Receiving(mut tape), byte) => {
                tape.text.push(Some(byte));
                tape.has_code |= byte == EOB;
                tape.is_closed = byte == b'%';
                State::Receiving(tape)
            }
            (state, _) => state,
        };
        self.begin_silence(now);
    }

    /// A character arrives damaged: it is no control code, but it can be a `%` or an EOB.
    pub(super) fn arrives_damaged(&mut self, now: Micros, byte: u8) {
        self.end_silence(now);
        self.state = match std::mem::take(&mut self.state) {
            State::Punching { is_certain } if byte == b'%' => {
                State::Receiving(Tape { text: vec![None], ..Tape::new(is_certain) })
            }
            State::Receiving(mut tape) if !tape.is_closed => {
                tape.text.push(None);
                tape.has_code |= byte == EOB;
                tape.is_closed = byte == b'%';
                State::Receiving(tape)
            }
            state => state,
        };
        self.begin_silence(now);
    }

    /// The host forced the job to go on, or not: what is under way may have ended by that.
    pub(super) fn may_have_ended(&mut self) {
        match &mut self.state {
            State::Punching { is_certain } => *is_certain = false,
            State::Receiving(tape) | State::Leaving(tape) => tape.is_certain = false,
            State::Idle => {}
        }
    }

    /// A break arrives.
    pub(super) fn breaks(&mut self, now: Micros) {
        self.end_silence(now);
        if let State::Receiving(tape) = &mut self.state
            && !tape.is_closed
        {
            tape.is_broken = true;
        }
        self.begin_silence(now);
    }

    /// Whether a DC3 that arrives can be a digit of EIA.
    pub(super) fn takes_dc3(&self) -> bool {
        matches!(&self.state, State::Receiving(tape) if !tape.has_code)
    }

    /// A DC1 comes that a job waited for: the control reads again.
    pub(super) fn ended_by_dc1(&mut self) {
        self.quiet_at = None;
        match std::mem::take(&mut self.state) {
            State::Idle | State::Punching { .. } => {}
            State::Receiving(tape) | State::Leaving(tape) => self.ended.push_back(tape),
        }
    }

    /// A delivery at its end. `is_asked`: the host aborted something, or the port was gone.
    pub(super) fn delivered(
        &mut self,
        bytes: &[u8],
        failure: Option<Failure>,
        is_asked: bool,
    ) -> Option<Breach> {
        while let Some(tape) = self.ended.pop_front().or_else(|| self.take()) {
            let breach = tape.judge(bytes, failure, is_asked);
            if tape.is_certain || breach.is_none() {
                return breach;
            }
        }
        Some(Breach::Invented { delivered: bytes.to_vec() })
    }

    /// What was never told of.
    pub(super) fn at_rest(&self) -> Option<Breach> {
        let under_way = match &self.state {
            State::Receiving(tape) | State::Leaving(tape) => Some(tape),
            State::Idle | State::Punching { .. } => None,
        };
        let lost = self.ended.iter().chain(under_way).find(|tape| tape.is_certain)?;
        let bytes = lost.text.iter().map(|byte| byte.unwrap_or_default()).collect();
        Some(Breach::Lost { bytes })
    }

    /// What comes in the very instant in which the silence is over still belongs, but for what
    /// is put in behind that.
    fn end_silence(&mut self, now: Micros) {
        match self.quiet_at.take().map(|at| at.cmp(&now)) {
            Some(Ordering::Less) => self.state = State::Idle,
            Some(Ordering::Equal) => self.state = State::Punching { is_certain: false },
            Some(Ordering::Greater) | None => {}
        }
    }

    fn begin_silence(&mut self, now: Micros) {
        let is_punching = matches!(self.state, State::Punching { .. });
        self.quiet_at = is_punching.then(|| now + QUIET_TIME);
    }

    /// The capture that is under way ends.
    fn take(&mut self) -> Option<Tape> {
        match std::mem::take(&mut self.state) {
            State::Receiving(tape) | State::Leaving(tape) => Some(tape),
            state => {
                self.state = state;
                None
            }
        }
    }
}

impl State {
    fn punching(capture: Option<bool>) -> Self {
        capture.map_or(Self::Idle, |is_certain| Self::Punching { is_certain })
    }
}

impl Tape {
    fn new(is_certain: bool) -> Self {
        Self {
            text: vec![Some(b'%')],
            is_broken: false,
            is_closed: false,
            has_eob_behind: false,
            has_code: false,
            is_certain,
        }
    }

    /// What is wrong with a delivery of it.
    fn judge(&self, bytes: &[u8], failure: Option<Failure>, is_asked: bool) -> Option<Breach> {
        let is_damaged = self.is_broken || self.text.contains(&None);
        let is_so = match failure {
            None => self.is_closed && !is_damaged,
            Some(Failure::NoEndMark) => !self.is_closed,
            Some(Failure::LineError) => is_damaged,
            Some(Failure::Aborted | Failure::LinkDown) => is_asked,
            Some(_) => false,
        };
        match failure {
            Some(failure) if !is_so => Some(Breach::FailedForNothing { failure }),
            _ if is_so && self.is(bytes, failure.is_some()) => None,
            _ => Some(Breach::Altered { delivered: bytes.to_vec() }),
        }
    }

    /// Whether this is what came, with a line end behind it. A failed one may lack that.
    fn is(&self, bytes: &[u8], has_failed: bool) -> bool {
        let is_text = |bytes: &[u8]| {
            let mut pairs = bytes.iter().zip(&self.text);
            bytes.len() == self.text.len()
                && pairs.all(|(byte, came)| came.is_none_or(|came| came == *byte))
        };
        bytes.strip_suffix(b"\n").is_some_and(is_text) || (has_failed && is_text(bytes))
    }
}

fn is_blank(byte: u8) -> bool {
    matches!(byte, EOB | b' ')
}
