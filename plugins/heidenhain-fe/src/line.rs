//! The line: characters with their parity.

use crate::settings::{Parity, Settings};

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
