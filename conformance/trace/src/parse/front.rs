//! The front matter: `key: value` lines, each key once, in any order.

use nom::Parser;
use nom::branch::alt;
use nom::bytes::complete::{tag, take_while, take_while1};
use nom::character::complete::{char, digit1, one_of};
use nom::combinator::{recognize, value};
use nom::multi::separated_list1;
use softplug_abi::Parity;

use super::entry::room;
use super::lex::{
    Fault, Parsed, assignments, choice, close, demand, digits, expected, fail, number, slug,
    unknown,
};
use super::payload::levels;
use crate::error::ParseErrorKind;
use crate::limits::{LINE_BYTES, NAME_BYTES, TITLE_CHARACTERS};
use crate::model::{
    ByteClass, Edge, FrontMatter, Level, LineSettings, ModemLevels, ModemLine, Origin,
    Permutations, Room,
};

/// The keys, in canonical order.
const KEYS: &[&str] = &[
    "id", "title", "profile", "clauses", "level", "edge", "line", "config", "room", "modem",
    "since", "origin", "permute", "leaves", "bytes",
];
const SLUG: &str = "a slug: lower-case letters, digits and inner hyphens, parts joined by dots";

/// The front matter as far as it was read.
#[derive(Default)]
pub(super) struct Front {
    seen: Vec<&'static str>,
    id: Option<String>,
    /// Where the id stands: line, source, bytes left.
    id_at: Option<(u32, String, usize)>,
    title: Option<String>,
    profile: Option<String>,
    clauses: Option<Vec<String>>,
    level: Option<Level>,
    edge: Option<Edge>,
    line: Option<LineSettings>,
    config: Vec<crate::Assignment>,
    room: Room,
    modem: ModemLevels,
    since: Option<u32>,
    origin: Option<Origin>,
    permute: Permutations,
    leaves: String,
    bytes: Option<ByteClass>,
}

/// What is wrong with the front matter as a whole.
pub(super) enum Incomplete {
    Missing(&'static str),
    ForeignId { line: u32, source: String, rest: usize, profile: String },
}

impl Front {
    /// Reads a line.
    pub(super) fn read(&mut self, line: &str, number: u32) -> Result<(), Fault> {
        match self.key(line, number) {
            Ok(("", ())) => Ok(()),
            Ok((rest, ())) => Err(Fault {
                rest: rest.len(),
                kind: ParseErrorKind::Expected("the end of the line"),
            }),
            Err(nom::Err::Failure(fault) | nom::Err::Error(fault)) => Err(fault),
            Err(nom::Err::Incomplete(_)) => unreachable!("complete parsers never ask for more"),
        }
    }

