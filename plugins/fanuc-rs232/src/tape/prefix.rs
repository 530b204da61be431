//! The beginning of a block, up to its number: `N10`, `/N10`, `/2 N10`.

use zerocopy::{FromZeros, Immutable, IntoBytes};

/// Most characters of a prefix; what is longer has no number.
const LONGEST: usize = 14;
/// Where no N has come.
const NONE: u8 = u8::MAX;
/// No block number.
pub(super) const NO_NUMBER: u32 = u32::MAX;

/// The characters of a block up to where its number ends.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(super) struct Prefix {
    number: u32,
    length: u8,
    /// Where the N stands.
    letter: u8,
    characters: [u8; LONGEST],
}

impl Prefix {
    pub(super) fn clear(&mut self) {
        self.length = 0;
        self.letter = NONE;
        self.number = NO_NUMBER;
    }

    pub(super) fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// Takes the next character of the block; `false`: the prefix has ended before it.
    pub(super) fn take(&mut self, character: u8) -> bool {
        let digit = u32::from(character.wrapping_sub(b'0'));
        let last = self.as_slice().last();
        let fits = if self.letter == NONE {
            matches!(character, b' ' | b'/' | b'N') || (digit < 10 && last == Some(&b'/'))
        } else {
            digit < 10
        };
        let is_first_digit = last == Some(&b'N');
        let place = self.characters.get_mut(usize::from(self.length)).filter(|_| fits);
        let Some(place) = place else { return false };
        if self.letter != NONE {
            // One that is too large stays so.
            let number = if is_first_digit { 0 } else { self.number };
            self.number = number.saturating_mul(10).saturating_add(digit);
        } else if character == b'N' {
            self.letter = self.length;
        }
        *place = character;
        self.length += 1;
        true
    }

    pub(super) fn as_slice(&self) -> &[u8] {
        self.characters.get(..usize::from(self.length)).unwrap_or_default()
    }

    /// The number behind N, if there is one, and it is all here.
    pub(super) fn number(&self) -> u32 {
        if usize::from(self.length) < LONGEST { self.number } else { NO_NUMBER }
    }

    /// What stands before N.
    pub(super) fn before_number(&self) -> &[u8] {
        self.characters.get(..usize::from(self.letter)).unwrap_or_default()
    }
}
