//! Headers and blocks as they come, character by character.

use softplug_abi::Micros;

pub(super) const SOH: u8 = 0x01;
pub(super) const STX: u8 = 0x02;
pub(super) const ETX: u8 = 0x03;
pub(super) const EOT: u8 = 0x04;
pub(super) const ACK: u8 = 0x06;
pub(super) const DC1: u8 = 0x11;
pub(super) const DC3: u8 = 0x13;
pub(super) const NAK: u8 = 0x15;
pub(super) const ETB: u8 = 0x17;

/// Characters that a header or block has at most between its first and ETB.
pub(super) const LONGEST: usize = 242;

/// What begins with SOH, and what begins with STX.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Kind {
    Header,
    Block,
}

/// Where in a header or block the next character stands.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Place {
    Text,
    Check,
    Dc1,
}

/// A header or block that has begun.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub(super) kind: Kind,
    pub(super) place: Place,
    /// All between its first character and ETB.
    pub(super) text: Vec<u8>,
    pub(super) is_bad: bool,
    /// When its latest character came: `character_time` runs from there.
    pub(super) latest: Micros,
}

/// What a character does to a header or block.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Step {
    GoesOn,
    BeginsAnew(Kind),
    Ends,
}

impl Frame {
    pub(super) fn new(kind: Kind, at: Micros) -> Self {
        Self { kind, place: Place::Text, text: Vec::new(), is_bad: false, latest: at }
    }

    /// The next character; `None`: damaged or lost, which is not looked at.
    pub(super) fn take(&mut self, at: Micros, character: Option<u8>, dc1: bool) -> Step {
        self.latest = at;
        let Some(character) = character else {
            self.is_bad = true;
            return Step::GoesOn;
        };
        match (self.place, character) {
            (Place::Check, check) => {
                self.is_bad |= check != self.check();
                self.place = Place::Dc1;
                if dc1 { Step::GoesOn } else { Step::Ends }
            }
            (Place::Text | Place::Dc1, SOH) => Step::BeginsAnew(Kind::Header),
            (Place::Text | Place::Dc1, STX) => Step::BeginsAnew(Kind::Block),
            (Place::Text, ETB) => {
                self.place = Place::Check;
                Step::GoesOn
            }
            (Place::Text, character) => {
                let is_text = !is_control(character) && character != DEL;
                self.is_bad |= !is_text || self.text.len() == LONGEST;
                self.text.push(character);
                Step::GoesOn
            }
            (Place::Dc1, character) => {
                self.is_bad |= character != DC1;
                Step::Ends
            }
        }
    }

    /// The check character that has to come.
    pub(super) fn check(&self) -> u8 {
        let begin = if self.kind == Kind::Header { SOH } else { STX };
        check(begin, &self.text)
    }

    /// The text, without the space that keeps the check from being a control
    /// character.
    pub(super) fn stripped(&self, bcc_space: bool) -> &[u8] {
        match self.text.split_last() {
            Some((b' ', text)) if bcc_space && is_control(self.check() ^ b' ') => text,
            _ => &self.text,
        }
    }
}

/// The even longitudinal parity over all characters from SOH or STX through ETB.
pub(super) fn check(begin: u8, text: &[u8]) -> u8 {
    text.iter().fold(begin ^ ETB, |check, character| check ^ character) & 0x7F
}

/// No character of a text, though it is above the space.
const DEL: u8 = 0x7F;

/// A header or block as it goes over the line, parity left out.
pub(super) fn framed(begin: u8, text: &[u8], dc1: bool, bcc_space: bool) -> Vec<u8> {
    let mut text = text.to_vec();
    if bcc_space && is_control(check(begin, &text)) {
        text.push(b' ');
    }
    let last = check(begin, &text);
    let end = if dc1 { &[ETB, last, DC1][..] } else { &[ETB, last] };
    [&[begin], text.as_slice(), end].concat()
}

/// Whether a check character would be one that controls.
pub(super) fn is_control(character: u8) -> bool {
    character < 0x20
}
