//! Bytes as printable characters, and back.

use super::agree::Agreed;

/// Bytes as characters, as far as they fit: the characters, and how many bytes they stand for.
/// We use # as the prefix of control characters.
pub(super) fn encode(bytes: &[u8], agreed: &Agreed, room: usize) -> (Vec<u8>, usize) {
    let mut characters = Vec::new();
    let mut used = 0;
    while used < bytes.len() {
        let byte = bytes[used];
        let run = bytes[used..].iter().take(94).take_while(|other| **other == byte).count();
        let single = one(byte, agreed);
        let (unit, taken) = match agreed.repeat {
            Some(prefix) if run * single.len() > single.len() + 2 => {
                ([&[prefix, run as u8 + 32], &single[..]].concat(), run)
            }
            _ => (single, 1),
        };
        if characters.len() + unit.len() > room {
            break;
        }
        characters.extend(unit);
        used += taken;
    }
    (characters, used)
}

/// One byte.
fn one(byte: u8, agreed: &Agreed) -> Vec<u8> {
    let mut unit = Vec::new();
    let mut rest = byte;
    if let Some(prefix) = agreed.eighth
        && byte > 127
    {
        unit.push(prefix);
        rest = byte - 128;
    }
    let low = byte % 128;
    if low < 32 || low == 127 {
        unit.extend([b'#', rest ^ 64]);
    } else if low == b'#' || Some(low) == agreed.eighth || Some(low) == agreed.repeat {
        unit.extend([b'#', rest]);
    } else {
        unit.push(rest);
    }
    unit
}

/// The bytes that characters stand for, up to where they stand for none; and whether that is
/// the end.
pub(super) fn decode(characters: &[u8], agreed: &Agreed) -> (Vec<u8>, bool) {
    let mut bytes = Vec::new();
    let mut rest = characters;
    while !rest.is_empty() {
        let Some((byte, count, behind)) = next(rest, agreed) else { return (bytes, false) };
        bytes.extend(vec![byte; count]);
        rest = behind;
    }
    (bytes, true)
}

fn next<'a>(characters: &'a [u8], agreed: &Agreed) -> Option<(u8, usize, &'a [u8])> {
    let (mut first, mut rest) = characters.split_first()?;
    let mut count = 1;
    if Some(*first) == agreed.repeat {
        let (own, behind) = rest.split_first()?;
        count = usize::from((*own).max(32) - 32);
        if count == 0 || count > 94 {
            return None;
        }
        (first, rest) = behind.split_first()?;
    }
    let mut high = 0;
    if Some(*first) == agreed.eighth {
        high = 128;
        (first, rest) = rest.split_first()?;
    }
    let mut byte = *first;
    if byte == agreed.their_quote {
        (first, rest) = rest.split_first()?;
        byte = if (63..=95).contains(&(first % 128)) { first ^ 64 } else { *first };
    }
    Some((byte | high, count, rest))
}

/// What a file is called by its name.
pub(super) fn title(characters: &[u8], agreed: &Agreed) -> String {
    let (name, _) = decode(characters, agreed);
    let last = name.rsplit(|byte| b"/\\:".contains(byte)).next().unwrap_or_default();
    let kept = last.iter().filter(|byte| (32..127).contains(*byte));
    kept.take(94).map(|byte| char::from(*byte)).collect()
}
