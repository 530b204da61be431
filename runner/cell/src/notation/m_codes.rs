//! Waiting M codes, as on controls with several paths: `M101 P12` waits in paths 1 and 2.

use std::ops::RangeInclusive;

use super::bad_word::BadWord;
use super::{Names, Read, without_number};
use crate::word::Word;

pub(super) fn words(text: &str, codes: RangeInclusive<u32>, names: Names<'_>) -> Read<Vec<Word>> {
    let block: String = without_number(text).split_whitespace().collect();
    let Some(codes) = addresses(&block).map(|addresses| {
        let is_wait = |(letter, value): &(char, &str)| {
            let whole = value.split('.').next().unwrap_or_default();
            *letter == 'M' && whole.parse().is_ok_and(|code| codes.contains(&code))
        };
        let waits = addresses.iter().any(is_wait);
        if waits { addresses } else { Vec::new() }
    }) else {
        return Ok(Vec::new());
    };
    match codes[..] {
        [] => Ok(Vec::new()),
        [('M', mark)] => Ok(vec![names.meeting(mark, std::iter::empty())?]),
        [('M', mark), ('P', paths)] | [('P', paths), ('M', mark)] if !paths.is_empty() => {
            let digits = paths.char_indices().map(|(at, _)| &paths[at..=at]);
            Ok(vec![names.meeting(mark, digits)?])
        }
        _ => Err(BadWord::MCode(text.trim().to_owned())),
    }
}

/// Letters, each with its value; none where the block is something else.
fn addresses(block: &str) -> Option<Vec<(char, &str)>> {
    let mut addresses = Vec::new();
    let mut rest = block;
    while let Some(letter) = rest.chars().next() {
        if !letter.is_ascii_alphabetic() {
            return None;
        }
        let value = &rest[1..];
        let end =
            value.find(|c: char| !c.is_ascii_digit() && !"+-.".contains(c)).unwrap_or(value.len());
        addresses.push((letter.to_ascii_uppercase(), &value[..end]));
        rest = &value[end..];
    }
    Some(addresses)
}
