//! Messages: a sum, a command of three letters, data and the end code.

use super::parity::Character;

/// What the control says.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Command {
    Syn,
    Rdy,
    Gtd,
    Sat,
    Rst,
    Alm,
    Rty,
}

/// Why a message has to be said again: the number is our RTY's reason.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Bad {
    /// 1: a wrong sum, a damaged character or no end.
    Sum,
    /// 2: no message, or an unknown command.
    Command,
}

/// A message of ours, without parity bits.
pub(super) fn compose(command: &str, data: &[u8], end: u8) -> Vec<u8> {
    let mut summed = command.as_bytes().to_vec();
    summed.extend(data);
    summed.push(end);
    let mut message = hex(sum(&summed)).to_vec();
    message.extend(summed);
    message
}

/// The low eight bits of the sum of characters.
fn sum(characters: &[u8]) -> u8 {
    characters.iter().fold(0, |sum, character| sum.wrapping_add(*character))
}

/// Two hex digits.
fn hex(sum: u8) -> [u8; 2] {
    let digit = |value: u8| if value < 10 { b'0' + value } else { b'A' + value - 10 };
    [digit(sum >> 4), digit(sum & 0x0F)]
}

/// A message that comes, in whatever pieces.
#[derive(Clone, Debug, Default)]
pub(super) struct Incoming {
    /// What came of it, without the end code.
    characters: Vec<u8>,
    is_damaged: bool,
}

impl Incoming {
    /// A character. Returns the message that it ends.
    pub(super) fn take(&mut self, character: Character, end: u8) -> Option<Result<Command, Bad>> {
        let (Character::Good(value) | Character::Damaged(value)) = character;
        let is_damaged = matches!(character, Character::Damaged(_));
        // The page does not say it: control characters before a message are passed over,
        // also damaged ones, and so is an end code alone.
        if self.characters.is_empty() && value < b' ' {
            self.is_damaged = false;
            return None;
        }
        self.is_damaged |= is_damaged;
        // The page does not say it: an end code that is damaged is the end, too.
        if value != end {
            self.characters.push(value);
            return None;
        }
        let Self { characters, is_damaged } = std::mem::take(self);
        Some(if is_damaged { Err(Bad::Sum) } else { parse(&characters, end) })
    }

    /// Characters were lost, or a break came.
    pub(super) fn damage(&mut self) {
        self.is_damaged = true;
    }
}

fn parse(characters: &[u8], end: u8) -> Result<Command, Bad> {
    let [high, low, summed @ ..] = characters else { return Err(Bad::Sum) };
    if hex(sum(summed).wrapping_add(end)) != [*high, *low] {
        return Err(Bad::Sum);
    }
    let [first, second, third, ..] = summed else { return Err(Bad::Command) };
    match &[*first, *second, *third] {
        b"SYN" => Ok(Command::Syn),
        b"RDY" => Ok(Command::Rdy),
        b"GTD" => Ok(Command::Gtd),
        b"SAT" => Ok(Command::Sat),
        b"RST" => Ok(Command::Rst),
        b"ALM" => Ok(Command::Alm),
        b"RTY" => Ok(Command::Rty),
        _ => Err(Bad::Command),
    }
}
