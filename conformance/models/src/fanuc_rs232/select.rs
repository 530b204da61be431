//! Where a job begins in its program.

use super::code::encoded;
use super::file::{Block, Character, Program};
use super::rules::Rules;

/// Fields of a job.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub(super) struct Start {
    pub(super) from_block: Option<i64>,
    pub(super) from_line: Option<i64>,
    pub(super) from_sequence: Option<i64>,
    pub(super) preamble: Option<Vec<u8>>,
}

/// The largest block and N number; the page names no range.
const LARGEST: i64 = u32::MAX as i64 - 1;

impl Start {
    /// Fields as the host gives them.
    pub(super) fn new(fields: &[(String, String)]) -> Self {
        let field = |name: &str| fields.iter().find(|(known, _)| known == name);
        let number = |name| field(name).and_then(|(_, value)| value.parse().ok());
        let preamble = field("preamble").map(|(_, text)| text.clone().into_bytes());
        Self {
            from_block: number("from_block"),
            from_line: number("from_line"),
            from_sequence: number("from_sequence"),
            preamble,
        }
    }

    /// Text stands before the block.
    pub(super) fn has_preamble(&self) -> bool {
        self.preamble.as_ref().is_some_and(|text| !text.is_empty())
    }

    /// The job begins with its program.
    fn is_plain(&self) -> bool {
        let is_asked =
            [self.from_block, self.from_line, self.from_sequence].iter().any(Option::is_some);
        !is_asked && !self.has_preamble()
    }

    /// A field is out of its range.
    pub(super) fn is_out_of_range(&self) -> bool {
        let within = |value: Option<i64>, first| {
            value.is_none_or(|value| (first..=LARGEST).contains(&value))
        };
        !within(self.from_block, 1) || !within(self.from_line, 1) || !within(self.from_sequence, 0)
    }
}

/// What leaves of a program's blocks.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(super) struct Selected {
    /// Before the preamble.
    pub(super) lead: Vec<Block>,
    /// There are blocks behind these, or the last of these is the one to begin at.
    pub(super) goes_on: bool,
    /// Behind it; `None`: the block to begin at is not there.
    pub(super) rest: Option<Vec<Block>>,
}

/// Finds the block to begin at.
pub(super) fn select(program: &Program, start: &Start, rules: &Rules) -> Selected {
    let blocks = &program.blocks;
    if start.is_plain() {
        return Selected { lead: Vec::new(), goes_on: true, rest: Some(blocks.clone()) };
    }
    // The line with the program number goes along, if it is block 1.
    let lead = usize::from(blocks.first().is_some_and(|block| has_program_number(block, rules)));
    let first = match start.from_line {
        Some(line) => blocks.iter().take_while(|block| i64::from(block.line) < line).count(),
        None => start.from_block.map_or(0, |block| usize::try_from(block - 1).unwrap_or(0)),
    };
    let is_lead_wanted = lead == 1 && start.from_sequence.is_none() && first == 0;
    let first = first.max(lead);
    // With both fields: the first with this number from that block on. The page does not
    // say so.
    let is_wanted = |block: &Block| match start.from_sequence {
        Some(wanted) => sequence_number(block, rules) == u64::try_from(wanted).ok(),
        None => true,
    };
    let mut candidates = blocks.iter().enumerate().skip(first);
    let found = candidates.find(|(_, block)| is_wanted(block));
    let found = found.map(|(at, _)| at).or_else(|| is_lead_wanted.then_some(lead));
    let rest = found.map(|found| blocks[found..].to_vec());
    Selected { lead: blocks[..lead].to_vec(), goes_on: lead < blocks.len() || is_lead_wanted, rest }
}

/// A block that begins with O or `:`, if the code has it.
fn has_program_number(block: &Block, rules: &Rules) -> bool {
    let is_number = |byte| [b'O', b':'].contains(&byte) && encoded(byte, rules).is_some();
    block.characters.first().is_some_and(|first| is_number(capital(first.byte, rules)))
}

/// A block's N number. `None`: it has none, or one that is too large.
fn sequence_number(block: &Block, rules: &Rules) -> Option<u64> {
    let number = number_at(&block.characters, rules)?;
    let digits = &block.characters[number.start + 1..number.end];
    let digits: String = digits.iter().map(|digit| char::from(digit.byte)).collect();
    digits.parse().ok()
}

/// A block's number ends within so many characters of the block.
const LONGEST_PREFIX: usize = 13;

/// Where a block's N number stands: from its N to behind its last digit. It stands at
/// the start, also behind `/`. Spaces before it, and a digit behind `/` that names a
/// switch, are passed over; the page does not say so.
pub(super) fn number_at(characters: &[Character], rules: &Rules) -> Option<std::ops::Range<usize>> {
    let byte = |at: usize| characters.get(at).map(|character| character.byte);
    let is_digit = |at: usize| byte(at).is_some_and(|byte| byte.is_ascii_digit());
    let mut start = 0;
    while let Some(b' ' | b'/') = byte(start) {
        start += if byte(start) == Some(b'/') && is_digit(start + 1) { 2 } else { 1 };
    }
    let is_n = byte(start).is_some_and(|byte| capital(byte, rules) == b'N');
    let mut end = start + 1;
    while is_digit(end) {
        end += 1;
    }
    let digits = characters.get(start + 1..end).unwrap_or_default();
    let digits: String = digits.iter().map(|digit| char::from(digit.byte)).collect();
    let is_number = digits.parse().is_ok_and(|number: i64| number <= LARGEST);
    (is_n && is_number && end <= LONGEST_PREFIX).then_some(start..end)
}

fn capital(byte: u8, rules: &Rules) -> u8 {
    if rules.upper { byte.to_ascii_uppercase() } else { byte }
}
