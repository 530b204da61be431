//! What a program is written in: each character once, with how often and where first.

use std::collections::HashMap;
use std::io::{self, Read};

use data_encoding::HEXLOWER;

/// Bytes that are read at once.
const CHUNK: usize = 64 * 1024;
/// Most bytes of a character in UTF-8.
const LONGEST: usize = 4;

/// A character, or a byte that is none in UTF-8.
///
/// ```
/// use softplug_trial::Written;
///
/// let umlaut = Written::Character('ä');
/// assert_eq!((umlaut.shown(), umlaut.hex()), ("ä".to_owned(), "c3a4".to_owned()));
/// assert_eq!(umlaut.instead(), Some("AE"));
/// assert_eq!(Written::Character('\t').shown(), "TAB");
/// assert_eq!(Written::Byte(0xE4).shown(), "byte e4");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum Written {
    /// A character.
    Character(char),
    /// A byte that belongs to none.
    Byte(u8),
}

/// A character of a program.
///
/// ```
/// use softplug_trial::{Found, Written, characters};
///
/// let found = characters(&mut "O1\nXä\n1ä".as_bytes(), usize::MAX)?.expect("there are few");
/// assert_eq!(found.len(), 5);
/// let written = Written::Character('ä');
/// assert_eq!(found[4], Found { written, count: 2, line: 2, column: 2 });
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Found {
    /// Which one.
    pub written: Written,
    /// How often it is there.
    pub count: u64,
    /// The line in which it stands first, counted from 1.
    pub line: u64,
    /// Its column there, in characters, counted from 1.
    pub column: u64,
}

/// All characters of a program, in the order in which they come first; `None` if there are more
/// than `most` different ones.
///
/// # Errors
/// The program cannot be read.
pub fn characters(program: &mut dyn Read, most: usize) -> io::Result<Option<Vec<Found>>> {
    let mut reading = Reading::default();
    let mut buffer = vec![0; CHUNK];
    let mut kept = 0;
    loop {
        let count = match program.read(&mut buffer[kept..]) {
            Ok(count) => count,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            Err(error) => return Err(error),
        };
        let filled = kept + count;
        // A character that goes on in what is read next.
        let whole = if count == 0 { filled } else { filled - unfinished(&buffer[..filled]) };
        reading.add(&buffer[..whole]);
        if reading.found.len() > most {
            return Ok(None);
        }
        if count == 0 {
            return Ok(Some(reading.found));
        }
        buffer.copy_within(whole..filled, 0);
        kept = filled - whole;
    }
}

/// Bytes at the end that are the beginning of a character.
fn unfinished(bytes: &[u8]) -> usize {
    let last = bytes.utf8_chunks().last().map_or(&[][..], |chunk| chunk.invalid());
    let is_begun = |error: std::str::Utf8Error| error.error_len().is_none();
    let is_open = last.len() < LONGEST && std::str::from_utf8(last).is_err_and(is_begun);
    if is_open { last.len() } else { 0 }
}

/// What has been found so far.
struct Reading {
    found: Vec<Found>,
    places: HashMap<Written, usize>,
    /// The place of each byte of ASCII, which are most of a program.
    ascii: [Option<usize>; 128],
    line: u64,
    column: u64,
}

impl Default for Reading {
    fn default() -> Self {
        let (found, places) = (Vec::new(), HashMap::new());
        Self { found, places, ascii: [None; 128], line: 1, column: 1 }
    }
}

impl Reading {
    fn add(&mut self, bytes: &[u8]) {
        for chunk in bytes.utf8_chunks() {
            for character in chunk.valid().chars() {
                self.one(Written::Character(character));
            }
            for byte in chunk.invalid() {
                self.one(Written::Byte(*byte));
            }
        }
    }

    fn one(&mut self, written: Written) {
        let at = match written {
            Written::Character(ascii) if ascii.is_ascii() => self.ascii[ascii as usize],
            _ => self.places.get(&written).copied(),
        };
        let at = at.unwrap_or_else(|| self.new_one(written));
        self.found[at].count += 1;
        if written == Written::Character('\n') {
            (self.line, self.column) = (self.line + 1, 1);
        } else {
            self.column += 1;
        }
    }

    fn new_one(&mut self, written: Written) -> usize {
        let at = self.found.len();
        self.found.push(Found { written, count: 0, line: self.line, column: self.column });
        match written {
            Written::Character(ascii) if ascii.is_ascii() => self.ascii[ascii as usize] = Some(at),
            _ => drop(self.places.insert(written, at)),
        }
        at
    }
}

impl Written {
    /// Its bytes, as they stand in the program.
    pub fn bytes(self) -> Vec<u8> {
        match self {
            Self::Character(character) => character.to_string().into_bytes(),
            Self::Byte(byte) => vec![byte],
        }
    }

    /// Its bytes as hex digits.
    pub fn hex(self) -> String {
        HEXLOWER.encode(&self.bytes())
    }

    /// As it is shown: what cannot be seen by its name or number.
    pub fn shown(self) -> String {
        match self {
            Self::Character('\t') => "TAB".to_owned(),
            Self::Character(' ') => "SPACE".to_owned(),
            Self::Character(character) if is_visible(character) => character.to_string(),
            Self::Character(character) if character.is_ascii() => {
                format!("byte {:02x}", character as u32)
            }
            Self::Character(character) => format!("U+{:04X}", character as u32),
            Self::Byte(byte) => format!("byte {byte:02x}"),
        }
    }

    /// What a person would write in its place.
    pub fn instead(self) -> Option<&'static str> {
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

/// Whether it can be seen, and moves nothing: what the standard library does not escape behind
/// another character, where marks that join it are as good as letters.
fn is_visible(character: char) -> bool {
    let is_plain = matches!(character, '"' | '\'' | '\\')
        || ['x', character].iter().collect::<String>().escape_debug().count() == 2;
    is_plain && !character.is_whitespace()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found_in(program: &[u8]) -> Vec<Found> {
        characters(&mut &*program, usize::MAX).unwrap().unwrap()
    }

    /// Gives a few bytes at a time.
    struct Slowly<'a>(&'a [u8], usize);

    impl Read for Slowly<'_> {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            let count = self.1.min(self.0.len()).min(buffer.len());
            buffer[..count].copy_from_slice(&self.0[..count]);
            self.0 = &self.0[count..];
            Ok(count)
        }
    }

    #[test]
    fn each_character_has_its_count_and_first_place() {
        let found = found_in("O1\nXä\n1ä".as_bytes());
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
        let found = found_in(b"A\xe4\xffB\xe4");
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

    #[test]
    fn characters_are_the_same_however_they_are_read() {
        let program = b"N1 \xc3\xa4\xe2\x82\xac\xf0\x9f\x94\xa7\xe4\xe2\x82X\xf0\x9f\n\xc3";
        let whole = found_in(program);
        assert_eq!(whole.iter().map(|found| found.count).sum::<u64>(), 14);
        for count in 1..9 {
            let read = characters(&mut Slowly(program, count), usize::MAX).unwrap().unwrap();
            assert_eq!(read, whole, "{count} bytes at a time");
        }
    }

    #[test]
    fn more_different_characters_than_are_wanted_are_not_counted() {
        assert_eq!(characters(&mut &b"ABCA"[..], 3).unwrap().unwrap().len(), 3);
        assert_eq!(characters(&mut &b"ABCA"[..], 2).unwrap(), None);
    }
}
