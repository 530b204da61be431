//! Messages of protocol A: sum (two hex digits), command (three letters), data, end
//! code.

use crate::{PacketEnd, ParityMode, Settings};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// The letters of a command, as a number.
pub(super) type Command = u32;

/// The command with these letters.
pub(super) const fn command([a, b, c]: [u8; 3]) -> Command {
    u32::from_be_bytes([0, a, b, c])
}

/// Length of sum and command in bytes.
pub(super) const HEAD: usize = 5;

pub(super) fn end_code(settings: &Settings) -> u8 {
    match settings.packet_end {
        PacketEnd::Cr => b'\r',
        PacketEnd::Etx => 0x03,
    }
}

/// Sum and command. The sum is that of the characters without their parity, from
/// the command through the end code; that the parity bit is left out is this
/// project's reading.
pub(super) fn head(settings: &Settings, command: Command, data: &[u8]) -> [u8; HEAD] {
    let [_, a, b, c] = command.to_be_bytes();
    let sum = data.iter().fold(end_code(settings), |sum, byte| sum.wrapping_add(byte & 0x7F));
    let sum = sum.wrapping_add(a).wrapping_add(b).wrapping_add(c);
    let [high, low] = digits(sum);
    let mut head = [high, low, a, b, c];
    for byte in &mut head {
        *byte = with_parity(settings, *byte);
    }
    head
}

/// A character of a message as it goes on the line.
pub(super) fn with_parity(settings: &Settings, byte: u8) -> u8 {
    match settings.parity {
        ParityMode::Software => byte | (byte.count_ones() as u8) << 7,
        ParityMode::Uart | ParityMode::None => byte,
    }
}

/// Two hex digits, the high one first.
fn digits(sum: u8) -> [u8; 2] {
    let digit = |digit: u8| digit + if digit < 10 { b'0' } else { b'A' - 10 };
    [digit(sum >> 4), digit(sum & 15)]
}

/// Reads messages character by character. Their data means nothing to us.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(super) struct Reader {
    head: [u8; HEAD],
    length: u8,
    sum: u8,
    is_damaged: bool,
}

impl Reader {
    /// A character; with the last one of a message its command, or that it was
    /// damaged. One that is too short has a command that does not exist.
    pub(super) fn read(&mut self, settings: &Settings, byte: u8) -> Option<Result<Command, ()>> {
        let character = byte & 0x7F;
        self.is_damaged |= settings.parity == ParityMode::Software && byte.count_ones() & 1 == 1;
        let is_end = character == end_code(settings);
        // Blanks and line ends between two messages.
        if self.length == 0 && (is_end || character < b' ') {
            self.is_damaged = false;
            return None;
        }
        if self.length >= 2 {
            self.sum = self.sum.wrapping_add(character);
        }
        if !is_end {
            if let Some(place) = self.head.get_mut(usize::from(self.length)) {
                *place = character;
                self.length += 1;
            }
            return None;
        }
        let [high, low, a, b, c] = self.head;
        let is_good = !self.is_damaged && self.length >= 2 && [high, low] == digits(self.sum);
        *self = Self::new_zeroed();
        Some(if is_good { Ok(command([a, b, c])) } else { Err(()) })
    }

    /// A character of the message was damaged.
    pub(super) fn damaged(&mut self) {
        self.is_damaged = true;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_plugin::SettingSet;

    fn software() -> Settings {
        Settings { parity: ParityMode::Software, ..Settings::UNSET }
    }

    /// What a reader makes of these characters.
    fn read(settings: &Settings, bytes: &[u8]) -> Vec<Result<Command, ()>> {
        let mut reader = Reader::new_zeroed();
        bytes.iter().filter_map(|byte| reader.read(settings, *byte)).collect()
    }

    #[test]
    fn sums_worked_out_by_hand() {
        let settings = Settings::UNSET;
        // 53 + 59 + 4E + 0D = 107
        assert_eq!(&head(&settings, command(*b"SYN"), b""), b"07SYN");
        // 44 + 41 + 54 + 25 + 0A + 0D = 115
        assert_eq!(&head(&settings, command(*b"DAT"), b"%\n"), b"15DAT");
        // 53 + 45 + 54 + 03 = EF
        let etx = Settings { packet_end: PacketEnd::Etx, ..settings };
        assert_eq!(&head(&etx, command(*b"SET"), b""), b"EFSET");
        // Parity is no part of the sum, and stands in every character.
        assert_eq!(&head(&software(), command(*b"SYN"), b""), &[0x30, 0xB7, 0x53, 0x59, 0x4E]);
        assert_eq!(&head(&software(), command(*b"DAT"), b"\xA5\x0A")[..2], &[0xB1, 0x35]);
        assert_eq!(with_parity(&software(), b'\r'), 0x8D);
    }

    #[test]
    fn messages_are_read() {
        let settings = Settings::UNSET;
        // 53 + 41 + 54 + 30 + 30 + 0D = 155
        let text = b"07SYN\r\n\x0055SAT00\r";
        assert_eq!(read(&settings, text), [Ok(command(*b"SYN")), Ok(command(*b"SAT"))]);
        let parity: Vec<u8> = text.iter().map(|byte| with_parity(&software(), *byte)).collect();
        assert_eq!(read(&software(), &parity), [Ok(command(*b"SYN")), Ok(command(*b"SAT"))]);
    }

    #[test]
    fn a_message_without_a_whole_command_has_none_that_exists() {
        let settings = Settings::UNSET;
        assert_eq!(read(&settings, b"4EA\r"), [Ok(command(*b"A\0\0"))]);
        assert_eq!(read(&settings, b"0D\r"), [Ok(command([0; 3]))]);
    }

    #[test]
    fn damaged_messages() {
        let settings = Settings::UNSET;
        for text in ["08SYN\r", "07SYM\r", "7SYN\r", "07\r", "0707SYN\r", "0aSYN\r"] {
            assert_eq!(read(&settings, text.as_bytes()), [Err(())], "{text}");
        }
        let one_bit = [0x30, 0x37, 0x53, 0x59, 0x4E, 0x8D];
        assert_eq!(read(&software(), &one_bit), [Err(())]);
        let mut reader = Reader::new_zeroed();
        reader.read(&settings, b'0');
        reader.damaged();
        let rest = b"7SYN\r07SYN\r".iter().filter_map(|byte| reader.read(&settings, *byte));
        assert_eq!(rest.collect::<Vec<_>>(), [Err(()), Ok(command(*b"SYN"))]);
    }
}
