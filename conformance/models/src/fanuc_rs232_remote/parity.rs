//! The parity bit of a character.

use super::rules::Rules;

/// A character from the line.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Character {
    /// Without its bit 7.
    Good(u8),
    Damaged(u8),
}

/// A character as it leaves: `parity=software` makes bit 7 even.
pub(super) fn sent(rules: &Rules, character: u8) -> u8 {
    if rules.makes_parity && character.count_ones() % 2 == 1 { character ^ 0x80 } else { character }
}

/// A character that came: `parity=software` checks it, otherwise bit 7 is not looked
/// at. The page says that of `parity=none` alone; with `uart` the port has taken it.
pub(super) fn came(rules: &Rules, byte: u8) -> Character {
    if rules.makes_parity && byte.count_ones() % 2 == 1 {
        Character::Damaged(byte & 0x7F)
    } else {
        Character::Good(byte & 0x7F)
    }
}
