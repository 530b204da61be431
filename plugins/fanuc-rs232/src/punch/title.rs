//! What a program is called: its O number, else its first comment.

use crate::Settings;
use crate::request::wanted;
use crate::short::{Short, trimmed};
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// Where in a block we are.
#[derive(Copy, Clone, PartialEq, Eq, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(u8)]
enum Place {
    /// Between the first % and its EOB: text that nobody reads.
    Header,
    /// Nothing but spaces in this block yet.
    Start,
    /// In the digits of the program's number.
    Number,
    Comment,
    Text,
}

/// Reads along until it knows the name.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct Title {
    place: Place,
    /// There was more than comments.
    has_text: bool,
    /// O and its digits.
    number: Short,
    /// The first comment that is not empty, with its brackets.
    comment: Short,
    /// The last one that asks for a program.
    asking: Short,
    /// The comment that is read, or was read last.
    newest: Short,
    spare: [u8; 2],
}

impl Title {
    pub(crate) fn new() -> Self {
        Self { place: Place::Header, ..Self::new_zeroed() }
    }

    /// Whether this character begins another program.
    pub(crate) fn ends_before(&self, character: u8) -> bool {
        self.place == Place::Start && self.has_text && is_number_letter(character)
    }

    /// Another program begins here, in a new block.
    pub(crate) fn next_program(&mut self) {
        *self = Self { place: Place::Start, ..Self::new_zeroed() };
    }

    pub(crate) fn end_of_block(&mut self) {
        self.place = Place::Start;
    }

    /// A character of a block; whether it is one of a comment. The brackets are not.
    pub(crate) fn read(&mut self, settings: &Settings, character: u8) -> bool {
        let was_comment = self.place == Place::Comment;
        self.place = match (self.place, character) {
            (Place::Comment, _) => {
                self.newest.push(character & 0x7F);
                if character == b')' {
                    self.end_of_comment(settings);
                    Place::Text
                } else {
                    Place::Comment
                }
            }
            (Place::Header, _) => Place::Header,
            (_, b'(') => {
                self.newest.clear();
                self.newest.push(character);
                Place::Comment
            }
            (Place::Start, b' ') => Place::Start,
            (Place::Start, _) if is_number_letter(character) && self.number().is_none() => {
                self.has_text = true;
                self.number.clear();
                self.number.push(b'O');
                Place::Number
            }
            (Place::Number, b'0'..=b'9') => {
                self.number.push(character);
                Place::Number
            }
            _ => {
                self.has_text = true;
                Place::Text
            }
        };
        was_comment && self.place == Place::Comment
    }

    /// An empty comment says nothing.
    fn end_of_comment(&mut self, settings: &Settings) {
        let newest = self.newest.as_slice();
        if wanted(settings, newest).is_some() {
            self.asking = self.newest;
        }
        if self.comment.as_slice().is_empty() && newest.len() > 2 {
            self.comment = self.newest;
        }
    }

    /// O and digits.
    pub(crate) fn number(&self) -> Option<&[u8]> {
        let number = self.number.as_slice();
        (number.len() > 1).then_some(number)
    }

    /// The comment that asks for a program, with its brackets.
    pub(crate) fn asking(&self) -> &[u8] {
        self.asking.as_slice()
    }

    /// What the delivery is called, and how sure that is: 0 it has no name, 1 it is
    /// called by a comment, 2 by its number.
    pub(crate) fn name(&self) -> (u8, &[u8]) {
        if let Some(number) = self.number() {
            return (2, number);
        }
        let comment = self.comment.as_slice();
        let text = comment.get(1..).unwrap_or_default();
        let text = trimmed(text.strip_suffix(b")").unwrap_or(text));
        (u8::from(!text.is_empty()), text)
    }
}

fn is_number_letter(character: u8) -> bool {
    matches!(character, b'O' | b':')
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_plugin::SettingSet;

    /// The name of a program, read from behind the first %.
    fn name(program: &str) -> String {
        let mut title = Title::new();
        for byte in program.bytes() {
            match byte {
                b'\n' => title.end_of_block(),
                _ => _ = title.read(&Settings::UNSET, byte),
            }
        }
        String::from_utf8_lossy(title.name().1).into_owned()
    }

    #[test]
    fn number_goes_before_comment() {
        assert_eq!(name("\nO1234\nM30\n"), "O1234");
        assert_eq!(name("\n:0012(HOUSING)\n"), "O0012");
        assert_eq!(name("\n(HOUSING)\nO7\n"), "O7");
        assert_eq!(name("\n(HOUSING)\nN1 G0\n"), "HOUSING");
        assert_eq!(name("\nN1 G0 ( HOUSING 2 )\n(NO)\n"), "HOUSING 2");
        assert_eq!(name("\nN1 G0\n"), "");
    }

    #[test]
    fn what_is_no_name() {
        assert_eq!(name("(HEADER) O1\nN1 G0\n"), "", "text before the first EOB");
        assert_eq!(name("\nN1 O5\n"), "", "an O in mid-block");
        assert_eq!(name("\n(O5)\nN1\n"), "O5", "it is the comment");
        assert_eq!(name("\nO\n(A)\n"), "A", "O without digits");
        assert_eq!(name("\n()\n(A)\n"), "A", "an empty comment");
        assert_eq!(name("\n(OPEN\n(A)\n"), "A", "a comment that the block ends");
        assert_eq!(name("\nO1\nO2\n"), "O1", "the first of several programs");
    }

    #[test]
    fn long_comments_are_cut() {
        let long = format!("\n({})\n", "A".repeat(500));
        assert_eq!(name(&long), "A".repeat(127));
    }

    #[test]
    fn brackets_are_not_of_the_comment() {
        let mut title = Title::new();
        title.end_of_block();
        let marks: Vec<_> =
            b"G1(A)X".iter().map(|byte| title.read(&Settings::UNSET, *byte)).collect();
        assert_eq!(marks, [false, false, false, true, false, false]);
    }

    #[test]
    fn another_program_begins_with_its_number_behind_text() {
        let mut title = Title::new();
        assert!(!title.ends_before(b'O'), "the header");
        title.end_of_block();
        assert!(!title.ends_before(b'O'), "nothing before it");
        title.read(&Settings::UNSET, b'M');
        assert!(!title.ends_before(b'O'), "in mid-block");
        title.end_of_block();
        assert!(title.ends_before(b'O') && title.ends_before(b':'));
        assert!(!title.ends_before(b'N'));
    }
}
