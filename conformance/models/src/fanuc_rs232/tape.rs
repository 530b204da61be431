//! What a program becomes on the wire.

use super::code::{encoded, eob};
use super::file::{self, Character, Fault, comment_goes_on};
use super::rules::{BlockNumbers, Code, Rules, Unsupported};
use super::select::{self, Start};
use softplug_abi::Failure;

/// All that leaves for a program.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Tape {
    pub(super) bytes: Vec<u8>,
    /// Characters up to the closing `%`, that one included. Without one: up to the
    /// end of the program; the page does not say which DC3 is the final one then.
    pub(super) closed: usize,
}

/// Encodes a program.
///
/// # Errors
/// The first thing in it, in the order of the tape, for which it is refused.
pub(super) fn encode(data: &[u8], start: &Start, rules: &Rules) -> Result<Tape, Fault> {
    if start.is_out_of_range() {
        return Err(bad_job(file::FIELD));
    }
    let program = file::read(data, rules);
    let selected = select::select(&program, start, rules);
    let mut tape = Encoder::new(rules);
    let adds_end = rules.percent && !program.is_closed;
    if let Some(line) = &program.percent_line {
        tape.characters(&line.characters)?;
        if line.has_eob || adds_end {
            tape.end_percent_line();
        }
    } else if rules.percent {
        tape.put(b'%');
        tape.end_percent_line();
    }
    // A preamble is sent behind the line with the program number also where nothing else
    // follows.
    let has_preamble = start.has_preamble() && selected.goes_on;
    for block in &selected.lead {
        tape.block(&block.characters)?;
        tape.end_block(block.has_eob || adds_end || has_preamble);
    }
    // Which of two faults counts the page does not say: here as they stand on the tape.
    if selected.goes_on {
        tape.preamble(start.preamble.as_deref().unwrap_or_default())?;
    }
    for block in selected.rest.iter().flatten() {
        tape.block(&block.characters)?;
        tape.end_block(block.has_eob || adds_end);
    }
    if let Some(fault) = program.behind {
        return Err(fault);
    }
    if selected.rest.is_none() {
        return Err(Fault { failure: Failure::NotFound, status: 0, line: 0, column: 0 });
    }
    if program.is_closed || rules.percent {
        tape.put(b'%');
    }
    Ok(tape.finish())
}

fn bad_job(status: u16) -> Fault {
    Fault { failure: Failure::BadJob, status, line: 0, column: 0 }
}

/// Writes blocks.
#[derive(Clone, Debug)]
struct Encoder<'a> {
    rules: &'a Rules,
    bytes: Vec<u8>,
    is_in_comment: bool,
    /// Characters of the block that count for TV.
    count: usize,
    /// The last number that was made new.
    number: u64,
}

impl<'a> Encoder<'a> {
    fn new(rules: &'a Rules) -> Self {
        let bytes = vec![0; rules.leader];
        Self { rules, bytes, is_in_comment: false, count: 0, number: 0 }
    }

    fn finish(mut self) -> Tape {
        let closed = self.bytes.len();
        self.bytes.extend(vec![0; self.rules.trailer]);
        Tape { bytes: self.bytes, closed }
    }

    /// Blocks of the host, with N numbers like those of the program.
    fn preamble(&mut self, text: &[u8]) -> Result<(), Fault> {
        if text.is_empty() {
            return Ok(());
        }
        for line in file::lines(text, self.rules) {
            let has_percent = line.iter().any(|character| character.byte == b'%');
            if self.block(&line).is_err() || has_percent {
                return Err(bad_job(file::PREAMBLE));
            }
            self.end_block(true);
        }
        Ok(())
    }

    /// A block up to its EOB, with its N number as it is set.
    fn block(&mut self, characters: &[Character]) -> Result<(), Fault> {
        let number = match self.rules.block_numbers {
            BlockNumbers::Keep => None,
            BlockNumbers::Strip | BlockNumbers::Renumber => {
                select::number_at(characters, self.rules)
            }
        };
        let Some(number) = number else { return self.characters(characters) };
        self.characters(&characters[..number.start])?;
        let mut behind = &characters[number.end..];
        if self.rules.block_numbers == BlockNumbers::Renumber {
            let next = self.number + self.rules.number_step;
            self.number = if next > 99_999 { self.rules.number_step } else { next };
            let new = format!("N{}", self.number);
            new.bytes().for_each(|byte| self.put(byte));
        } else {
            // Spaces behind a number are left out with it; the page does not say so.
            while let [Character { byte: b' ', .. }, rest @ ..] = behind {
                behind = rest;
            }
        }
        self.characters(behind)
    }

    fn characters(&mut self, characters: &[Character]) -> Result<(), Fault> {
        for (at, character) in characters.iter().enumerate() {
            let byte = character.byte;
            let stands_in_comment = self.is_in_comment && byte != b')';
            let is_percent = byte == b'%' && self.is_in_comment;
            let byte = if self.rules.upper { byte.to_ascii_uppercase() } else { byte };
            let sent = if is_percent { None } else { encoded(byte, self.rules) };
            let sent = match (sent, self.rules.unsupported) {
                (Some(sent), _) => Some(sent),
                (None, Unsupported::Refuse) => {
                    let Character { line, column, .. } = characters[at];
                    let failure = Failure::UnsupportedCharacter;
                    return Err(Fault { failure, status: 0, line, column });
                }
                (None, Unsupported::Space) => encoded(b' ', self.rules),
                (None, Unsupported::Drop) => None,
            };
            if let Some(sent) = sent {
                self.bytes.push(sent);
                self.count += usize::from(self.rules.tv_comments || !stands_in_comment);
            }
            self.is_in_comment = comment_goes_on(self.is_in_comment, character.byte);
        }
        Ok(())
    }

    /// A character that every code has.
    fn put(&mut self, character: u8) {
        self.bytes.extend(encoded(character, self.rules));
        self.count += 1;
    }

    /// The `%` line is no block.
    fn end_percent_line(&mut self) {
        self.eob();
    }

    /// A block ends, with its EOB or without.
    fn end_block(&mut self, has_eob: bool) {
        let before = match self.rules.code {
            Code::Iso => self.rules.eob.iter().take_while(|byte| **byte == b'\r').count(),
            Code::Eia => 0,
        };
        // A CR alone is the EOB itself.
        let is_cr = self.rules.code == Code::Iso && self.rules.eob == b"\r";
        let counted = if is_cr { 1 } else { 1 + if self.rules.tv_cr { before } else { 0 } };
        if self.rules.tv_pad && has_eob && (self.count + counted) % 2 == 1 {
            self.put(b' ');
        }
        if has_eob {
            self.eob();
        }
    }

    fn eob(&mut self) {
        self.bytes.extend(eob(self.rules));
        self.is_in_comment = false;
        // CRs behind LF stand in the next block.
        let behind = match self.rules.code {
            Code::Iso => self.rules.eob.iter().skip_while(|byte| **byte != b'\n').skip(1).count(),
            Code::Eia => 0,
        };
        self.count = if self.rules.tv_cr { behind } else { 0 };
    }
}
