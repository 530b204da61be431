//! A small FANUC control: its tape reader reads what the plug-in sends, then its tape punch
//! punches a small tape, on the same line.

mod capture;
mod feed;

use self::capture::Captures;
use self::feed::Feed;
use super::transmitter::{CHARACTER, Transmitter};
use super::{Partner, Sent};
use crate::end::Told;
use crate::hash::Hash128;
use crate::promise::{Breach, Wrong};
use softplug_abi::{LineErrorKind, Micros};
use std::hash::Hash;
use std::sync::Arc;

const DC1: u8 = 0x11;
const DC2: u8 = 0x12;
const DC3: u8 = 0x13;
const DC4: u8 = 0x14;
const EOB: u8 = b'\n';

/// What it punches.
const TAPE: &[u8] = b"\x12%\nO2\n%\x14";
/// From the host's job, or from its last DC4, to its DC1.
const BEFORE_READING: Micros = Micros(2_300);
/// It takes a character out of its buffer so often.
const TAKES: Micros = Micros(3_000);
/// It holds with so many characters in the buffer.
const HOLDS_AT: u8 = 2;
/// After its DC1 it waits so long for a character; then the operator punches instead.
const GIVES_UP: Micros = Micros(15_000);
/// From the end of reading to its DC2.
const BEFORE_PUNCHING: Micros = Micros(4_700);

#[derive(Clone)]
pub(crate) struct Control {
    stage: Stage,
    /// When the stage goes on by itself.
    goes_on_at: Option<Micros>,
    /// It reads once more after it has punched, if it did not come to the end of the tape.
    may_read_again: bool,
    reader: Reader,
    /// Characters of its own tape that were punched.
    punched: usize,
    /// The plug-in has stopped the punch.
    is_stopped: bool,
    transmitter: Transmitter,
    feed: Feed,
    captures: Captures,
}

/// What the control is doing.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
enum Stage {
    /// Nothing, until a job begins and after all is done.
    Off,
    /// The job has begun: the operator presses READ.
    Called,
    BeforeReading,
    Reading,
    BeforePunching,
    Punching,
}

/// The tape reader with its buffer.
#[derive(Copy, Clone, Hash, Debug, Default)]
struct Reader {
    buffered: u8,
    has_held: bool,
    /// How many `%` came; the second one is the tape's end.
    percents: u8,
}

impl Control {
    pub(crate) fn new() -> Self {
        Self {
            stage: Stage::Off,
            goes_on_at: None,
            may_read_again: true,
            reader: Reader::default(),
            punched: 0,
            is_stopped: false,
            transmitter: Transmitter::default(),
            feed: Feed::default(),
            captures: Captures::default(),
        }
    }
}

impl Partner for Control {
    fn fork(&self) -> Box<dyn Partner> {
        Box::new(self.clone())
    }

    fn hash(&self, now: Micros, state: &mut Hash128) {
        let ahead = |time: Option<Micros>| time.map(|time| time.0 - now.0);
        (self.stage, ahead(self.goes_on_at), self.may_read_again, self.reader).hash(state);
        (self.punched, self.is_stopped).hash(state);
        self.transmitter.hash(now, state);
        self.feed.hash(now, state);
        self.captures.hash(now, state);
    }

    fn next(&self) -> Option<Micros> {
        let is_stopped = self.stage == Stage::Punching && self.is_stopped;
        [self.goes_on_at.filter(|_| !is_stopped), self.transmitter.next()]
            .into_iter()
            .flatten()
            .min()
    }

    fn tick(&mut self, now: Micros) -> Sent {
        let is_stopped = self.stage == Stage::Punching && self.is_stopped;
        if !is_stopped && self.goes_on_at.is_some_and(|at| at <= now) {
            self.go_on(now);
        }
        self.transmitter.transmit(now)
    }

    fn receive(&mut self, now: Micros, byte: u8, damage: Option<LineErrorKind>) -> Sent {
        match (byte, damage) {
            (DC1, None) => self.is_stopped = false,
            (DC3, None) => self.is_stopped = true,
            _ if self.stage == Stage::Reading => self.read(now, byte == b'%' && damage.is_none()),
            _ => {}
        }
        self.transmitter.transmit(now)
    }

    fn begins(&mut self, data: &Arc<[u8]>) {
        self.feed.begin(data);
        if self.stage == Stage::Off && self.may_read_again {
            self.stage = Stage::Called;
            self.goes_on_at = Some(Micros::ZERO);
        }
    }

