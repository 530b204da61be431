//! `(SOFTPLUG WAIT 10 LATHE-1 LATHE-2)`, or behind a semicolon.

use super::bad_word::BadWord;
use super::{Names, Read, program_name};
use crate::word::Word;

const NAME: &str = "SOFTPLUG";

/// All words in the comments of a block.
pub(super) fn words(text: &str, names: Names<'_>) -> Read<Vec<Word>> {
    let mut words = Vec::new();
    let mut rest = text;
    while let Some(begin) = rest.find(['(', ';']) {
        let is_bracket = rest[begin..].starts_with('(');
        let inside = &rest[begin + 1..];
        let end = if is_bracket { inside.find(')') } else { None };
        let comment = &inside[..end.unwrap_or(inside.len())];
        let mut parts = comment.split_whitespace();
        let first = parts.next().unwrap_or_default().to_ascii_uppercase();
        if first.starts_with(NAME) {
            let parts: Vec<&str> = if first == NAME { parts.collect() } else { Vec::new() };
            words.push(word(comment, &parts, names)?);
        }
        // One comment may stand in another.
        rest = inside;
    }
    Ok(words)
}

fn word(comment: &str, parts: &[&str], names: Names<'_>) -> Read<Word> {
    let verb = parts.first().map(|verb| verb.to_ascii_uppercase()).unwrap_or_default();
    match (&*verb, &parts[parts.len().min(1)..]) {
        ("WAIT", [mark, with @ ..]) => names.meeting(mark, with.iter().copied()),
        ("LOAD", [channel, program]) => {
            Ok(Word::Load { channel: names.channel(channel)?, program: program_name(program)? })
        }
        ("START", [channel]) => names.start(channel),
        ("GET", [axis]) => Ok(Word::Get { axis: names.axis(axis)?, forced: false }),
        ("TAKE", [axis]) => Ok(Word::Get { axis: names.axis(axis)?, forced: true }),
        ("RELEASE", [axis]) => Ok(Word::Release { axis: names.axis(axis)? }),
        _ => Err(BadWord::Comment(comment.trim().to_owned())),
    }
}
