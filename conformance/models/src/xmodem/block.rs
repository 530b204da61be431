//! Blocks and their checks.

pub(super) const SOH: u8 = 0x01;
pub(super) const STX: u8 = 0x02;
pub(super) const EOT: u8 = 0x04;
pub(super) const ACK: u8 = 0x06;
pub(super) const NAK: u8 = 0x15;
pub(super) const CAN: u8 = 0x18;
pub(super) const C: u8 = b'C';
/// What is said to a partner when it is over.
pub(super) const CANS: [u8; 8] = [CAN; 8];

/// The check of the data: X^16 + X^12 + X^5 + 1 divides it, with 16 zero bits behind it; or the
/// sum.
pub(super) fn check(data: &[u8], is_crc: bool) -> Vec<u8> {
    if !is_crc {
        let sum: u32 = data.iter().map(|byte| u32::from(*byte)).sum();
        return vec![(sum % 256) as u8];
    }
    let mut rest: u32 = 0;
    for byte in data.iter().chain(&[0, 0]) {
        for place in (0..8).rev() {
            rest = rest * 2 + u32::from(byte >> place & 1);
            if rest >= 0x1_0000 {
                rest ^= 0x1_1021;
            }
        }
    }
    vec![(rest / 256) as u8, (rest % 256) as u8]
}

/// The block with this number and data: 128 or 1,024 bytes.
pub(super) fn block(number: u8, data: &[u8], is_crc: bool) -> Vec<u8> {
    let first = if data.len() == 1_024 { STX } else { SOH };
    let mut block = vec![first, number, 255 - number];
    block.extend(data);
    block.extend(check(data, is_crc));
    block
}

/// What has come of a block so far.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Heard {
    Part,
    Bad,
    Good,
}

/// What these characters are, from SOH or STX on.
pub(super) fn heard(characters: &[u8], is_crc: bool) -> Heard {
    let length = if characters[0] == STX { 1_024 } else { 128 };
    if characters.len() >= 3 && characters[2] != 255 - characters[1] {
        return Heard::Bad;
    }
    let whole = 3 + length + if is_crc { 2 } else { 1 };
    if characters.len() < whole {
        return Heard::Part;
    }
    let (data, own) = characters[3..].split_at(length);
    if own == check(data, is_crc) { Heard::Good } else { Heard::Bad }
}
