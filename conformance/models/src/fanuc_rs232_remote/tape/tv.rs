//! Writes lines, each block with an even number of characters where that is wanted.

use super::lines::Line;
use super::rules::TapeRules;

/// Writes a tape.
#[derive(Clone, Debug)]
pub(super) struct Writer<'a> {
    rules: &'a TapeRules,
    tape: Vec<u8>,
    /// Characters of the next block that have been written: CRs behind LF.
    count: usize,
    /// The last line has no EOB yet: it gets one where a `%` is added.
    open: Option<Line>,
    is_in_header: bool,
}

impl<'a> Writer<'a> {
    pub(super) fn new(rules: &'a TapeRules) -> Self {
        Self { rules, tape: Vec::new(), count: 0, open: None, is_in_header: false }
    }

    /// The `%` line; one that lacks is added. It is in no block.
    pub(super) fn begin(&mut self, header: Option<&Line>) {
        match header {
            Some(header) => {
                self.tape.extend(&header.characters);
                if header.has_eob {
                    self.eob();
                } else {
                    self.is_in_header = true;
                }
            }
            None if self.rules.percent => {
                self.tape.push(b'%');
                self.eob();
            }
            None => {}
        }
    }

    /// A block.
    pub(super) fn block(&mut self, line: &Line) {
        if line.has_eob {
            self.tape.extend(&line.characters);
            self.pad(line);
            self.eob();
        } else {
            self.tape.extend(&line.characters);
            self.open = Some(line.clone());
        }
    }

    /// The closing `%`: one that lacks is added behind an EOB.
    pub(super) fn end(mut self, is_closed: bool) -> Vec<u8> {
        if !is_closed && self.rules.percent {
            if let Some(line) = self.open.take() {
                self.pad(&line);
                self.eob();
            } else if self.is_in_header {
                self.eob();
            }
        }
        if is_closed || self.rules.percent {
            self.tape.push(b'%');
        }
        self.tape
    }

    /// A space before the EOB of a block with an odd number of characters.
    fn pad(&mut self, line: &Line) {
        let own = self.counted(&line.characters);
        let eob = self.rules.eob;
        let end = eob.iter().position(|byte| *byte == b'\n');
        // Up to LF; an EOB without LF is one character.
        let ending = end.map_or(1, |end| 1 + if self.rules.tv_cr { end } else { 0 });
        if self.rules.tv_pad && (self.count + own + ending) % 2 == 1 {
            self.tape.push(b' ');
        }
    }

    fn eob(&mut self) {
        let eob = self.rules.eob;
        self.tape.extend(eob);
        // CRs behind LF are of the next block.
        let end = eob.iter().position(|byte| *byte == b'\n');
        let behind = end.map_or(0, |end| eob.len() - 1 - end);
        self.count = if self.rules.tv_cr { behind } else { 0 };
    }

    /// Characters that count. With `tv_comments` off what stands in parentheses does not;
    /// the parentheses do.
    fn counted(&self, characters: &[u8]) -> usize {
        let mut in_comment = false;
        let mut count = 0;
        for character in characters {
            if *character == b')' {
                in_comment = false;
            }
            if !in_comment || self.rules.tv_comments {
                count += 1;
            }
            if *character == b'(' {
                in_comment = true;
            }
        }
        count
    }
}
