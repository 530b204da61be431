//! The line: parity, and single characters that wait for room.

use crate::settings::{Parity, Settings};
use softplug_plugin::{Context, State, StateReader, StateWriter, copy};

/// Answers that may wait for room.
const OWED: usize = 16;

#[derive(Copy, Clone, Debug, Default)]
pub(crate) struct Line {
    /// Answers that have found no room, in order.
    owed: [u8; OWED],
    owed_length: u8,
}

impl Line {
    /// Sends a single character; one that finds no room waits for it, before all else.
    pub(crate) fn say(&mut self, link: &mut Context<'_>, settings: &Settings, byte: u8) {
        if self.owes_nothing() && link.transmit_room() > 0 {
            link.transmit(&[spoken(settings, byte)]);
        } else {
            self.owe(byte);
        }
    }

    /// The control asks again for what is missed even here.
    pub(crate) fn owe(&mut self, byte: u8) {
        if let Some(place) = self.owed.get_mut(usize::from(self.owed_length)) {
            *place = byte;
            self.owed_length += 1;
        }
    }

    pub(crate) fn owes_nothing(&self) -> bool {
        self.owed_length == 0
    }

    /// Nobody waits for an answer any more.
    pub(crate) fn forget_owed(&mut self) {
        self.owed_length = 0;
    }

    /// There is room again.
    pub(crate) fn pay(&mut self, link: &mut Context<'_>, settings: &Settings) {
        while !self.owes_nothing() && link.transmit_room() > 0 {
            link.transmit(&[spoken(settings, self.owed[0])]);
            self.owed.rotate_left(1);
            self.owed_length -= 1;
        }
    }
}

/// Before format 3 answers did not wait.
impl State for Line {
    fn save(&self, state: &mut StateWriter<'_>) {
        state.u8(self.owed_length);
        state.bytes(self.owed.get(..usize::from(self.owed_length)).unwrap_or_default());
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        let length = state.u8();
        match self.owed.get_mut(..usize::from(length)) {
            Some(owed) => copy(owed, state.bytes(owed.len())),
            None => return state.refuse(),
        }
        self.owed_length = length;
    }
}

/// The seven bits of a character; `None` if its parity is wrong.
pub(crate) fn heard(settings: &Settings, byte: u8) -> Option<u8> {
    let is_good = match settings.parity {
        Parity::Port => byte < 0x80,
        Parity::Even => byte.count_ones().is_multiple_of(2),
    };
    is_good.then_some(byte & 0x7F)
}

/// A character as it goes on the line.
pub(crate) fn spoken(settings: &Settings, byte: u8) -> u8 {
    let is_odd = settings.parity == Parity::Even && !byte.count_ones().is_multiple_of(2);
    byte | if is_odd { 0x80 } else { 0 }
}
