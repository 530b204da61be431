//! `WAI 10 LATHE-1 LATHE-2`, `LAD LATHE-2 O1234`, `EXE LATHE-2`.

use super::bad_word::BadWord;
use super::{Names, Read, program_name, without_number};
use crate::word::Word;

const VERBS: [&str; 3] = ["WAI", "LAD", "EXE"];

pub(super) fn words(text: &str, names: Names<'_>) -> Read<Vec<Word>> {
    let parts: Vec<&str> = without_number(text)
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|part| !part.is_empty())
        .collect();
    let verb = parts.first().map(|verb| verb.to_ascii_uppercase()).unwrap_or_default();
    let word = match (&*verb, &parts[parts.len().min(1)..]) {
        ("WAI", [mark, with @ ..]) => names.meeting(mark, with.iter().copied())?,
        ("LAD", [channel, program]) => {
            Word::Load { channel: names.channel(channel)?, program: program_name(program)? }
        }
        ("EXE", [channel]) => names.start(channel)?,
        ("WAI" | "LAD" | "EXE", _) => {
            return Err(BadWord::Wai(text.trim().to_owned()));
        }
        _ => {
            let is_verb = |part: &&&str| {
                let part = part.to_ascii_uppercase();
                let mut rests = VERBS.iter().filter_map(|verb| part.strip_prefix(verb));
                rests.any(|rest| rest.bytes().all(|byte| byte.is_ascii_digit()))
            };
            return match parts.iter().find(is_verb) {
                Some(part) => Err(BadWord::WaiAmongOthers((*part).to_owned())),
                None => Ok(Vec::new()),
            };
        }
    };
    Ok(vec![word])
}
