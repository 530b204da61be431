//! A file as the `%` line, its blocks and what is behind the closing `%`.

use super::characters::{Coded, Place, Symbol, code};
use super::rules::TapeRules;

/// The `%` line or a block, encoded.
#[derive(Clone, Debug)]
pub(super) struct Line {
    /// Without its EOB.
    pub(super) characters: Vec<u8>,
    pub(super) has_eob: bool,
    pub(super) fault: Option<(Place, bool)>,
    /// Where that character stands among those that can be sent.
    pub(super) refused_at: Option<usize>,
    /// The line of the file at which it begins.
    pub(super) begins_at: u32,
}

impl Line {
    pub(super) fn new() -> Self {
        Self { characters: Vec::new(), has_eob: false, fault: None, refused_at: None, begins_at: 0 }
    }

    /// The first character that cannot be sent, and whether it is a `%`.
    pub(super) fn fault(&self) -> Option<(Place, bool)> {
        self.fault
    }

    /// Nothing of it leaves but its EOB.
    pub(super) fn is_blank(&self) -> bool {
        self.characters.is_empty() && self.refused_at.is_none()
    }

    /// One more character.
    pub(super) fn push(&mut self, rules: &TapeRules, character: u8, in_comment: bool, at: Place) {
        match code(rules, character, in_comment) {
            Coded::As(coded) => self.characters.push(coded),
            Coded::Nothing => {}
            Coded::Refused => {
                self.fault = self.fault.or(Some((at, character == b'%')));
                self.refused_at = self.refused_at.or(Some(self.characters.len()));
            }
        }
    }
}

/// A file in its parts.
#[derive(Clone, Debug)]
pub(super) struct Program {
    /// The line that begins with the first `%`; `None`: that one lacks.
    pub(super) header: Option<Line>,
    pub(super) blocks: Vec<Line>,
    /// It has a closing `%`.
    pub(super) is_closed: bool,
    /// The first character behind that one that is not passed over.
    pub(super) text_behind: Option<Place>,
}

impl Program {
    pub(super) fn is_opened(&self) -> bool {
        self.header.is_some()
    }

    pub(super) fn split(rules: &TapeRules, file: &[(Symbol, Place)]) -> Self {
        let mut program =
            Self { header: None, blocks: Vec::new(), is_closed: false, text_behind: None };
        let start = file.iter().position(|(symbol, _)| !is_passed_before(rules, *symbol));
        let mut rest = start.map_or(&[][..], |start| &file[start..]);
        if let [(Symbol::Character(b'%'), at), behind @ ..] = rest {
            let mut header = Line::new();
            header.push(rules, b'%', false, *at);
            rest = behind;
            program.line(rules, &mut rest, &mut header);
            program.header = Some(header);
        }
        while !program.is_closed && !rest.is_empty() {
            let mut block = Line::new();
            block.begins_at = rest.first().map_or(0, |(_, place)| place.line);
            program.line(rules, &mut rest, &mut block);
            // A closing `%` at the start of a line is no block.
            if !block.is_blank() || block.has_eob {
                program.blocks.push(block);
            }
        }
        let text = rest.iter().find(|(symbol, _)| !is_passed_behind(rules, *symbol));
        program.text_behind = text.map(|(_, place)| *place);
        program
    }

    /// One line, up to its EOB or the closing `%`. A comment ends with it at the latest.
    fn line(&mut self, rules: &TapeRules, rest: &mut &[(Symbol, Place)], line: &mut Line) {
        let mut in_comment = false;
        while let [(symbol, place), behind @ ..] = *rest {
            *rest = behind;
            match symbol {
                Symbol::Eob => {
                    line.has_eob = true;
                    return;
                }
                Symbol::Character(b'%') if !in_comment => {
                    self.is_closed = true;
                    return;
                }
                Symbol::Character(character) => {
                    line.push(rules, *character, in_comment, *place);
                    in_comment = match character {
                        b'(' => true,
                        b')' => false,
                        _ => in_comment,
                    };
                }
            }
        }
    }
}

/// Blank lines, spaces and NULs before the first `%`, also a character that leaves as a
/// space or not at all. The page does not name TAB and DEL.
fn is_passed_before(rules: &TapeRules, symbol: Symbol) -> bool {
    let Symbol::Character(character) = symbol else { return true };
    match code(rules, character, false) {
        Coded::As(coded) => matches!(coded, b' ' | b'\t' | 0x00 | 0x7F),
        Coded::Nothing => true,
        Coded::Refused => false,
    }
}

/// Blanks, blank lines, NUL, DEL and 1A behind the closing `%`. The page does not say
/// whether a character that leaves as a space or not at all is text: here it is none.
fn is_passed_behind(rules: &TapeRules, symbol: Symbol) -> bool {
    symbol == Symbol::Character(0x1A) || is_passed_before(rules, symbol)
}