    fn key<'a>(&mut self, line: &'a str, line_number: u32) -> Parsed<'a, ()> {
        const LIKE: &str = "`key: value`, or a line `---` before the first event";
        let (colon_at, word) =
            demand(LIKE, take_while1(|c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-'))
                .parse(line)?;
        let Some(after) = colon_at.strip_prefix(':') else {
            return expected(colon_at, "a colon after the key");
        };
        let Some(key) = KEYS.iter().copied().find(|key| *key == word) else {
            return fail(line, unknown("a key", word, KEYS.iter().copied()));
        };
        if self.seen.contains(&key) {
            return fail(line, ParseErrorKind::Twice { what: "the key", name: key.to_owned() });
        }
        self.seen.push(key);
        let input = super::lex::skip_space(after);
        if input.is_empty() {
            return expected(input, "a value after the colon");
        }
        match key {
            "id" => {
                let (rest, id) = slug(SLUG, input)?;
                self.id = Some(id.to_owned());
                self.id_at = Some((line_number, line.to_owned(), input.len()));
                Ok((rest, ()))
            }
            "title" => {
                if input.chars().count() > TITLE_CHARACTERS {
                    let (what, high) = ("the characters of a title", TITLE_CHARACTERS as u64);
                    return fail(input, ParseErrorKind::OutOfRange { what, low: 1, high });
                }
                self.title = Some(input.to_owned());
                Ok(("", ()))
            }
            "profile" => {
                let (rest, profile) = slug(SLUG, input)?;
                self.profile = Some(profile.to_owned());
                Ok((rest, ()))
            }
            "clauses" => {
                let (rest, clauses) = clauses(input)?;
                self.clauses = Some(clauses);
                Ok((rest, ()))
            }
            "level" => {
                let table =
                    [Level::Must, Level::Should, Level::May].map(|level| (level.name(), level));
                store(&mut self.level, choice("a level", &table, input))
            }
            "edge" => {
                let table = [Edge::Before, Edge::After].map(|edge| (edge.name(), edge));
                store(&mut self.edge, choice("an edge", &table, input))
            }
            "line" => store(&mut self.line, line_settings(input)),
            "config" => {
                let (rest, config) = assignments(input, |_| true)?;
                if crate::format::assignments(&config).len() + "config: ".len() > LINE_BYTES {
                    return fail(input, ParseErrorKind::LineTooLong);
                }
                self.config = config;
                Ok((rest, ()))
            }
            "room" => {
                let (rest, room) = room(input, 0)?;
                self.room = room;
                Ok((rest, ()))
            }
            "modem" => {
                let (rest, modem) = levels(input, ModemLine::INPUTS)?;
                self.modem = modem;
                Ok((rest, ()))
            }
            "since" => {
                let (rest, since) = number("a revision", 1, u64::from(u32::MAX), input)?;
                self.since = Some(since as u32);
                Ok((rest, ()))
            }
            "origin" => store(&mut self.origin, origin(input)),
            "leaves" => {
                if input.chars().count() > TITLE_CHARACTERS {
                    let (what, high) = ("the characters of what is left", TITLE_CHARACTERS as u64);
                    return fail(input, ParseErrorKind::OutOfRange { what, low: 1, high });
                }
                input.clone_into(&mut self.leaves);
                Ok(("", ()))
            }
            "bytes" => store(&mut self.bytes, byte_class(input)),
            _ => {
                let (rest, permute) = permute(input)?;
                self.permute = permute;
                Ok((rest, ()))
            }
        }
    }

    /// The whole front matter.
    pub(super) fn finish(self) -> Result<FrontMatter, Incomplete> {
        let missing = Incomplete::Missing;
        let front = FrontMatter {
            id: self.id.ok_or(missing("id"))?,
            title: self.title.ok_or(missing("title"))?,
            profile: self.profile.ok_or(missing("profile"))?,
            clauses: self.clauses.ok_or(missing("clauses"))?,
            level: self.level.ok_or(missing("level"))?,
            edge: self.edge,
            line: self.line.ok_or(missing("line"))?,
            config: self.config,
            room: self.room,
            modem: self.modem,
            since: self.since.ok_or(missing("since"))?,
            origin: self.origin.ok_or(missing("origin"))?,
            permute: self.permute,
            leaves: self.leaves,
            bytes: self.bytes,
        };
        let part =
            front.id.strip_prefix(front.profile.as_str()).and_then(|rest| rest.strip_prefix('.'));
        match self.id_at {
            Some((line, source, rest)) if part.is_none() => {
                Err(Incomplete::ForeignId { line, source, rest, profile: front.profile })
            }
            _ => Ok(front),
        }
    }
}

fn store<'a, T>(place: &mut Option<T>, parsed: Parsed<'a, T>) -> Parsed<'a, ()> {
    let (rest, value) = parsed?;
    *place = Some(value);
    Ok((rest, ()))
}

fn clauses(input: &str) -> Parsed<'_, Vec<String>> {
    let mut clauses = Vec::new();
    let mut seen = std::collections::BTreeSet::new();
    let mut input = input;
    while !input.is_empty() {
        let (rest, clause) = slug(SLUG, input)?;
        if !seen.insert(clause) {
            return fail(
                input,
                ParseErrorKind::Twice { what: "the clause", name: clause.to_owned() },
            );
        }
        clauses.push(clause.to_owned());
        input = rest;
    }
    Ok((input, clauses))
}

fn line_settings(input: &str) -> Parsed<'_, LineSettings> {
    const BITS: &str = "data bits, parity and stop bits like 8N1";
    let (rest, baud) = number("a baud rate", 0, u64::from(u32::MAX), input)?;
    let parity = alt((
        value(Parity::None, char('N')),
        value(Parity::Even, char('E')),
        value(Parity::Odd, char('O')),
        value(Parity::Mark, char('M')),
        value(Parity::Space, char('S')),
    ));
    let stop = alt((value(3, tag("1.5")), value(2, tag("1")), value(4, tag("2"))));
    let bits = (one_of("5678"), parity, stop);
    let (rest, (data, parity, stop_half_bits)) = demand(BITS, bits).parse(rest)?;
    let (rest, ()) = close(rest, ())?;
    let (rest, options) = super::lex::options(&["depth", "reaction"], rest)?;
    let settings = LineSettings {
        baud: baud as u32,
        data_bits: data as u8 - b'0',
        parity,
        stop_half_bits,
        depth: options.number32("depth", "a pacing depth", 1)?.unwrap_or(1),
        reaction: options.number32("reaction", "a reaction in µs", 0)?.unwrap_or(0),
    };
    Ok((rest, settings))
}

