//! How bytes become printable characters: prefixes for control characters, for the eighth bit
//! and for runs.

use softplug_plugin::State;

/// The prefix of control characters that we use.
pub(crate) const QUOTE: u8 = b'#';
/// The prefix of bytes above 127 that we ask for.
pub(crate) const EIGHTH: u8 = b'&';
/// The prefix of runs that we offer.
pub(crate) const REPEAT: u8 = b'~';
/// Bytes of a run that one count can say.
pub(crate) const RUN: usize = 94;
/// Characters of what is longest: a run of a control character above 127.
pub(crate) const UNIT: usize = 5;

/// A number as a character.
pub(crate) fn to_char(number: u8) -> u8 {
    number.wrapping_add(32)
}

/// A character as a number; those below a space are none.
pub(crate) fn from_char(character: u8) -> u8 {
    character.saturating_sub(32)
}

/// Whether a character can be a prefix.
pub(crate) fn is_prefix(character: u8) -> bool {
    matches!(character, 33..=62 | 96..=126)
}

/// The prefixes of a transfer; 0: none.
#[derive(Copy, Clone, Debug, State)]
pub(crate) struct Coding {
    pub(crate) quote: u8,
    pub(crate) eighth: u8,
    pub(crate) repeat: u8,
}

impl Coding {
    /// One byte, or a run of it, as characters: how many of them, and how many bytes they stand
    /// for.
    pub(crate) fn encode(self, byte: u8, run: usize) -> ([u8; UNIT], usize, usize) {
        let is_prefixed = self.eighth != 0 && byte >= 0x80;
        let own = if is_prefixed { byte & 0x7F } else { byte };
        let low = byte & 0x7F;
        let is_control = low < 0x20 || low == 0x7F;
        let is_quoted = is_control || [self.quote, self.eighth, self.repeat].contains(&low);
        let body = 1 + usize::from(is_prefixed) + usize::from(is_quoted);
        let counts = self.repeat != 0 && run * body > body + 2;
        let mut unit = [0; UNIT];
        let mut length = 0;
        let mut push = |character| {
            if let Some(place) = unit.get_mut(length) {
                *place = character;
                length += 1;
            }
        };
        if counts {
            push(self.repeat);
            push(to_char(run as u8));
        }
        if is_prefixed {
            push(self.eighth);
        }
        if is_quoted {
            push(self.quote);
        }
        push(if is_control { own ^ 0x40 } else { own });
        (unit, length, if counts { run } else { 1 })
    }

    /// The byte that the first characters stand for, how often, and how many characters they
    /// are. `None`: nothing is behind a prefix, or no count.
    pub(crate) fn decode(self, characters: &[u8]) -> Option<(u8, u8, usize)> {
        let mut place = 0;
        let mut next = || {
            let character = characters.get(place).copied();
            place += 1;
            character
        };
        let mut character = next()?;
        let mut count = 1;
        if self.repeat != 0 && character == self.repeat {
            count = from_char(next()?);
            if !(1..=RUN as u8).contains(&count) {
                return None;
            }
            character = next()?;
        }
        let mut high = 0;
        if self.eighth != 0 && character == self.eighth {
            high = 0x80;
            character = next()?;
        }
        if character == self.quote {
            character = next()?;
            if matches!(character & 0x7F, 0x3F..=0x5F) {
                character ^= 0x40;
            }
        }
        Some((character | high, count, place))
    }

    /// Whether all of it can be read.
    pub(crate) fn is_sound(self, characters: &[u8]) -> bool {
        let mut rest = characters;
        while !rest.is_empty() {
            let Some((_, _, used)) = self.decode(rest) else { return false };
            rest = rest.get(used..).unwrap_or_default();
        }
        true
    }
}
