//! A plain station of 3964R that answers at once: idle, it takes a block; the byte behind its last
//! answer sets up its own. It repeats nothing and forgives nothing.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};

use softplug_abi::Micros;
use softplug_machines::Partner;

pub(crate) const STX: u8 = 0x02;
const ETX: u8 = 0x03;
const DLE: u8 = 0x10;
const NAK: u8 = 0x15;

/// The data of block `n`, one way or the other, all of the control characters in it.
pub(crate) fn block(n: u64, ours: bool) -> Vec<u8> {
    let text = format!("N{n} {} G1\x02\x10\x10\x03\x15 X{}", u8::from(ours), n % 97);
    text.into_bytes()
}

/// Data with its end, as it stands on the line.
fn frame(data: &[u8]) -> Vec<u8> {
    let mut frame = Vec::new();
    for byte in data {
        frame.push(*byte);
        if *byte == DLE {
            frame.push(DLE);
        }
    }
    frame.extend([DLE, ETX]);
    frame.push(frame.iter().fold(0, |check, byte| check ^ byte));
    frame
}

#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
enum Phase {
    #[default]
    Idle,
    Receiving,
    /// Our STX is out.
    SetUp,
    /// Our block is out.
    Sent,
}

#[derive(Debug, Default)]
struct State {
    phase: Phase,
    /// What comes is to be this.
    awaited: Vec<u8>,
    /// What is sent then; nothing if it is empty.
    own: Vec<u8>,
    frame: Vec<u8>,
    /// Whether a DLE without its second stands at the frame's end, or DLE ETX does.
    after_dle: bool,
    at_end: bool,
    received: u64,
    sent: u64,
    wrong: Vec<String>,
    /// Answers are kept until they are asked for.
    holds: bool,
    held: Vec<u8>,
    out: VecDeque<u8>,
    asked: Option<Instant>,
    slowest: Duration,
}

/// Clones share the station.
#[derive(Clone, Debug, Default)]
pub(crate) struct Prompt(Arc<Mutex<State>>);

impl Prompt {
    fn state(&self) -> MutexGuard<'_, State> {
        self.0.lock().unwrap()
    }

    /// The next block to come, and the one that is sent behind it.
    pub(crate) fn expect(&self, awaited: Vec<u8>, own: Vec<u8>) {
        let mut state = self.state();
        (state.awaited, state.own) = (awaited, own);
        (state.received, state.sent, state.slowest) = (0, 0, Duration::ZERO);
    }

    /// One byte; what is answered.
    pub(crate) fn take(&self, byte: u8) -> Vec<u8> {
        let mut state = self.state();
        let answer = state.take(byte);
        if state.holds {
            state.held.extend(answer);
            return Vec::new();
        }
        answer
    }

    /// It was sent something; to be said by whoever sent it.
    pub(crate) fn was_asked(&self) {
        self.state().asked = Some(Instant::now());
    }

    /// Its answer is on the line.
    pub(crate) fn has_answered(&self) {
        let mut state = self.state();
        let took = state.asked.map_or(Duration::ZERO, |asked| asked.elapsed());
        state.slowest = state.slowest.max(took);
    }

    /// How long this computer made it take for an answer to this block, at most.
    pub(crate) fn slowest(&self) -> Duration {
        self.state().slowest
    }

    /// Keeps its answers to itself, or no longer.
    pub(crate) fn hold(&self, holds: bool) {
        self.state().holds = holds;
    }

    /// What it keeps to itself.
    pub(crate) fn held(&self) -> Vec<u8> {
        std::mem::take(&mut self.state().held)
    }

    /// Nothing more is to come.
    pub(crate) fn is_over(&self) -> bool {
        self.state().phase == Phase::Idle
    }

    /// All of the exchange went as it should.
    pub(crate) fn check(&self, n: u64) {
        let state = self.state();
        assert_eq!(state.wrong, [] as [String; 0], "block {n}");
        let sent = u64::from(!state.own.is_empty());
        assert_eq!((state.phase, state.received, state.sent), (Phase::Idle, 1, sent), "block {n}");
    }
}

impl State {
    fn wrong(&mut self, byte: u8) -> Vec<u8> {
        self.wrong.push(format!("{byte:02X} in {:?} after {:02X?}", self.phase, self.frame));
        Vec::new()
    }

    fn take(&mut self, byte: u8) -> Vec<u8> {
        match (self.phase, byte) {
            (Phase::Idle, STX) => {
                self.phase = Phase::Receiving;
                self.frame.clear();
                (self.after_dle, self.at_end) = (false, false);
                vec![DLE]
            }
            // With NAK a station says that it is idle.
            (Phase::Idle, NAK) if self.received == 0 => Vec::new(),
            (Phase::Receiving, _) => self.receive(byte),
            (Phase::SetUp, DLE) => {
                self.phase = Phase::Sent;
                frame(&self.own)
            }
            (Phase::Sent, DLE) => {
                self.phase = Phase::Idle;
                self.sent += 1;
                Vec::new()
            }
            _ => self.wrong(byte),
        }
    }

    fn receive(&mut self, byte: u8) -> Vec<u8> {
        self.frame.push(byte);
        if !self.at_end {
            match (self.after_dle, byte) {
                (true, ETX) => self.at_end = true,
                (true, DLE) => self.after_dle = false,
                (true, _) => return self.wrong(byte),
                (false, _) => self.after_dle = byte == DLE,
            }
            return Vec::new();
        }
        self.phase = Phase::Idle;
        if self.frame != frame(&self.awaited) {
            self.wrong(byte);
            return vec![NAK];
        }
        self.received += 1;
        if self.own.is_empty() {
            return vec![DLE];
        }
        self.phase = Phase::SetUp;
        vec![DLE, STX]
    }
}

impl Partner for Prompt {
    fn receive(&mut self, _: Micros, byte: u8) {
        let answer = self.take(byte);
        if !answer.is_empty() {
            self.has_answered();
        }
        self.state().out.extend(answer);
    }

    fn next_event(&self) -> Option<Micros> {
        None
    }

    fn advance(&mut self, _: Micros) {}

    fn poll_transmit(&mut self, _: Micros) -> Option<u8> {
        self.state().out.pop_front()
    }
}
