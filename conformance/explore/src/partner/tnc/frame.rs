//! Headers and blocks as characters, told apart as the protocol's page says.

use crate::hash::Hash128;
use softplug_abi::{LineErrorKind, Micros};
use std::hash::Hash;

pub(super) const SOH: u8 = 0x01;
pub(super) const STX: u8 = 0x02;
pub(super) const ETX: u8 = 0x03;
pub(super) const EOT: u8 = 0x04;
pub(super) const ACK: u8 = 0x06;
pub(super) const DC1: u8 = 0x11;
pub(super) const DC3: u8 = 0x13;
pub(super) const NAK: u8 = 0x15;
const ETB: u8 = 0x17;

/// A header (`begin` is SOH) or a block (STX) with check and DC1.
pub(super) fn frame(begin: u8, text: &[u8]) -> Vec<u8> {
    let mut frame = vec![begin];
    frame.extend_from_slice(text);
    frame.push(ETB);
    let check = frame.iter().fold(0, |check, byte| check ^ byte) & 0x7F;
    frame.extend([check, DC1]);
    frame
}

/// What came.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) enum Heard {
    /// A good header of mode A or E.
    Header {
        mode: u8,
    },
    /// A header that is bad, or of another mode.
    BadHeader,
    /// A good block.
    Block {
        line: Vec<u8>,
    },
    BadBlock,
    /// A character outside of headers and blocks.
    Sign(u8),
}

/// Takes characters as they come.
#[derive(Clone, Debug)]
pub(super) struct Ear {
    character_time: Micros,
    place: Place,
    is_header: bool,
    is_bad: bool,
    text: Vec<u8>,
    check: u8,
    /// When the last character came.
    last: Micros,
}

/// What the next character is.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
enum Place {
    Outside,
    Text,
    Check,
    Dc1,
}

impl Ear {
    pub(super) fn new(character_time: Micros) -> Self {
        Self {
            character_time,
            place: Place::Outside,
            is_header: false,
            is_bad: false,
            text: Vec::new(),
            check: 0,
            last: Micros::ZERO,
        }
    }

    pub(super) fn hash(&self, now: Micros, state: &mut Hash128) {
        self.place.hash(state);
        if self.is_inside() {
            (self.is_header, self.is_bad, &self.text, self.check).hash(state);
            // Longer ago is no different.
            (now.0 - self.last.0).min(self.character_time.0 + 1).hash(state);
        }
    }

    /// Whether a header or block has begun.
    pub(super) fn is_inside(&self) -> bool {
        self.place != Place::Outside
    }

    /// When silence will have made bad what has begun.
    pub(super) fn cut_off_at(&self) -> Option<Micros> {
        self.is_inside().then(|| self.last + self.character_time)
    }

    /// What has begun is cut off.
    pub(super) fn cut_off(&mut self) -> Heard {
        self.is_bad = true;
        self.end()
    }

    /// Forgets what has begun.
    pub(super) fn forget(&mut self) {
        self.place = Place::Outside;
    }

    pub(super) fn hear(
        &mut self,
        now: Micros,
        byte: u8,
        damage: Option<LineErrorKind>,
    ) -> Option<Heard> {
        self.last = now;
        let is_damaged = damage.is_some();
        match self.place {
            Place::Outside if is_damaged => None,
            // Also in place of DC1, not in that of the check.
            Place::Outside | Place::Text | Place::Dc1
                if !is_damaged && matches!(byte, SOH | STX) =>
            {
                self.place = Place::Text;
                self.is_header = byte == SOH;
                self.is_bad = false;
                self.text.clear();
                self.check = byte;
                None
            }
            Place::Outside => Some(Heard::Sign(byte)),
            // What is damaged is not looked at.
            _ if is_damaged => {
                self.is_bad = true;
                None
            }
            Place::Text => {
                if byte == ETB {
                    self.place = Place::Check;
                } else if byte.is_ascii_control() {
                    self.is_bad = true;
                } else {
                    self.text.push(byte);
                }
                self.check ^= byte;
                None
            }
            Place::Check => {
                self.is_bad |= byte != self.check & 0x7F;
                self.place = Place::Dc1;
                None
            }
            Place::Dc1 => {
                self.is_bad |= byte != DC1;
                Some(self.end())
            }
        }
    }

    fn end(&mut self) -> Heard {
        self.place = Place::Outside;
        let line = std::mem::take(&mut self.text);
        match (self.is_header, self.is_bad, line.as_slice()) {
            (true, false, [_kind, .., mode @ (b'A' | b'E')]) => Heard::Header { mode: *mode },
            (true, ..) => Heard::BadHeader,
            (false, true, _) => Heard::BadBlock,
            (false, false, _) => Heard::Block { line },
        }
    }
}
