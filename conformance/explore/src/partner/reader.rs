//! A machine with a small buffer that holds the plug-in with XOFF, reads what comes, and sends
//! a few characters itself.

use super::transmitter::{CHARACTER, Transmitter};
use super::{Partner, Sent};
use crate::end::Told;
use crate::hash::Hash128;
use crate::promise::{Breach, Wrong};
use softplug_abi::{LineErrorKind, Micros};
use std::hash::Hash;
use std::sync::Arc;

const XON: u8 = 0x11;
const XOFF: u8 = 0x13;

/// It sends its first character so long after the first one has come.
const BEFORE_OWN: Micros = Micros(2_500);
/// It takes a character out of its buffer so often.
const TAKES: Micros = Micros(3_000);
/// It holds with so many characters in the buffer.
const HOLDS_AT: usize = 2;

#[derive(Clone)]
pub(crate) struct Reader {
    /// What it sends.
    own: &'static [u8],
    /// It sends XON when a job begins.
    lets_go: bool,
    /// It judges what the plug-in sends and delivers, character by character.
    judges: bool,
    /// What the plug-in is to send.
    expected: Arc<[u8]>,
    /// How much of it has left the plug-in.
    left: usize,
    buffered: usize,
    takes_at: Option<Micros>,
    has_held: bool,
    /// The plug-in was told to hold, and when; what is on the wire then still comes.
    held_since: Option<Micros>,
    sends_at: Option<Micros>,
    sent: usize,
    /// The plug-in has stopped it.
    is_stopped: bool,
    transmitter: Transmitter,
    /// What arrived at the plug-in since the last delivery.
    arrived: Vec<u8>,
    is_damaged: bool,
}

impl Reader {
    /// It sends `own` when the first character has come.
    pub(crate) fn new(own: &'static [u8]) -> Self {
        Self {
            own,
            lets_go: false,
            judges: true,
            expected: Arc::default(),
            left: 0,
            buffered: 0,
            takes_at: None,
            has_held: false,
            held_since: None,
            sends_at: None,
            sent: 0,
            is_stopped: false,
            transmitter: Transmitter::default(),
            arrived: Vec::new(),
            is_damaged: false,
        }
    }

    /// It sends `own` when the link is open. What it sends is not what is delivered.
    pub(crate) fn sending_at_once(own: &'static [u8]) -> Self {
        Self { sends_at: Some(Micros::ZERO), ..Self::unjudged(own) }
    }

    /// It lets the plug-in go when a job begins.
    pub(crate) fn letting_go(own: &'static [u8]) -> Self {
        Self { lets_go: true, ..Self::unjudged(own) }
    }

    /// What it gets is not what the plug-in is given, nor the other way round.
    pub(crate) fn unjudged(own: &'static [u8]) -> Self {
        Self { judges: false, ..Self::new(own) }
    }
}

impl Partner for Reader {
    fn fork(&self) -> Box<dyn Partner> {
        Box::new(self.clone())
    }

    fn hash(&self, now: Micros, state: &mut Hash128) {
        let ahead = |time: Option<Micros>| time.map(|time| time.0 - now.0);
        (&self.expected, self.left, self.buffered, self.has_held, self.is_stopped).hash(state);
        (self.sent, &self.arrived, self.is_damaged).hash(state);
        self.transmitter.hash(now, state);
        ahead(self.takes_at).hash(state);
        ahead(self.sends_at).hash(state);
        // What was told at this instant still counts otherwise than what was told before.
        self.held_since.map(|since| since < now).hash(state);
    }

    fn next(&self) -> Option<Micros> {
        let has_own = !self.is_stopped && self.sent < self.own.len();
        [self.takes_at, self.sends_at.filter(|_| has_own), self.transmitter.next()]
            .into_iter()
            .flatten()
            .min()
    }

