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
    from_line: Option<u32>,
    from_sequence: Option<u64>,
    preamble: Option<String>,
    /// Any of them is given.
    is_asked: bool,
}

impl Restart {
    /// # Errors
    /// A field is out of its range.
    pub(super) fn new(fields: &[(String, String)]) -> Result<Self, Refused> {
        let mut restart = Self::default();
        let bad = Refused::without_place(Failure::BadJob, 1, "fanuc-rs232.feed.from-block");
        let is_asked = |(name, value): &(String, String)| name != "preamble" || !value.is_empty();
        restart.is_asked = fields.iter().any(is_asked);
        for (name, value) in fields {
            // The page names no largest number.
            let number = value.parse::<u32>().ok().filter(|number| *number < u32::MAX);
            match name.as_str() {
                "from_block" => match number {
                    Some(block @ 1..) => restart.from_block = Some(block as usize),
                    _ => return Err(bad),
                },
                "from_line" => match number {
                    Some(line @ 1..) => restart.from_line = Some(line),
                    _ => return Err(bad),
                },
                "from_sequence" => match number {
                    Some(number) => restart.from_sequence = Some(u64::from(number)),
                    None => return Err(bad),
                },
                "preamble" => restart.preamble = Some(value.clone()),
                _ => {}
            }
        }
        Ok(restart)
    }

    /// Blocks that are sent before the one that is begun at, encoded like the program.
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
        if !self.is_asked {
            return Found { kept: 0, from: Some(0), has_others: false, clause: "" };
        }
        let kept = usize::from(blocks.first().is_some_and(has_program_number));
        let first = match self.from_line {
            Some(line) => blocks.iter().take_while(|block| block.begins_at < line).count(),
            None => self.from_block.unwrap_or(1) - 1,
        };
        let fits = |at: &usize| {
            let number = blocks.get(*at).and_then(numbers::value);
            let is_number = self.from_sequence.is_none() || self.from_sequence == number;
            *at >= first && is_number
        };
        let clause = match self.from_sequence {
            Some(_) => "fanuc-rs232.feed.from-sequence",
            None => "fanuc-rs232.feed.from-block",
        };
        let from = (0..blocks.len()).find(fits);
        let has_others = blocks.len() > kept || from.is_some();
        Found { kept, from, has_others, clause }
    }
}

/// Its program number begins a block.
fn has_program_number(block: &Line) -> bool {
    block.refused_at != Some(0) && matches!(block.characters.first(), Some(b'O' | b':'))
}

/// What is sent of a program.
#[derive(Clone, Debug)]
pub(super) struct Found {
    /// Blocks at the start that are sent in any case.
    kept: usize,
    /// The block that is begun at.
    from: Option<usize>,
    /// There are others, or it is the block that is begun at.
    has_others: bool,
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

    /// Whether there are others: where one comes the preamble is looked at.
    pub(super) fn has_others(&self) -> bool {
        self.has_others
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
