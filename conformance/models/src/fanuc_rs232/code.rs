//! The codes: characters on the wire and in text.

use super::rules::{Code, Parity, Rules};

/// The characters of the table that can stand in a program, and their EIA codes.
const TABLE: &[(u8, Option<u8>)] = &[
    (b'0', Some(0x20)),
    (b'1', Some(0x01)),
    (b'2', Some(0x02)),
    (b'3', Some(0x13)),
    (b'4', Some(0x04)),
    (b'5', Some(0x15)),
    (b'6', Some(0x16)),
    (b'7', Some(0x07)),
    (b'8', Some(0x08)),
    (b'9', Some(0x19)),
    (b'A', Some(0x61)),
    (b'B', Some(0x62)),
    (b'C', Some(0x73)),
    (b'D', Some(0x64)),
    (b'E', Some(0x75)),
    (b'F', Some(0x76)),
    (b'G', Some(0x67)),
    (b'H', Some(0x68)),
    (b'I', Some(0x79)),
    (b'J', Some(0x51)),
    (b'K', Some(0x52)),
    (b'L', Some(0x43)),
    (b'M', Some(0x54)),
    (b'N', Some(0x45)),
    (b'O', Some(0x46)),
    (b'P', Some(0x57)),
    (b'Q', Some(0x58)),
    (b'R', Some(0x49)),
    (b'S', Some(0x32)),
    (b'T', Some(0x23)),
    (b'U', Some(0x34)),
    (b'V', Some(0x25)),
    (b'W', Some(0x26)),
    (b'X', Some(0x37)),
    (b'Y', Some(0x38)),
    (b'Z', Some(0x29)),
    (b' ', Some(0x10)),
    (b'+', Some(0x70)),
    (b'-', Some(0x40)),
    (b'/', Some(0x31)),
    (b'.', Some(0x6B)),
    (b',', Some(0x3B)),
    (b'&', Some(0x0E)),
    (b'%', Some(0x0B)),
    (b'(', Some(0x1A)),
    (b')', Some(0x4A)),
    (b'\t', Some(0x3E)),
    (0x08, Some(0x2A)),
    (0x7F, Some(0x7F)),
    // Of these two the page does not say that they can stand in a program: in ISO
    // they leave, in EIA a NUL is outside the code.
    (0x00, None),
    (b':', None),
    (b'#', None),
    (b'*', None),
    (b'=', None),
    (b'[', None),
    (b']', None),
];

/// EOB in EIA.
pub(super) const EIA_EOB: u8 = 0x80;

/// What a character of a program is on the wire; `None`: it is outside the code.
pub(super) fn encoded(character: u8, rules: &Rules) -> Option<u8> {
    let has_entry = TABLE.iter().any(|(known, _)| *known == character);
    match rules.code {
        Code::Iso => {
            let is_printable = (0x20..=0x7E).contains(&character);
            (has_entry || rules.ascii && is_printable).then(|| iso(character, rules))
        }
        Code::Eia => eia(character, rules),
    }
}

/// An EIA character; `None`: it has no code.
pub(super) fn eia(character: u8, rules: &Rules) -> Option<u8> {
    let own = rules.eia_codes.iter().rfind(|(known, _)| *known == character);
    let entry = TABLE.iter().find(|(known, _)| *known == character);
    own.map(|(_, code)| *code).or(entry.and_then(|(_, code)| *code))
}

/// An ISO character with the parity that we make.
pub(super) fn iso(character: u8, rules: &Rules) -> u8 {
    let is_odd = character.count_ones() % 2 == 1;
    let makes_parity = rules.parity == Parity::Software;
    if makes_parity && is_odd { character | 0x80 } else { character }
}

/// The EOB as it leaves.
pub(super) fn eob(rules: &Rules) -> Vec<u8> {
    match rules.code {
        Code::Iso => rules.eob.iter().map(|byte| iso(*byte, rules)).collect(),
        Code::Eia => vec![EIA_EOB],
    }
}

/// Whether an ISO character that came has a wrong parity bit.
pub(super) fn has_wrong_parity(byte: u8, rules: &Rules) -> bool {
    rules.parity == Parity::Software && byte.count_ones() % 2 == 1
}

/// What came, as text: EOB of EIA is LF. `None`: EIA has no such code.
pub(super) fn decoded(byte: u8, code: Code, rules: &Rules) -> Option<u8> {
    if code == Code::Iso {
        return Some(byte & 0x7F);
    }
    let own = rules.eia_codes.iter().rfind(|(_, known)| *known == byte);
    if let Some((character, _)) = own {
        return Some(*character);
    }
    match byte {
        EIA_EOB => Some(b'\n'),
        0x00 => Some(0x00),
        byte => TABLE.iter().find(|(_, known)| *known == Some(byte)).map(|(known, _)| *known),
    }
}
