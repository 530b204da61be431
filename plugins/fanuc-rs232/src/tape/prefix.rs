//! The beginning of a block, up to its number: `N10`, `/N10`, `/2 N10`.

use softplug_plugin::{StateError, StateReader, StateWriter};

/// Most characters of a prefix; what is longer has no number.
const LONGEST: usize = 14;
/// Where no N has come.
const NONE: u8 = u8::MAX;

/// The characters of a block up to where its number ends.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Prefix {
    characters: [u8; LONGEST],
    length: u8,
    /// Where the N stands.
    letter: u8,
    number: Option<u32>,
}

impl Default for Prefix {
    fn default() -> Self {
        Self { characters: [0; LONGEST], length: 0, letter: NONE, number: None }
    }
}

impl Prefix {
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
        let place = self.characters.get_mut(usize::from(self.length)).filter(|_| fits);
        let Some(place) = place else { return false };
        if self.letter != NONE {
            let number = self.number.unwrap_or_default();
            self.number = Some(number.saturating_mul(10).saturating_add(digit));
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
    pub(super) fn number(&self) -> Option<u32> {
        self.number.filter(|_| usize::from(self.length) < LONGEST)
    }

    /// What stands before N.
    pub(super) fn before_number(&self) -> &[u8] {
        self.characters.get(..usize::from(self.letter)).unwrap_or_default()
    }

    pub(super) fn save(&self, state: &mut StateWriter<'_>) {
        state.u8(self.length);
        state.bytes(self.as_slice());
    }

    /// A prefix follows from its characters.
    pub(super) fn restore(state: &mut StateReader<'_>) -> Result<Self, StateError> {
        let mut prefix = Self::default();
        let length = usize::from(state.u8());
        for character in state.bytes(length) {
            if !prefix.take(*character) {
                return Err(StateError);
            }
        }
        Ok(prefix)
    }
}
