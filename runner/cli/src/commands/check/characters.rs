//! What a program is written in: each character once, with how often and where first.

use std::collections::HashMap;

use softplug_gateway::is_plain;

/// A character, or a byte that is none in UTF-8.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub(super) enum Written {
    Character(char),
    Byte(u8),
}

/// A character of a program.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Found {
    pub(super) written: Written,
    pub(super) count: u64,
    /// Where it stands first, counted from 1; columns in characters.
    pub(super) line: u64,
    pub(super) column: u64,
}

/// All characters of a program, in the order in which they come first.
pub(super) fn characters(program: &[u8]) -> Vec<Found> {
    let mut found: Vec<Found> = Vec::new();
    let mut places: HashMap<Written, usize> = HashMap::new();
    let (mut line, mut column) = (1, 1);
    for chunk in program.utf8_chunks() {
        let valid = chunk.valid().chars().map(Written::Character);
        let invalid = chunk.invalid().iter().copied().map(Written::Byte);
        for written in valid.chain(invalid) {
            let at = *places.entry(written).or_insert_with(|| {
                found.push(Found { written, count: 0, line, column });
                found.len() - 1
            });
            found[at].count += 1;
            if written == Written::Character('\n') {
                (line, column) = (line + 1, 1);
            } else {
                column += 1;
            }
        }
    }
    found
}

impl Written {
    pub(super) fn bytes(self) -> Vec<u8> {
        match self {
            Self::Character(character) => character.to_string().into_bytes(),
            Self::Byte(byte) => vec![byte],
        }
    }

    /// As it is shown: what cannot be seen by its name or number.
    pub(super) fn shown(self) -> String {
        match self {
            Self::Character('\t') => "TAB".to_owned(),
            Self::Character(' ') => "SPACE".to_owned(),
            Self::Character(character) if is_plain(character) && !character.is_whitespace() => {
                character.to_string()
            }
            Self::Character(character) if character.is_ascii() => {
                format!("byte {:02x}", character as u32)
            }
            Self::Character(character) => format!("U+{:04X}", character as u32),
            Self::Byte(byte) => format!("byte {byte:02x}"),
        }
    }

    /// What a person would write in its place.
    pub(super) fn instead(self) -> Option<&'static str> {
        let Self::Character(character) = self else {
            return Some("save the file as plain ASCII");
        };
        Some(match character {
            '\t' | '\u{a0}' | '\u{2007}' | '\u{202f}' => "a space",
            'ä' | 'Ä' | 'æ' | 'Æ' => "AE",
            'ö' | 'Ö' | 'ø' | 'Ø' => "OE",
            'ü' | 'Ü' => "UE",
            'ß' => "SS",
            'à'..='å' | 'À'..='Å' => "A",
            'è'..='ë' | 'È'..='Ë' => "E",
            'ç' | 'Ç' => "C",
            'ñ' | 'Ñ' => "N",
            '–' | '—' | '−' => "-",
            '‘' | '’' | '´' => "'",
            '“' | '”' | '„' => "\"",
            '×' => "X",
            '°' => "DEG",
            '\u{feff}' => "save the file without a byte order mark",
            '\u{1a}' => "leave out the end mark of an old editor",
            character if character.is_ascii_lowercase() => "a capital",
            character if character.is_control() => "leave it out",
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_character_has_its_count_and_first_place() {
        let found = characters("O1\nXä\n1ä".as_bytes());
        let place = |character| {
            let of = |found: &&Found| found.written == Written::Character(character);
            let Found { count, line, column, .. } = *found.iter().find(of).unwrap();
            (count, line, column)
        };
        assert_eq!(place('O'), (1, 1, 1));
        assert_eq!(place('1'), (2, 1, 2));
        assert_eq!(place('\n'), (2, 1, 3));
        assert_eq!(place('ä'), (2, 2, 2));
        assert_eq!(found.len(), 5);
    }

    #[test]
    fn what_is_no_utf_8_is_shown_as_its_bytes() {
        let found = characters(b"A\xe4\xffB\xe4");
        let shown: Vec<_> = found.iter().map(|found| found.written.shown()).collect();
        assert_eq!(shown, ["A", "byte e4", "byte ff", "B"]);
        assert_eq!((found[1].count, found[3].column), (2, 4));
    }

    #[test]
    fn what_cannot_be_seen_is_named() {
        let shown = ['\t', ' ', '\u{1}', '\u{202e}', '\u{a0}', 'é']
            .map(|character| Written::Character(character).shown());
        assert_eq!(shown, ["TAB", "SPACE", "byte 01", "U+202E", "U+00A0", "é"]);
    }
}
