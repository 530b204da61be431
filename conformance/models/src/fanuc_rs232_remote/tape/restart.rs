//! A program is sent from its middle.

use super::characters::{Symbol, read};
use super::lines::{Line, Program};
use super::numbers;
use super::rules::{Refused, TapeRules};
use softplug_abi::Failure;

/// Fields of a job.
#[derive(Clone, Debug, Default)]
pub(super) struct Restart {
    from_block: Option<usize>,
    from_sequence: Option<u64>,
    preamble: Option<String>,
}

impl Restart {
    /// # Errors
    /// A field is out of its range.
    pub(super) fn new(fields: &[(String, String)]) -> Result<Self, Refused> {
        let mut restart = Self::default();
        let bad = Refused::without_place(Failure::BadJob, 1, "fanuc-rs232.feed.from-block");
        for (name, value) in fields {
            // The page names no largest number.
            let number = value.parse::<u32>();
            match name.as_str() {
                "from_block" => match number {
                    Ok(block @ 1..) => restart.from_block = Some(block as usize),
                    _ => return Err(bad),
                },
                "from_sequence" => match number {
                    Ok(number) => restart.from_sequence = Some(u64::from(number)),
                    Err(_) => return Err(bad),
                },
                "preamble" if !value.is_empty() => restart.preamble = Some(value.clone()),
                _ => {}
            }
        }
        Ok(restart)
    }

    /// Blocks that are sent before the one that is begun at, encoded like the program but
    /// for N numbers, which stay.
    ///
    /// # Errors
    /// It cannot be sent.
    pub(super) fn preamble(&self, rules: &TapeRules) -> Result<Vec<Line>, Refused> {
        let Some(preamble) = &self.preamble else { return Ok(Vec::new()) };
        let mut lines = vec![Line::new()];
        let mut has_percent = false;
        for (symbol, place) in read(rules, preamble.as_bytes()) {
            let Some(line) = lines.last_mut() else { break };
            match symbol {
                Symbol::Eob => {
                    line.has_eob = true;
                    lines.push(Line::new());
                }
                Symbol::Character(character) => {
                    has_percent |= character == b'%';
                    line.push(rules, character, false, place);
                }
            }
        }
        let is_bad = |line: &Line| line.fault().is_some();
        if has_percent || lines.iter().any(is_bad) {
            let clause = "fanuc-rs232.feed.preamble";
            return Err(Refused::without_place(Failure::BadJob, 2, clause));
        }
        // One EOB behind it, whether it brings it or not.
        match lines.last_mut() {
            Some(line) if line.is_blank() => drop(lines.pop()),
            Some(line) => line.has_eob = true,
            None => {}
        }
        Ok(lines)
    }

    /// Which blocks are sent.
    pub(super) fn find(&self, program: &Program) -> Found {
        let blocks = &program.blocks;
        if self.from_block.is_none() && self.from_sequence.is_none() && self.preamble.is_none() {
            return Found { kept: 0, from: Some(0), clause: "" };
        }
        let blanks = |from: usize| {
            let rest = blocks.get(from..).unwrap_or_default();
            rest.iter().take_while(|block| block.is_blank() && block.has_eob).count()
        };
        // Plug-in differs: blank lines behind the `%` line and behind the one with the
        // program number are sent, too, and that one is the first that is not blank.
        let mut kept = blanks(0);
        if blocks.get(kept).is_some_and(has_program_number) {
            kept += 1;
            if blocks[kept - 1].has_eob {
                kept += blanks(kept);
            }
        }
        let first = self.from_block.unwrap_or(1) - 1;
        // Plug-in differs: a block is not there if nothing but EOBs follows, or if it is the
        // line with the program number alone.
        let has_text = |from: usize| {
            let rest = blocks.get(from.max(kept)..).unwrap_or_default();
            rest.iter().any(|block| !block.is_blank())
        };
        let fits = |at: &usize| match self.from_sequence {
            None => *at >= first && has_text(*at),
            // Plug-in differs: not in a block that ends with the closing `%` directly behind
            // the number.
            Some(number) => {
                *at >= first
                    && numbers::value(&blocks[*at]) == Some(number)
                    && !is_number_alone(&blocks[*at], program)
            }
        };
        let clause = match self.from_sequence {
            Some(_) => "fanuc-rs232.feed.from-sequence",
            None => "fanuc-rs232.feed.from-block",
        };
        Found { kept, from: (0..blocks.len()).find(fits), clause }
    }
}

/// Its program number begins a block.
fn has_program_number(block: &Line) -> bool {
    block.refused_at != Some(0) && matches!(block.characters.first(), Some(b'O' | b':'))
}

fn is_number_alone(block: &Line, program: &Program) -> bool {
    let end = numbers::place(&block.characters).map(|number| number.end);
    program.is_closed && !block.has_eob && end == Some(block.characters.len())
}

/// What is sent of a program.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Blocks at the start that are sent in any case.
    kept: usize,
    /// The block that is begun at.
    from: Option<usize>,
    clause: &'static str,
}

impl Found {
    pub(super) fn keeps(&self, place: usize) -> bool {
        place < self.kept || self.from.is_some_and(|from| place >= from)
    }

    /// Blocks that are sent before the preamble.
    pub(super) fn kept_before(&self) -> usize {
        self.kept
    }

    /// # Errors
    /// There is no such block.
    pub(super) fn check(&self) -> Result<(), Refused> {
        match self.from {
            None if !self.clause.is_empty() => {
                Err(Refused::without_place(Failure::NotFound, 0, self.clause))
            }
            _ => Ok(()),
        }
    }
}
