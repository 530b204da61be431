//! `WAITM(10,1,2)`, `INIT(2,"O1234")`, `START(2)`, `GET(C2)`, `GETD(C2)`, `RELEASE(C2)`: the names
//! and arguments are those of SINUMERIK 840D, "Job Planning", programme coordination and axis
//! replacement.

use super::bad_word::BadWord;
use super::{Names, Read, program_name, without_number};
use crate::word::Word;

const VERBS: [&str; 6] = ["WAITM", "INIT", "START", "GET", "GETD", "RELEASE"];
/// Of the same chapter, and without a meaning here.
const UNKNOWN: [&str; 5] = ["WAITMC", "WAITE", "SETM", "CLEARM", "AXTOCHAN"];

pub(super) fn words(text: &str, names: Names<'_>) -> Read<Vec<Word>> {
    let block = without_number(text).trim_end();
    let Some((verb, rest)) = block.split_once('(') else {
        // Behind a blank a bracket is a comment's.
        let is_verb =
            |word: &&&str| block.split_whitespace().any(|part| part.eq_ignore_ascii_case(word));
        return VERBS.iter().find(is_verb).map_or(Ok(Vec::new()), |verb| Err(alone(verb)));
    };
    let verb = verb.trim().to_ascii_uppercase();
    if UNKNOWN.contains(&&*verb) {
        let known = VERBS.join(", ");
        return Err(BadWord::SiemensUnknown { verb, known });
    }
    if !VERBS.contains(&&*verb) {
        return match VERBS.iter().find(|known| verb.ends_with(**known)) {
            Some(known) if verb.contains(' ') => Err(alone(known)),
            _ => Ok(Vec::new()),
        };
    }
    let Some((arguments, "")) = rest.split_once(')').map(|(inside, after)| (inside, after.trim()))
    else {
        return Err(alone(&verb));
    };
    let arguments: Vec<&str> = arguments.split(',').map(str::trim).collect();
    match (&*verb, &arguments[..]) {
        ("WAITM", [mark, with @ ..]) if !with.is_empty() => {
            Ok(vec![names.meeting(mark, with.iter().copied())?])
        }
        // The third says whether the channel waits for an answer: it always does.
        ("INIT", [channel, program] | [channel, program, _]) => {
            let channel = names.channel(unquoted(channel))?;
            Ok(vec![Word::Load { channel, program: program_name(program)? }])
        }
        ("START", channels) => {
            channels.iter().map(|channel| names.start(unquoted(channel))).collect()
        }
        ("GET" | "GETD", axes) => {
            let forced = verb == "GETD";
            axes.iter().map(|axis| Ok(Word::Get { axis: names.axis(axis)?, forced })).collect()
        }
        ("RELEASE", axes) => {
            axes.iter().map(|axis| Ok(Word::Release { axis: names.axis(axis)? })).collect()
        }
        _ => Err(BadWord::Siemens(block.to_owned())),
    }
}

fn unquoted(text: &str) -> &str {
    text.trim_matches('"')
}

fn alone(verb: &str) -> BadWord {
    BadWord::SiemensAmongOthers(verb.to_owned())
}
