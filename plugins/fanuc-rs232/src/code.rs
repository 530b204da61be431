//! The two tape codes, ISO and EIA, and the control codes DC1 to DC4, SYN and NAK.

use crate::{ParityMode, Settings};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// A tape code.
#[derive(Copy, Clone, PartialEq, Eq, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(u8)]
pub(crate) enum Code {
    Iso,
    Eia,
}

/// What a byte on the line stands for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Decoded {
    /// A character of ASCII; LF stands for EOB.
    Character(u8),
    /// A character without meaning: CR, NUL and DEL in ISO, DEL in EIA.
    Ignored,
    /// The parity is wrong. In ISO this is the character without its parity bit,
    /// in EIA the byte itself.
    Damaged(u8),
    /// A byte without a meaning in EIA. A blank (00) is one too: inside a program
    /// it is an error.
    Unknown(u8),
}

/// A control code from the partner.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Control {
    Dc1,
    Dc2,
    Dc3,
    Dc4,
    Syn,
    Nak,
}

/// Every character that has an EIA code, with these codes. NUL is not here: a
/// blank cannot stand inside a program.
const EIA: [(&[u8], &[u8]); 5] = [
    (b"0123456789", &[0x20, 0x01, 0x02, 0x13, 0x04, 0x15, 0x16, 0x07, 0x08, 0x19]),
    (b"ABCDEFGHI", &[0x61, 0x62, 0x73, 0x64, 0x75, 0x76, 0x67, 0x68, 0x79]),
    (b"JKLMNOPQR", &[0x51, 0x52, 0x43, 0x54, 0x45, 0x46, 0x57, 0x58, 0x49]),
    (b"STUVWXYZ", &[0x32, 0x23, 0x34, 0x25, 0x26, 0x37, 0x38, 0x29]),
    (
        b"\n +-/.,&%()\x08\t\x7F",
        &[0x80, 0x10, 0x70, 0x40, 0x31, 0x6B, 0x3B, 0x0E, 0x0B, 0x1A, 0x4A, 0x2A, 0x3E, 0x7F],
    ),
];

/// The EIA code of each character, 0 where it has none, and the character of
/// each code below 80.
static TABLES: ([u8; 128], [u8; 128]) = {
    let mut tables = ([0; 128], [0; 128]);
    let mut row = 0;
    while row < EIA.len() {
        let (characters, codes) = EIA[row];
        let mut at = 0;
        while at < characters.len() {
            tables.0[characters[at] as usize] = codes[at];
            if codes[at] != EOB_EIA {
                tables.1[codes[at] as usize] = characters[at];
            }
            at += 1;
        }
        row += 1;
    }
    tables
};

const EOB_EIA: u8 = 0x80;
const DEL: u8 = 0x7F;

/// The byte on the line for a character of ASCII, LF for EOB; `None`: the code
/// does not have it.
pub(crate) fn encode(settings: &Settings, code: Code, character: u8) -> Option<u8> {
    let standard = *TABLES.0.get(usize::from(character))?;
    let is_there = standard != 0;
    match code {
        Code::Eia => {
            let own = paired(settings.eia_codes.as_slice(), 0, character);
            own.or(is_there.then_some(standard))
        }
        Code::Iso => {
            // What ISO has besides the characters of EIA.
            let is_known = is_there
                || matches!(character, b':' | b'#' | b'*' | b'=' | b'[' | b']' | b'\r' | 0)
                || (settings.ascii && matches!(character, b' '..=b'~'));
            let odd = character.count_ones() as u8 & 1;
            let parity = if settings.parity == ParityMode::Software { odd << 7 } else { 0 };
            is_known.then_some(character | parity)
        }
    }
}

/// What a byte on the line stands for.
pub(crate) fn decode(settings: &Settings, code: Code, byte: u8) -> Decoded {
    let low = byte & 0x7F;
    let is_odd = byte.count_ones() & 1 == 1;
    if code == Code::Iso {
        if settings.parity == ParityMode::Software && is_odd {
            return Decoded::Damaged(low);
        }
        return match low {
            b'\r' | 0 | DEL => Decoded::Ignored,
            _ => Decoded::Character(low),
        };
    }
    if let Some(character) = paired(settings.eia_codes.as_slice(), 1, byte) {
        return Decoded::Character(character);
    }
    let character = TABLES.1.get(usize::from(byte)).copied().unwrap_or_default();
    match (byte, character) {
        (EOB_EIA, _) => Decoded::Character(b'\n'),
        (DEL, _) => Decoded::Ignored,
        (0, _) => Decoded::Unknown(0),
        (_, 0) if is_odd => Decoded::Unknown(byte),
        (_, 0) => Decoded::Damaged(byte),
        _ => Decoded::Character(character),
    }
}

