//! A program as it lies on the disk: where it begins and ends, and its blocks.

use super::code::encoded;
use super::rules::{Rules, Unsupported};
use crate::line_ends::{LineEnds, Part};
use softplug_abi::Failure;

/// Why a job is refused before anything is sent.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Fault {
    pub(super) failure: Failure,
    pub(super) status: u16,
    /// From 1; 0 without.
    pub(super) line: u32,
    /// From 1; 0 without.
    pub(super) column: u32,
}

/// Status codes beside `bad-job`.
pub(super) const FIELD: u16 = 1;
pub(super) const PREAMBLE: u16 = 2;
const BEFORE_FIRST: u16 = 3;
const BEHIND_LAST: u16 = 4;

/// A character and its place in the file.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) struct Character {
    pub(super) byte: u8,
    pub(super) line: u32,
    pub(super) column: u32,
}

/// What stands up to an EOB, or to what follows it without one.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Block {
    pub(super) characters: Vec<Character>,
    pub(super) has_eob: bool,
    /// The line of the file at which it begins, from 1.
    pub(super) line: u32,
}

/// A program, cut into its parts.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Program {
    /// The `%` line, with its `%`; `None`: the file does not begin with one.
    pub(super) percent_line: Option<Block>,
    pub(super) blocks: Vec<Block>,
    /// A closing `%` is there.
    pub(super) is_closed: bool,
    /// What stands behind it and would not arrive.
    pub(super) behind: Option<Fault>,
}

/// An EOB or a character, after replacement.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Item {
    /// With the line that it ends.
    Eob(u32),
    Character(Character),
}

/// Cuts a file into its parts.
pub(super) fn read(data: &[u8], rules: &Rules) -> Program {
    let mut items = items(data, rules).into_iter().peekable();
    // The page does not name TAB and DEL among what may stand before the first `%`.
    while items.next_if(|item| is_blank(*item, b" \t\0\x7F")).is_some() {}
    let has_percent = matches!(items.peek(), Some(Item::Character(first)) if first.byte == b'%');
    let mut program = Program::default();
    if has_percent {
        program.percent_line = Some(Block::default());
    }
    let mut block = Block::default();
    let mut is_percent_line = has_percent;
    let mut is_in_comment = false;
    for item in items.by_ref() {
        if block.line == 0 {
            let (Item::Eob(line) | Item::Character(Character { line, .. })) = item;
            block.line = line;
        }
        match item {
            Item::Eob(_) => {
                block.has_eob = true;
                program.put(std::mem::take(&mut block), is_percent_line);
                (is_percent_line, is_in_comment) = (false, false);
            }
            Item::Character(character) => {
                let is_first = is_percent_line && block.characters.is_empty();
                if character.byte == b'%' && !is_in_comment && !is_first {
                    program.is_closed = true;
                    break;
                }
                is_in_comment = comment_goes_on(is_in_comment, character.byte);
                block.characters.push(character);
            }
        }
    }
    if !block.characters.is_empty() {
        program.put(block, is_percent_line);
    }
    let text = items.find(|item| !is_blank(*item, b" \t\0\x7F\x1A"));
    program.behind = match text {
        Some(Item::Character(character)) if has_percent && !rules.drops_after_end => {
            Some(bad_job(BEHIND_LAST, character))
        }
        Some(Item::Character(character)) if !has_percent => Some(bad_job(BEFORE_FIRST, character)),
        _ => None,
    };
    program
}

impl Program {
    fn put(&mut self, block: Block, is_percent_line: bool) {
        if is_percent_line {
            self.percent_line = Some(block);
        } else {
            self.blocks.push(block);
        }
    }
}

/// Characters of a text of the host, cut at its EOBs.
pub(super) fn lines(text: &[u8], rules: &Rules) -> Vec<Vec<Character>> {
    let mut lines = vec![Vec::new()];
    for item in items(text, rules) {
        match item {
            Item::Eob(_) => lines.push(Vec::new()),
            Item::Character(character) => {
                lines.last_mut().into_iter().for_each(|line| line.push(character));
            }
        }
    }
    // It ends with one EOB, whether it brings it or not.
    lines.pop_if(|line| line.is_empty());
    lines
}

/// Whether the next character stands in a comment.
pub(super) fn comment_goes_on(is_in_comment: bool, byte: u8) -> bool {
    match byte {
        b'(' => true,
        b')' => false,
        _ => is_in_comment,
    }
}

/// Bytes replaced, line ends found; places are those of the file.
fn items(data: &[u8], rules: &Rules) -> Vec<Item> {
    let (mut in_file, mut in_text) = (LineEnds::default(), LineEnds::default());
    let (mut line, mut column) = (1, 1);
    let mut items = Vec::new();
    for byte in data {
        let place = (line, column);
        match in_file.next(*byte) {
            Part::Line => column += 1,
            Part::End => (line, column) = (line + 1, 1),
            Part::EndGoesOn => {}
        }
        let replaced = rules.replace.iter().rfind(|(from, _)| from == byte);
        let byte = replaced.map_or(*byte, |(_, to)| *to);
        let (line, column) = place;
        match in_text.next(byte) {
            Part::Line => {
                let left = supported(byte, rules);
                let character = |byte| Item::Character(Character { byte, line, column });
                items.extend(left.map(character));
            }
            Part::End => items.push(Item::Eob(line)),
            Part::EndGoesOn => {}
        }
    }
    items
}

/// A character outside the code is a space, or none, before all that follows; the page
/// does not say so. One that is refused stays, and is met as it stands on the tape.
fn supported(byte: u8, rules: &Rules) -> Option<u8> {
    let sent = if rules.upper { byte.to_ascii_uppercase() } else { byte };
    match rules.unsupported {
        Unsupported::Space if encoded(sent, rules).is_none() => Some(b' '),
        Unsupported::Drop if encoded(sent, rules).is_none() => None,
        Unsupported::Refuse | Unsupported::Space | Unsupported::Drop => Some(byte),
    }
}

fn is_blank(item: Item, blanks: &[u8]) -> bool {
    match item {
        Item::Eob(_) => true,
        Item::Character(character) => blanks.contains(&character.byte),
    }
}

fn bad_job(status: u16, character: Character) -> Fault {
    let Character { line, column, .. } = character;
    Fault { failure: Failure::BadJob, status, line, column }
}