fn origin(input: &str) -> Parsed<'_, Origin> {
    const LIKE: &str =
        "hand-written, recorded(DEVICE, YYYY-MM-DD, TOOL) or generated(GENERATOR, SEED)";
    let part = |what: &'static str, input| -> Parsed<'_, String> {
        let (rest, part) =
            demand(what, take_while1(|c| !matches!(c, ',' | '(' | ')'))).parse(input)?;
        let part = part.trim();
        if part.is_empty() || part.len() > NAME_BYTES {
            expected(input, what)
        } else {
            Ok((rest, part.to_owned()))
        }
    };
    if input == "hand-written" {
        return Ok(("", Origin::HandWritten));
    }
    if let Some(rest) = input.strip_prefix("recorded(") {
        let (rest, device) = part("the device", rest)?;
        let (date_at, _) = demand("a comma and the date", char(',')).parse(rest)?;
        let date_at = super::lex::skip_space(date_at);
        let (rest, date) = demand("a date like 2026-03-01", date).parse(date_at)?;
        let (rest, _) =
            demand("a comma and the tool", char(',')).parse(super::lex::skip_space(rest))?;
        let (rest, tool) = part("the tool", rest)?;
        let (rest, _) = demand("a closing parenthesis", char(')')).parse(rest)?;
        return Ok((rest, Origin::Recorded { device, date: date.to_owned(), tool }));
    }
    if let Some(rest) = input.strip_prefix("generated(") {
        let (rest, generator) = part("the generator", rest)?;
        let (rest, _) = demand("a comma and the seed", char(',')).parse(rest)?;
        let (rest, seed) = digits("a seed", 0, u64::MAX, super::lex::skip_space(rest))?;
        let (rest, _) =
            demand("a closing parenthesis", char(')')).parse(super::lex::skip_space(rest))?;
        return Ok((rest, Origin::Generated { generator, seed }));
    }
    expected(input, LIKE)
}

fn date(input: &str) -> Parsed<'_, &str> {
    let (rest, date) = recognize(separated_list1(char('-'), digit1)).parse(input)?;
    let number =
        |range: std::ops::Range<usize>| date.get(range).and_then(|part| part.parse::<u32>().ok());
    let shape = date.len() == 10 && date.as_bytes()[4] == b'-' && date.as_bytes()[7] == b'-';
    let month = number(5..7).is_some_and(|month| (1..=12).contains(&month));
    let day = number(8..10).is_some_and(|day| (1..=31).contains(&day));
    if shape && month && day { Ok((rest, date)) } else { expected(input, "a date like 2026-03-01") }
}

fn permute(input: &str) -> Parsed<'_, Permutations> {
    let (rest, first) = take_while(|c: char| c.is_ascii_lowercase()).parse(input)?;
    if first == "all" || first == "none" {
        let permute = if first == "all" { Permutations::ALL } else { Permutations::NONE };
        return close(rest, permute);
    }
    let mut permute = Permutations::NONE;
    let mut input = input;
    while !input.is_empty() {
        let (rest, word) = super::lex::word("a permutation", input)?;
        let flag = match word {
            "cuts" => &mut permute.cuts,
            "swap" => &mut permute.swap,
            "twice" => &mut permute.twice,
            "later" => &mut permute.later,
            "after" => &mut permute.after,
            "rooms" => &mut permute.rooms,
            _ => {
                let names = Permutations::ALL.named().map(|(name, _)| name);
                let known = names.into_iter().chain(["all", "none"]);
                return fail(input, unknown("a permutation", word, known));
            }
        };
        if std::mem::replace(flag, true) {
            return fail(
                input,
                ParseErrorKind::Twice { what: "the permutation", name: word.to_owned() },
            );
        }
        input = rest;
    }
    Ok((input, permute))
}

/// `HH = HH-HH HH …`: the byte that is written, and the class that it stands for.
fn byte_class(input: &str) -> Parsed<'_, ByteClass> {
    let (input, written) = hex_byte(input)?;
    let Some(rest) = super::lex::skip_space(input).strip_prefix('=') else {
        return expected(input, "= and the bytes of the class");
    };
    let mut input = super::lex::skip_space(rest);
    let mut members = [false; 256];
    while !input.is_empty() {
        let (rest, first) = hex_byte(input)?;
        let (rest, last) = match rest.strip_prefix('-') {
            Some(rest) => hex_byte(rest)?,
            None => (rest, first),
        };
        if last < first {
            return expected(input, "a range whose first byte is not above its last");
        }
        members[usize::from(first)..=usize::from(last)].fill(true);
        input = super::lex::skip_space(rest);
    }
    let class = ByteClass::new(written, |byte| members[usize::from(byte)]);
    if !class.contains(written) {
        return expected(input, "a class that has the byte that is written");
    }
    Ok((input, class))
}

fn hex_byte(input: &str) -> Parsed<'_, u8> {
    let digits = input.get(..2).filter(|text| text.bytes().all(|c| c.is_ascii_hexdigit()));
    match digits.and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
        Some(byte) => Ok((&input[2..], byte)),
        None => expected(input, "a byte as two hex digits"),
    }
}
