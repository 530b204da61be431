//! Headers and blocks on the wire: their characters, their check, one at a time.

use softplug_plugin::State;
use softplug_plugin::parts::{Block, checks};

pub(crate) const SOH: u8 = 0x01;
pub(crate) const STX: u8 = 0x02;
pub(crate) const ETX: u8 = 0x03;
pub(crate) const EOT: u8 = 0x04;
pub(crate) const ACK: u8 = 0x06;
pub(crate) const DC1: u8 = 0x11;
pub(crate) const DC3: u8 = 0x13;
pub(crate) const NAK: u8 = 0x15;
pub(crate) const ETB: u8 = 0x17;

/// The longest line of a program in characters.
pub(crate) const LINE: u32 = 240;
/// The longest line with a CR or a space behind it.
const CAPACITY: usize = LINE as usize + 2;

/// A header or a line, as it came or goes.
pub(crate) type Text = Block<CAPACITY>;

/// The check character: even longitudinal parity over seven bits, from SOH or STX
/// through ETB.
pub(crate) fn block_check(begin: u8, text: &[u8]) -> u8 {
    checks::bcc(&[&[begin, ETB], text]) & 0x7F
}

/// Whether the check character would be taken for a control character.
pub(crate) fn is_control(check: u8) -> bool {
    check < 0x20
}

/// What came as a whole.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) struct Frame {
    /// SOH for a header, STX for a line.
    pub(crate) begin: u8,
    /// Its check fits, and nothing in it was damaged or too long.
    pub(crate) is_good: bool,
}

/// Where in a frame the reader is.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
enum Part {
    #[default]
    Outside,
    Text,
    Check,
    /// DC1 is still to come.
    Invitation,
}

/// What a character means.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Heard {
    /// It belongs to a frame that is not at its end.
    Inside,
    /// It stands for itself.
    Alone(u8),
    /// It ends a frame.
    Whole(Frame),
}

/// Reads frames over any cut.
#[derive(Copy, Clone, Debug, Default, State)]
pub(crate) struct Reader {
    part: Part,
    begin: u8,
    is_damaged: bool,
    check: u8,
    text: Text,
}

impl Reader {
    pub(crate) fn text(&self) -> Text {
        self.text
    }

    pub(crate) fn is_inside(&self) -> bool {
        self.part != Part::Outside
    }

    pub(crate) fn is_inside_block(&self) -> bool {
        self.is_inside() && self.begin == STX
    }

    /// A frame that is under way is forgotten.
    pub(crate) fn forget(&mut self) {
        self.part = Part::Outside;
    }

    /// A character of the frame under way was lost or altered.
    pub(crate) fn damage(&mut self) {
        self.is_damaged = true;
    }

    /// Silence has ended a frame in its middle.
    pub(crate) fn cut_off(&mut self) -> Frame {
        self.part = Part::Outside;
        Frame { begin: self.begin, is_good: false }
    }

    /// Seven bits of a character; `invited`: DC1 ends a frame. With `spaced` a space
    /// before ETB that only keeps the check from being a control character is none of the text.
    pub(crate) fn take(&mut self, byte: u8, invited: bool, spaced: bool) -> Heard {
        match (self.part, byte) {
            // A check may be any character; all others that begin a frame do.
            (Part::Outside | Part::Text | Part::Invitation, SOH | STX) => {
                *self = Self { part: Part::Text, begin: byte, ..Self::default() };
                Heard::Inside
            }
            (Part::Outside, _) => Heard::Alone(byte),
            (Part::Text, ETB) => {
                self.part = Part::Check;
                Heard::Inside
            }
            (Part::Text, _) => {
                let is_text = (0x20..0x7F).contains(&byte);
                self.is_damaged |= !is_text || !self.text.push(byte);
                Heard::Inside
            }
            (Part::Check, _) => {
                self.check = byte;
                if invited {
                    self.part = Part::Invitation;
                    return Heard::Inside;
                }
                Heard::Whole(self.whole(true, spaced))
            }
            (Part::Invitation, _) => Heard::Whole(self.whole(byte == DC1, spaced)),
        }
    }

    fn whole(&mut self, has_end: bool, spaced: bool) -> Frame {
        self.part = Part::Outside;
        let expected = block_check(self.begin, self.text.as_slice());
        let is_good = has_end && !self.is_damaged && self.check == expected;
        let has_space = self.text.as_slice().last() == Some(&b' ');
        if spaced && has_space && is_control(expected ^ b' ') {
            self.text.drop_last();
        }
        Frame { begin: self.begin, is_good }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_check_of_the_manual() {
        assert_eq!(block_check(SOH, b"H15E"), 0x1F);
    }

    #[test]
    fn every_single_error_is_noticed() {
        let wire = [SOH, b'H', b'1', b'5', b'E', ETB, 0x1F, DC1];
        let read = |wire: &[u8]| {
            let mut reader = Reader::default();
            let last = wire.iter().map(|byte| reader.take(*byte, true, false)).last();
            (last, reader.text().as_slice().to_vec())
        };
        let good = Heard::Whole(Frame { begin: SOH, is_good: true });
        assert_eq!(read(&wire), (Some(good), b"H15E".to_vec()));
        for at in 0..wire.len() {
            for bit in 0..7 {
                let mut damaged = wire;
                damaged[at] ^= 1 << bit;
                let (heard, text) = read(&damaged);
                assert!(heard != Some(good) || text != b"H15E", "bit {bit} of {at}");
            }
        }
    }
}
