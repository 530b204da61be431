//! A file as characters and EOBs, each with its place.

use super::rules::{TapeRules, Unsupported};

/// Line and column, both from 1, in bytes of the file.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Place {
    pub(super) line: u32,
    pub(super) column: u32,
}

/// A character of a file, or an EOB.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Symbol {
    Character(u8),
    Eob,
}

/// What comes behind a byte of an EOB and is still that EOB.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Before {
    Other,
    Cr,
    Lf,
    LfCr,
}

/// The symbols of a file: LF, CR LF, CR, LF CR and LF CR CR are one EOB each, behind
/// the replacement of bytes. Places are those of the file before it.
pub(super) fn read(rules: &TapeRules, data: &[u8]) -> Vec<(Symbol, Place)> {
    let mut symbols = Vec::new();
    let mut place = Place { line: 1, column: 1 };
    let (mut before, mut before_in_file) = (Before::Other, Before::Other);
    for byte in data {
        let at = place;
        if !is_more(&mut before_in_file, *byte) {
            place = match before_in_file {
                Before::Other => Place { column: place.column + 1, ..place },
                _ => Place { line: place.line + 1, column: 1 },
            };
        }
        let byte = replaced(rules, *byte);
        if !is_more(&mut before, byte) {
            let is_eob = before != Before::Other;
            symbols.push((if is_eob { Symbol::Eob } else { Symbol::Character(byte) }, at));
        }
    }
    symbols
}

/// Whether a byte is still of the EOB before it.
fn is_more(before: &mut Before, byte: u8) -> bool {
    let is_more;
    (is_more, *before) = match (*before, byte) {
        (Before::Lf, b'\r') => (true, Before::LfCr),
        (Before::Cr, b'\n') | (Before::LfCr, b'\r') => (true, Before::Other),
        (_, b'\n') => (false, Before::Lf),
        (_, b'\r') => (false, Before::Cr),
        _ => (false, Before::Other),
    };
    is_more
}

/// The last pair that has it says what is sent instead.
pub(super) fn replaced(rules: &TapeRules, byte: u8) -> u8 {
    let pair = rules.replace.chunks(2).rev().find(|pair| pair.first() == Some(&byte));
    pair.and_then(|pair| pair.get(1)).copied().unwrap_or(byte)
}

/// What leaves for a character.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Coded {
    As(u8),
    Nothing,
    Refused,
}

/// A character of a program in ISO. A `%` in a comment is outside the code.
pub(super) fn code(rules: &TapeRules, character: u8, in_comment: bool) -> Coded {
    let upper = if rules.upper { character.to_ascii_uppercase() } else { character };
    let is_percent = upper == b'%' && in_comment;
    if !is_percent && has_code(rules, upper) {
        return Coded::As(upper);
    }
    match rules.unsupported {
        Unsupported::Refuse => Coded::Refused,
        Unsupported::Space => Coded::As(b' '),
        Unsupported::Drop => Coded::Nothing,
    }
}

/// The table of codes. NUL and DEL stand in it.
fn has_code(rules: &TapeRules, character: u8) -> bool {
    let is_letter = character.is_ascii_uppercase() || character.is_ascii_digit();
    let is_of_table = is_letter || b" +-/.,&%():#*=[]\t\x08\x00\x7F".contains(&character);
    is_of_table || rules.ascii && (b' '..=b'~').contains(&character)
}
