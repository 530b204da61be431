//! A 3964R partner that answers at once: as soon as a character can have come on a real line.

use std::sync::{Arc, Mutex};
use std::thread::sleep;
use std::time::Duration;

use softplug_emulated::Partner;

pub(super) const STX: u8 = 0x02;
const ETX: u8 = 0x03;
const DLE: u8 = 0x10;
const NAK: u8 = 0x15;

/// The emulated line has no rate: an answer could come before the last bit of what it answers,
/// which no real partner can do. So long is a character at 115,200 baud, twice over.
const CHARACTER: Duration = Duration::from_micros(200);

/// What a station has seen.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Seen {
    /// Blocks that were right, in their order.
    pub(super) blocks: Vec<Vec<u8>>,
    /// Set-ups that the other side tried.
    pub(super) set_ups: usize,
    /// Blocks of its own that were acknowledged.
    pub(super) acknowledged: usize,
    /// What did not belong there.
    pub(super) wrong: Vec<String>,
}

/// The partner: takes blocks, and gives its own one after the other.
pub(super) struct Station {
    state: State,
    gives: Vec<Vec<u8>>,
    seen: Arc<Mutex<Seen>>,
}

#[derive(Clone, PartialEq, Eq, Debug)]
enum State {
    Idle,
    /// Between our DLE and the check character.
    Taking(Vec<u8>),
    /// Our STX has left.
    SettingUp,
    /// Our block has left.
    Given,
}

impl Station {
    /// A station with these blocks to give, and where to see what it saw. It gives the first one
    /// when its STX is sent for it.
    pub(super) fn new(gives: Vec<Vec<u8>>) -> (Self, Arc<Mutex<Seen>>) {
        let seen = Arc::new(Mutex::new(Seen::default()));
        let state = if gives.is_empty() { State::Idle } else { State::SettingUp };
        (Self { state, gives, seen: Arc::clone(&seen) }, seen)
    }

    fn take(&mut self, byte: u8, seen: &mut Seen) -> Vec<u8> {
        match &mut self.state {
            State::Idle if byte == STX => {
                seen.set_ups += 1;
                self.state = State::Taking(Vec::new());
                vec![DLE]
            }
            // The NAK with which a link opens.
            State::Idle if byte == NAK && seen.set_ups == 0 => Vec::new(),
            State::Taking(frame) => {
                frame.push(byte);
                if !is_whole(frame) {
                    return Vec::new();
                }
                let frame = std::mem::take(frame);
                self.state = State::Idle;
                if let Some(block) = data(&frame) {
                    seen.blocks.push(block);
                    vec![DLE]
                } else {
                    seen.wrong.push(format!("a block with a wrong check: {frame:02X?}"));
                    vec![NAK]
                }
            }
            State::SettingUp if byte == DLE => {
                self.state = State::Given;
                frame(&self.gives[seen.acknowledged])
            }
            State::Given if byte == DLE => {
                seen.acknowledged += 1;
                let more = seen.acknowledged < self.gives.len();
                self.state = if more { State::SettingUp } else { State::Idle };
                if more { vec![STX] } else { Vec::new() }
            }
            State::Given if byte == NAK => {
                seen.wrong.push(format!("block {} was refused", seen.acknowledged + 1));
                self.state = State::SettingUp;
                vec![STX]
            }
            State::Idle | State::SettingUp | State::Given => self.stray(byte, seen),
        }
    }

    fn stray(&self, byte: u8, seen: &mut Seen) -> Vec<u8> {
        seen.wrong.push(format!("{byte:02X} in {:?}", self.state));
        Vec::new()
    }
}

impl Partner for Station {
    fn answer(&mut self, came: &[u8]) -> Vec<u8> {
        let seen = Arc::clone(&self.seen);
        let mut seen = seen.lock().unwrap();
        let answer = came.iter().flat_map(|byte| self.take(*byte, &mut seen)).collect::<Vec<_>>();
        if !answer.is_empty() {
            sleep(CHARACTER);
        }
        answer
    }
}

/// Whether a frame has got to its check character.
fn is_whole(frame: &[u8]) -> bool {
    let mut escaped = false;
    for (at, byte) in frame.iter().enumerate() {
        match (escaped, *byte) {
            (true, ETX) => return frame.len() == at + 2,
            (true, _) => escaped = false,
            (false, byte) => escaped = byte == DLE,
        }
    }
    false
}

/// The data of a whole frame, if its check character is right.
fn data(frame: &[u8]) -> Option<Vec<u8>> {
    let (check, body) = frame.split_last()?;
    if body.iter().fold(0, |sum, byte| sum ^ byte) != *check {
        return None;
    }
    let mut data = Vec::new();
    let mut bytes = body[..body.len() - 2].iter();
    while let Some(byte) = bytes.next() {
        data.push(*byte);
        if *byte == DLE {
            bytes.next();
        }
    }
    Some(data)
}

/// Data as they go over the line.
fn frame(data: &[u8]) -> Vec<u8> {
    let mut frame = Vec::new();
    for byte in data {
        frame.push(*byte);
        if *byte == DLE {
            frame.push(DLE);
        }
    }
    frame.extend([DLE, ETX]);
    frame.push(frame.iter().fold(0, |sum, byte| sum ^ byte));
    frame
}

#[test]
fn frames_are_those_of_the_procedure() {
    // As the protocol's page has them.
    for (bytes, on_the_line) in [
        (&[0x31, 0x32, 0x33][..], &[0x31, 0x32, 0x33, 0x10, 0x03, 0x23][..]),
        (&[0x10, 0x03], &[0x10, 0x10, 0x03, 0x10, 0x03, 0x10]),
        (&[0x41, 0x42], &[0x41, 0x42, 0x10, 0x03, 0x10]),
    ] {
        assert_eq!(frame(bytes), on_the_line);
        assert!(is_whole(on_the_line) && !is_whole(&on_the_line[..on_the_line.len() - 1]));
        assert_eq!(data(on_the_line).as_deref(), Some(bytes));
    }
}
