//! The text of a delivery.

use super::rules::Rules;
use crate::room::Room;
use softplug_abi::Failure;

/// A name has at most so many bytes.
const NAME: usize = 127;

/// A program as it comes.
#[derive(Clone, Debug)]
pub(super) struct Delivery {
    pub(super) bytes: Vec<u8>,
    /// Something found no room, or was lost in the port.
    pub(super) lost: bool,
    /// What was wrong first, but for that.
    pub(super) wrong: Option<Failure>,
    /// The `%` line has not ended.
    is_in_header: bool,
    /// Nothing but spaces has come of the block.
    is_block_start: bool,
    /// Behind an O or `:` that begins a block.
    number: Option<Vec<u8>>,
    is_in_number: bool,
    comment: Option<Vec<u8>>,
    first_comment: Option<Vec<u8>>,
    /// Number and comment up to the last EOB.
    before: (Option<Vec<u8>>, Option<Vec<u8>>),
    /// The name that the last comment with one asks for.
    pub(super) asked: Option<String>,
    /// Something but spaces and comments has come behind the `%` line.
    has_text: bool,
    /// Characters of the block that count for TV.
    count: usize,
}

impl Delivery {
    /// It begins with its `%`.
    pub(super) fn new(rules: &Rules, room: &mut Room) -> Self {
        let mut delivery = Self {
            bytes: Vec::new(),
            lost: false,
            wrong: None,
            is_in_header: true,
            is_block_start: false,
            number: None,
            is_in_number: false,
            comment: None,
            first_comment: None,
            before: (None, None),
            asked: None,
            has_text: false,
            count: 0,
        };
        delivery.character(b'%', rules, room);
        delivery
    }

    /// An O or `:` here begins another program.
    pub(super) fn begins_another(&self, byte: u8) -> bool {
        self.has_text && self.is_block_start && [b'O', b':'].contains(&byte)
    }

    /// Something was wrong with it.
    pub(super) fn fails(&mut self, failure: Failure) {
        self.wrong = self.wrong.or(Some(failure));
    }

    /// A character that is neither EOB nor the closing `%`.
    pub(super) fn character(&mut self, byte: u8, rules: &Rules, room: &mut Room) {
        self.put(&[byte], room);
        if self.is_in_header {
            return;
        }
        self.look_for_number(byte);
        let stands_in_comment = self.comment.is_some() && byte != b')';
        self.count += usize::from(rules.tv_comments || !stands_in_comment);
        self.look_for_comment(byte, rules);
    }

    fn look_for_number(&mut self, byte: u8) {
        let begins = self.is_block_start && [b'O', b':'].contains(&byte);
        // Spaces at the start of a block are passed over; the page does not say so.
        self.is_block_start &= byte == b' ';
        if self.is_in_number {
            if byte.is_ascii_digit() {
                self.number.get_or_insert_default().push(byte);
            } else {
                self.is_in_number = false;
            }
        } else if begins && self.number.is_none() {
            self.is_in_number = true;
        }
    }

    fn look_for_comment(&mut self, byte: u8, rules: &Rules) {
        match (self.comment.as_mut(), byte) {
            (None, b'(') => self.comment = Some(Vec::new()),
            // Spaces behind a comment count as text; the page does not say so.
            (None, b' ') if self.is_block_start => {}
            (None, _) => self.has_text = true,
            (Some(_), b')') => {
                let comment = self.comment.take().unwrap_or_default();
                self.ask(&comment, rules);
                if !comment.is_empty() && self.first_comment.is_none() {
                    self.first_comment = Some(comment);
                }
            }
            (Some(comment), byte) if comment.len() < NAME => comment.push(byte),
            (Some(_), _) => {}
        }
    }

    /// Does the comment ask for a program? Of several the last counts; the page does
    /// not say so.
    fn ask(&mut self, comment: &[u8], rules: &Rules) {
        let mut comment = [b"(", comment, b")"].concat();
        comment.truncate(NAME + 1);
        let comment = text(&comment);
        let Some((before, behind)) = rules.request_pattern.split_once('*') else { return };
        let name = comment.strip_prefix(before).and_then(|rest| rest.strip_suffix(behind));
        let name = name.map(trimmed).filter(|name| !name.is_empty());
        if let Some(name) = name {
            self.asked = Some(name.to_owned());
        }
    }

    /// Characters of the block that count for TV.
    pub(super) fn count(&self) -> usize {
        self.count
    }

    /// So many characters of the block have come before.
    pub(super) fn has_counted(&mut self, count: usize) {
        self.count = count;
    }

    /// A CR that is not the EOB itself.
    pub(super) fn carriage_return(&mut self, rules: &Rules) {
        if rules.tv_cr && !self.is_in_header {
            self.count += 1;
        }
    }

    /// An LF, a CR that ends a line, or the EOB of EIA.
    pub(super) fn eob(&mut self, rules: &Rules, room: &mut Room) {
        let is_block = !self.is_in_header;
        self.end_line(rules, room);
        if is_block {
            self.end_block(rules);
        }
    }

    /// The `%` line of a program that follows another ends.
    pub(super) fn first_line_ends(&mut self, rules: &Rules, room: &mut Room) {
        self.end_line(rules, room);
    }

    /// The EOB belongs to its block.
    fn end_block(&mut self, rules: &Rules) {
        if rules.tv_check && !(self.count + 1).is_multiple_of(2) {
            self.fails(Failure::ParityCheck);
        }
        self.count = 0;
    }

    fn end_line(&mut self, rules: &Rules, room: &mut Room) {
        self.put(rules.line_end, room);
        (self.is_in_header, self.is_block_start, self.is_in_number) = (false, true, false);
        self.comment = None;
        self.before = (self.number.clone(), self.first_comment.clone());
    }

    /// The closing `%` and its line end. Where the `%` finds no room none follows; the
    /// page does not say so.
    pub(super) fn close(&mut self, rules: &Rules, room: &mut Room) {
        let before = self.bytes.len();
        self.put(b"%", room);
        if self.bytes.len() > before {
            self.put(rules.line_end, room);
        }
    }

    /// Characters without any meaning.
    pub(super) fn put(&mut self, bytes: &[u8], room: &mut Room) {
        for byte in bytes {
            if room.take() {
                self.bytes.push(*byte);
            } else {
                self.lost = true;
            }
        }
    }

    /// The name that was found.
    pub(super) fn name(&self) -> Option<String> {
        let number = self.number.as_ref().map(|number| format!("O{}", text(number)));
        let comment = self.first_comment.as_ref().map(|comment| trimmed(&text(comment)).to_owned());
        let name = number.or(comment).filter(|name| !name.is_empty())?;
        Some(name.chars().take(NAME + 1).collect())
    }

    /// The link interrupts it: what was found in its last block is no name yet. The page
    /// does not say so.
    pub(super) fn is_cut(&mut self) {
        (self.number, self.first_comment) = self.before.clone();
    }

    /// The program's number.
    pub(super) fn number(&self) -> Option<u64> {
        let number = self.number.as_ref()?;
        text(&number[..number.len().min(NAME)]).parse().ok()
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Without the blanks around it; a VT, as only a damaged character can be one, is none.
fn trimmed(text: &str) -> &str {
    text.trim_matches(|c: char| c.is_ascii_whitespace())
}