    fn leaves(&mut self, end: Micros, byte: u8) -> Option<Breach> {
        let was_awaited = self.feed.awaits_dc1();
        let breach = self.feed.leaves(end, byte);
        // The host forced it: that is the DC1 which was lost.
        if was_awaited && breach == Some(Breach::SentWhileHeld) {
            self.captures.ended_by_dc1();
        }
        breach
    }

    fn arrives(&mut self, now: Micros, byte: u8, damage: Option<LineErrorKind>) {
        let capture = self.feed.lets_capture(now);
        let is_awaited = self.feed.awaits_dc1();
        let is_text = byte == DC3 && self.captures.takes_dc3();
        match damage {
            None if byte == DC1 && is_awaited => self.captures.ended_by_dc1(),
            None => self.captures.arrives(now, byte, capture),
            Some(LineErrorKind::Break) => self.captures.breaks(now),
            Some(_) => self.captures.arrives_damaged(now, byte),
        }
        if damage.is_none() && !is_text {
            self.feed.arrives(now, byte);
        }
    }

    fn is_forced(&mut self) {
        self.feed.is_forced = true;
        if self.feed.awaits_dc1() {
            self.captures.may_have_ended();
        }
    }

    fn port_is_back(&mut self) {
        self.feed = Feed::default();
        self.captures = Captures::default();
    }

    fn told(&mut self, told: &Told, wrong: &Wrong) -> Option<Breach> {
        match told {
            Told::Delivered { bytes, failure } => {
                self.captures.delivered(bytes, *failure, wrong.asked[0])
            }
            Told::Done => self.feed.done(),
            Told::Failed(failure) => self.feed.failed(*failure, wrong),
            // Its tape is no request.
            Told::Requested(_) => Some(Breach::Invented { delivered: Vec::new() }),
        }
    }

    fn at_rest(&self, _: &Wrong) -> Option<Breach> {
        self.captures.at_rest()
    }
}

impl Control {
    fn go_on(&mut self, now: Micros) {
        match self.stage {
            Stage::Off => self.goes_on_at = None,
            Stage::Called => self.enter(Stage::BeforeReading, now + BEFORE_READING),
            Stage::BeforeReading => {
                self.reader = Reader::default();
                self.transmitter.send(&[DC1]);
                self.enter(Stage::Reading, now + GIVES_UP);
            }
            Stage::Reading if self.reader.buffered == 0 => self.end_reading(now),
            Stage::Reading => self.take(now),
            Stage::BeforePunching => {
                self.is_stopped = false;
                self.enter(Stage::Punching, now);
                self.punch(now);
            }
            Stage::Punching => self.punch(now),
        }
    }

    fn enter(&mut self, stage: Stage, goes_on_at: Micros) {
        self.stage = stage;
        self.goes_on_at = Some(goes_on_at);
    }

    /// A character comes into the reader's buffer.
    fn read(&mut self, now: Micros, is_percent: bool) {
        if self.reader.is_at_end() {
            return;
        }
        if self.reader.buffered == 0 {
            self.goes_on_at = Some(now + TAKES);
        }
        self.reader.buffered += 1;
        self.reader.percents += u8::from(is_percent);
        if self.reader.buffered >= HOLDS_AT && !self.reader.has_held {
            self.reader.has_held = true;
            self.transmitter.send(&[DC3]);
        }
    }

    /// A character goes from the reader's buffer into the memory.
    fn take(&mut self, now: Micros) {
        self.reader.buffered -= 1;
        if self.reader.buffered > 0 {
            self.goes_on_at = Some(now + TAKES);
        } else if self.reader.is_at_end() {
            self.transmitter.send(&[DC3]);
            self.end_reading(now);
        } else {
            if self.reader.has_held {
                self.reader.has_held = false;
                self.transmitter.send(&[DC1]);
            }
            self.goes_on_at = Some(now + GIVES_UP);
        }
    }

    /// The tape has ended, or nothing came.
    fn end_reading(&mut self, now: Micros) {
        self.may_read_again &= !self.reader.is_at_end();
        if self.punched == 0 {
            self.enter(Stage::BeforePunching, now + BEFORE_PUNCHING);
        } else {
            self.stage = Stage::Off;
            self.goes_on_at = None;
        }
    }

    fn punch(&mut self, now: Micros) {
        self.transmitter.send(&[TAPE[self.punched]]);
        self.punched += 1;
        if self.punched < TAPE.len() {
            self.goes_on_at = Some(now + CHARACTER);
        } else if self.may_read_again {
            self.may_read_again = false;
            self.enter(Stage::BeforeReading, now + BEFORE_READING);
        } else {
            self.stage = Stage::Off;
            self.goes_on_at = None;
        }
    }
}

impl Reader {
    fn is_at_end(self) -> bool {
        self.percents >= 2
    }
}