/// The control code that a byte stands for. With their parity the codes are not
/// EIA characters; without it 13, 15 and 16 are digits in EIA, and can be a
/// control code only while we send.
pub(crate) fn control(settings: &Settings, code: Code, byte: u8, sending: bool) -> Option<Control> {
    let has_parity = settings.parity != ParityMode::None || code == Code::Eia;
    let control = match if has_parity { byte } else { byte & 0x7F } {
        0x11 => Control::Dc1,
        0x12 => Control::Dc2,
        0x13 | 0x93 => Control::Dc3,
        0x14 => Control::Dc4,
        0x15 | 0x95 => Control::Nak,
        0x16 | 0x96 => Control::Syn,
        _ => return None,
    };
    let is_digit = code == Code::Eia && matches!(byte, 0x13 | 0x15 | 0x16);
    let is_fed = sending && settings.plain_codes;
    (!is_digit || is_fed).then_some(control)
}

/// What `byte` is paired with in a setting of pairs, of which it is the first (0)
/// or the second (1). The last such pair counts.
#[inline(never)]
pub(crate) fn paired(pairs: &[u8], place: usize, byte: u8) -> Option<u8> {
    let mut found = None;
    for [first, second] in pairs.as_chunks().0 {
        let (own, other) = if place == 0 { (first, second) } else { (second, first) };
        if *own == byte {
            found = Some(*other);
        }
    }
    found
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use softplug_plugin::{Bytes, SettingSet, SettingType, Values};

    /// A setting of this value.
    pub(crate) fn bytes<const N: usize>(value: &[u8]) -> Bytes<N> {
        let record = [&[0, 0, 4, 0, value.len() as u8, 0], value].concat();
        let value = Values::new(&record).raw().next().and_then(Result::ok);
        value.and_then(|value| Bytes::from_value(&value)).expect("it fits")
    }

    /// The code table of the protocol's page: character, ISO with even parity, EIA.
    const PAGE: &str = "\
        0 30 20, A 41 61, K 4B 52, U 55 34, 1 B1 01, B 42 62, L CC 43, V 56 25, \
        2 B2 02, C C3 73, M 4D 54, W D7 26, 3 33 13, D 44 64, N 4E 45, X D8 37, \
        4 B4 04, E C5 75, O CF 46, Y 59 38, 5 35 15, F C6 76, P 50 57, Z 5A 29, \
        6 36 16, G 47 67, Q D1 58, \x20 A0 10, 7 B7 07, H 48 68, R D2 49, + 2B 70, \
        8 B8 08, I C9 79, S 53 32, - 2D 40, 9 39 19, J CA 51, T D4 23, / AF 31, \
        . 2E 6B, \x2C AC 3B, & A6 0E, % A5 0B, \n 0A 80, ( 28 1A, ) A9 4A, \
        \x7F FF 7F, \x08 88 2A, \t 09 3E";
    /// The characters that ISO has and EIA has not.
    const ISO_ALONE: [(u8, u8); 8] = [
        (b':', 0x3A),
        (b'#', 0xA3),
        (b'*', 0xAA),
        (b'=', 0xBD),
        (b'[', 0xDB),
        (b']', 0xDD),
        (b'\r', 0x8D),
        (0, 0),
    ];

    fn rows() -> impl Iterator<Item = (u8, u8, u8)> {
        let mut rest = PAGE.as_bytes();
        std::iter::from_fn(move || {
            let (character, after) = rest.split_first()?;
            let number = |at: usize| {
                let digits = std::str::from_utf8(&after[at..at + 2]).unwrap();
                u8::from_str_radix(digits, 16).unwrap()
            };
            rest = after.get(8..).unwrap_or_default();
            Some((*character, number(1), number(4)))
        })
    }

    fn software() -> Settings {
        Settings { parity: ParityMode::Software, ..Settings::UNSET }
    }

    #[test]
    fn every_row_of_the_page_both_ways() {
        let settings = software();
        assert_eq!(rows().count(), 50);
        for (character, iso, eia) in rows() {
            assert_eq!(encode(&settings, Code::Iso, character), Some(iso), "{character:02x}");
            assert_eq!(encode(&settings, Code::Eia, character), Some(eia), "{character:02x}");
            let expected = match character {
                0x7F => Decoded::Ignored,
                _ => Decoded::Character(character),
            };
            assert_eq!(decode(&settings, Code::Iso, iso), expected);
            assert_eq!(decode(&settings, Code::Eia, eia), expected);
        }
        for (character, iso) in ISO_ALONE {
            assert_eq!(encode(&settings, Code::Iso, character), Some(iso), "{character:02x}");
            assert_eq!(encode(&settings, Code::Eia, character), None, "{character:02x}");
        }
    }

    #[test]
    fn what_is_not_on_the_page_has_no_code() {
        let settings = software();
        for character in 0..=u8::MAX {
            let on_page = rows().any(|(own, ..)| own == character);
            let alone = ISO_ALONE.iter().any(|(own, _)| *own == character);
            let iso = encode(&settings, Code::Iso, character).is_some();
            assert_eq!(iso, on_page || alone, "{character:02x}");
            assert_eq!(encode(&settings, Code::Eia, character).is_some(), on_page);
            let ascii = Settings { ascii: true, ..settings };
            let printable = (0x20..0x7F).contains(&character);
            let iso = encode(&ascii, Code::Iso, character).is_some();
            assert_eq!(iso, on_page || alone || printable, "{character:02x}");
            assert_eq!(encode(&ascii, Code::Eia, character).is_some(), on_page);
        }
    }

    #[test]
    fn iso_parity_is_made_and_checked_in_software_and_else_taken_off() {
        for byte in 0..=u8::MAX {
            let low = byte & 0x7F;
            let good = match low {
                0 | 0x0D | 0x7F => Decoded::Ignored,
                _ => Decoded::Character(low),
            };
            let is_even = byte.count_ones() % 2 == 0;
            let checked = if is_even { good } else { Decoded::Damaged(low) };
            assert_eq!(decode(&software(), Code::Iso, byte), checked);
            assert_eq!(decode(&Settings::UNSET, Code::Iso, byte), good);
        }
        let ascii = Settings { ascii: true, ..software() };
        for character in 0x20..0x7F {
            let byte = encode(&ascii, Code::Iso, character).unwrap();
            assert_eq!((byte & 0x7F, byte.count_ones() % 2), (character, 0));
            let plain = Settings { parity: ParityMode::None, ..ascii };
            assert_eq!(encode(&plain, Code::Iso, character), Some(character));
        }
    }

    #[test]
    fn eia_bytes_without_a_character() {
        let settings = Settings::UNSET;
        for byte in 0..=u8::MAX {
            if rows().any(|(.., own)| own == byte) {
                continue;
            }
            let expected = match byte.count_ones() % 2 {
                0 if byte != 0 => Decoded::Damaged(byte),
                _ => Decoded::Unknown(byte),
            };
            assert_eq!(decode(&settings, Code::Eia, byte), expected, "{byte:02x}");
        }
    }

    #[test]
    fn eia_codes_go_over_the_table() {
        let settings = Settings { eia_codes: bytes(b"=\x5B#\x3D"), ..Settings::UNSET };
        for (character, code) in [(b'=', 0x5B), (b'#', 0x3D)] {
            assert_eq!(encode(&settings, Code::Eia, character), Some(code));
            assert_eq!(decode(&settings, Code::Eia, code), Decoded::Character(character));
        }
        assert_eq!(encode(&settings, Code::Eia, b'*'), None);
        assert_eq!(encode(&settings, Code::Eia, b'A'), Some(0x61));
    }

    #[test]
    fn control_codes_are_those_with_parity_and_without_it_where_no_digit_is_meant() {
        use Control::*;
        let plain = Settings { plain_codes: true, ..Settings::UNSET };
        let both = [Some(Dc1), Some(Dc2), Some(Dc3), Some(Dc3), Some(Dc4)];
        let both = [&both[..], &[Some(Nak), Some(Nak), Some(Syn), Some(Syn)]].concat();
        let with_parity = [Some(Dc1), Some(Dc2), None, Some(Dc3), Some(Dc4)];
        let with_parity = [&with_parity[..], &[None, Some(Nak), None, Some(Syn)]].concat();
        let codes = [0x11, 0x12, 0x13, 0x93, 0x14, 0x15, 0x95, 0x16, 0x96];
        for (settings, code, sending, expected) in [
            (Settings::UNSET, Code::Iso, true, &both),
            (Settings::UNSET, Code::Iso, false, &both),
            (plain, Code::Eia, true, &both),
            (plain, Code::Eia, false, &with_parity),
            (Settings::UNSET, Code::Eia, true, &with_parity),
            (Settings::UNSET, Code::Eia, false, &with_parity),
        ] {
            for byte in 0..=u8::MAX {
                let expected = codes
                    .iter()
                    .zip(expected)
                    .find(|(own, _)| **own == byte)
                    .and_then(|(_, it)| *it);
                assert_eq!(control(&settings, code, byte, sending), expected, "{byte:02x}");
            }
        }
    }
}
