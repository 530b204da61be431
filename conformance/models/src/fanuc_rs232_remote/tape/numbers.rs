//! N numbers at the start of a block.

use super::lines::Line;
use super::rules::{BlockNumbers, TapeRules};
use std::ops::Range;

/// Where a block's N number stands, N included: behind blanks and slashes, each of these
/// with one digit at most.
fn place(characters: &[u8]) -> Option<Range<usize>> {
    let at = start(characters);
    let [b'N', b'0'..=b'9', ..] = &characters[at..] else { return None };
    let digits = characters[at + 1..].iter().take_while(|digit| digit.is_ascii_digit());
    let end = at + 1 + digits.count();
    let text = std::str::from_utf8(&characters[at + 1..end]).ok()?;
    // It ends within 13 characters, and is not too large.
    let is_number = end <= 13 && text.parse().is_ok_and(|number: u64| number < 0xFFFF_FFFF);
    is_number.then_some(at..end)
}

/// Behind blanks and slashes.
fn start(characters: &[u8]) -> usize {
    let mut at = 0;
    loop {
        match characters.get(at..).unwrap_or_default() {
            [b'/', b'0'..=b'9', ..] => at += 2,
            [b' ' | b'/', ..] => at += 1,
            _ => return at,
        }
    }
}

/// The number of a block, if it has one that is not too large.
pub(super) fn value(line: &Line) -> Option<u64> {
    // A character that cannot be sent is no part of a number, and none stands before one.
    let end = line.refused_at.unwrap_or(line.characters.len());
    let known = &line.characters[..end];
    let number = place(known)?;
    let text = std::str::from_utf8(&known[number.start + 1..number.end]).ok()?;
    text.parse().ok()
}

/// Kept, left out, or made new where there were some.
pub(super) fn rewrite(rules: &TapeRules, mut blocks: Vec<Line>) -> Vec<Line> {
    let mut number = 0;
    for block in &mut blocks {
        let Some(mut place) = place(&block.characters) else { continue };
        let new = match rules.block_numbers {
            BlockNumbers::Keep => continue,
            BlockNumbers::Strip => {
                // The page does not say it: with them go the spaces behind them.
                let behind = &block.characters[place.end..];
                place.end += behind.iter().take_while(|behind| **behind == b' ').count();
                String::new()
            }
            BlockNumbers::Renumber => {
                number += rules.number_step;
                if number > 99_999 {
                    number = rules.number_step;
                }
                format!("N{number}")
            }
        };
        block.characters.splice(place, new.bytes());
    }
    blocks
}