    fn tick(&mut self, now: Micros) -> Sent {
        if self.takes_at.is_some_and(|at| at <= now) {
            self.buffered -= 1;
            self.takes_at = (self.buffered > 0).then(|| now + TAKES);
            if self.buffered == 0 && self.has_held {
                self.has_held = false;
                self.transmitter.send(&[XON]);
            }
        }
        if !self.is_stopped
            && self.sent < self.own.len()
            && self.sends_at.is_some_and(|at| at <= now)
        {
            self.transmitter.send(&[self.own[self.sent]]);
            self.sent += 1;
            self.sends_at = Some(now + CHARACTER);
        }
        self.transmitter.transmit(now)
    }

    fn receive(&mut self, now: Micros, byte: u8, damage: Option<LineErrorKind>) -> Sent {
        match (byte, damage) {
            (XON, None) => self.is_stopped = false,
            (XOFF, None) => self.is_stopped = true,
            _ => {
                self.buffered += 1;
                self.takes_at = self.takes_at.or(Some(now + TAKES));
                self.sends_at = self.sends_at.or(Some(now + BEFORE_OWN));
                if self.buffered >= HOLDS_AT && !self.has_held {
                    self.has_held = true;
                    self.transmitter.send(&[XOFF]);
                }
            }
        }
        self.transmitter.transmit(now)
    }

    fn begins(&mut self, data: &Arc<[u8]>) {
        self.expected = Arc::clone(data);
        self.left = 0;
        if self.lets_go {
            self.transmitter.send(&[XON]);
        }
    }

    fn leaves(&mut self, end: Micros, byte: u8) -> Option<Breach> {
        if matches!(byte, XON | XOFF) || !self.judges {
            return None;
        }
        let expected = self.expected.get(self.left).copied();
        self.left += 1;
        if expected != Some(byte) {
            let what = match expected {
                Some(expected) => format!("{byte:02X} where {expected:02X} had to come"),
                None => format!("{byte:02X} where nothing had to come"),
            };
            return Some(Breach::WrongOnLine { what });
        }
        let is_late = self.held_since.is_some_and(|since| end - CHARACTER >= since);
        is_late.then_some(Breach::SentWhileHeld)
    }

    fn arrives(&mut self, now: Micros, byte: u8, damage: Option<LineErrorKind>) {
        match (byte, damage) {
            _ if !self.judges => {}
            (XON, None) => self.held_since = None,
            (XOFF, None) => self.held_since = self.held_since.or(Some(now)),
            (_, Some(LineErrorKind::Break)) => self.is_damaged |= !self.arrived.is_empty(),
            (byte, damage) => {
                self.arrived.push(byte);
                self.is_damaged |= damage.is_some();
            }
        }
    }

    fn port_is_back(&mut self) {
        self.held_since = None;
    }

    fn told(&mut self, told: &Told, wrong: &Wrong) -> Option<Breach> {
        match told {
            _ if !self.judges => None,
            Told::Delivered { bytes, failure } => {
                let arrived = std::mem::take(&mut self.arrived);
                let is_damaged = std::mem::take(&mut self.is_damaged);
                let is_whole = *bytes == arrived;
                match failure {
                    None if !is_whole || is_damaged => {
                        Some(Breach::Altered { delivered: bytes.clone() })
                    }
                    Some(failure) if !is_damaged && !wrong.asked[0] => {
                        Some(Breach::FailedForNothing { failure: *failure })
                    }
                    _ => None,
                }
            }
            Told::Done if self.left < self.expected.len() => Some(Breach::NotDelivered),
            Told::Failed(failure) if *wrong == Wrong::default() => {
                Some(Breach::FailedForNothing { failure: *failure })
            }
            Told::Done | Told::Failed(_) | Told::Requested(_) => None,
        }
    }

    fn at_rest(&self, _: &Wrong) -> Option<Breach> {
        let is_lost = self.judges && !self.arrived.is_empty();
        is_lost.then(|| Breach::Lost { bytes: self.arrived.clone() })
    }
}
