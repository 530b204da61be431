//! Frames on the line: DLE STX, the message with each DLE twice, DLE ETX and the check.

use super::Check;
use softplug_plugin::State;
use softplug_plugin::parts::{Block, checks};

pub(super) const STX: u8 = 0x02;
pub(super) const ETX: u8 = 0x03;
pub(super) const ENQ: u8 = 0x05;
pub(super) const ACK: u8 = 0x06;
pub(super) const NAK: u8 = 0x0F;
pub(super) const DLE: u8 = 0x10;
/// NAK of ASCII, and of later manuals.
const LATER_NAK: u8 = 0x15;

/// The most bytes of a message.
pub(super) const MOST: usize = 250;

/// The check of a message, and its length. The CRC is over ETX too.
fn check(text: &[u8], kind: Check) -> ([u8; 2], usize) {
    match kind {
        Check::Bcc => ([checks::sum(&[text]).wrapping_neg(), 0], 1),
        Check::Crc => (checks::crc16_arc(&[text, &[ETX]]).to_le_bytes(), 2),
    }
}

/// A frame that goes, with all its characters.
#[derive(Debug, State)]
pub(super) struct Frame {
    characters: Block<{ 2 * MOST + 6 }>,
    /// Where DLE ETX stands.
    end: u16,
}

impl Frame {
    pub(super) fn new() -> Self {
        Self { characters: Block::new(), end: 0 }
    }

    pub(super) fn make(&mut self, text: &[u8], kind: Check) {
        self.characters.clear();
        self.characters.extend(&[DLE, STX]);
        for byte in text {
            let symbol = [*byte, DLE];
            let length = if *byte == DLE { 2 } else { 1 };
            self.characters.extend(symbol.get(..length).unwrap_or_default());
        }
        self.end = self.characters.len() as u16;
        self.characters.extend(&[DLE, ETX]);
        let (check, length) = check(text, kind);
        self.characters.extend(check.get(..length).unwrap_or_default());
    }

    pub(super) fn length(&self) -> usize {
        self.characters.len()
    }

    pub(super) fn byte(&self, at: usize) -> u8 {
        self.characters.as_slice().get(at).copied().unwrap_or_default()
    }

    /// How many characters stay together: a symbol, and the end with its check.
    pub(super) fn symbol(&self, at: usize) -> usize {
        match self.byte(at) {
            _ if at >= usize::from(self.end) => self.length() - at,
            DLE => 2,
            _ => 1,
        }
    }
}

/// What a character made of what is heard.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Heard {
    /// There is more to come.
    Nothing,
    Ack,
    Nak,
    Enquiry,
    /// A message has ended.
    Message {
        is_good: bool,
    },
    /// It belongs to no message and is no symbol.
    Stray,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug, State)]
enum Part {
    Outside,
    Text,
    Check,
}

/// Reads symbols over any cut.
#[derive(Debug, State)]
pub(super) struct Reader {
    part: Part,
    is_after_dle: bool,
    /// A character of the message was damaged, or there were too many.
    is_bad: bool,
    text: Block<MOST>,
    /// What has come of the check.
    check: Block<2>,
}

impl Reader {
    pub(super) fn new() -> Self {
        Self {
            part: Part::Outside,
            is_after_dle: false,
            is_bad: false,
            text: Block::new(),
            check: Block::new(),
        }
    }

    /// The message that has come last.
    pub(super) fn text(&self) -> &[u8] {
        self.text.as_slice()
    }

    /// A character was damaged.
    pub(super) fn damage(&mut self) {
        self.is_bad = true;
    }

    pub(super) fn take(&mut self, byte: u8, kind: Check) -> Heard {
        if self.part == Part::Check {
            return self.take_check(byte, kind);
        }
        if !core::mem::take(&mut self.is_after_dle) {
            self.is_after_dle = byte == DLE;
            return if byte == DLE { Heard::Nothing } else { self.take_text(byte) };
        }
        match byte {
            ACK => Heard::Ack,
            NAK | LATER_NAK => Heard::Nak,
            ENQ => Heard::Enquiry,
            DLE => self.take_text(DLE),
            STX => {
                *self = Self { part: Part::Text, ..Self::new() };
                Heard::Nothing
            }
            ETX if self.part == Part::Text => {
                self.part = Part::Check;
                Heard::Nothing
            }
            // No symbol at all.
            _ => {
                self.is_bad = true;
                Heard::Stray
            }
        }
    }

    fn take_text(&mut self, byte: u8) -> Heard {
        if self.part == Part::Outside {
            return Heard::Stray;
        }
        self.is_bad |= !self.text.push(byte);
        Heard::Nothing
    }

    fn take_check(&mut self, byte: u8, kind: Check) -> Heard {
        self.check.push(byte);
        let (expected, length) = check(self.text(), kind);
        if self.check.len() < length {
            return Heard::Nothing;
        }
        self.part = Part::Outside;
        let is_right = Some(self.check.as_slice()) == expected.get(..length);
        Heard::Message { is_good: is_right && !self.is_bad }
    }
}
