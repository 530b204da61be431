//! Payloads: hex pairs, quoted text, files, generators, damaged characters.

use nom::Parser;
use nom::bytes::complete::{tag, take_while1};
use nom::character::complete::char;

use super::lex::{
    Parsed, at_end, choice, close, demand, digits, expected, fail, hex_pair, quoted, skip_space,
    unknown,
};
use crate::error::ParseErrorKind;
use crate::generate::{GENERATORS, Generator};
use crate::limits::ITEM_BYTES;
use crate::model::{BadKind, Digest, Item, Payload};

const ITEM: &str = "bytes: hex pairs like 41 42, \"text\", file:SHA256 or gen:NAME(SEED,LENGTH)";
const DIGITS: &str = "64 hex digits of a SHA-256";

/// Whether damaged characters may stand in a payload.
#[derive(Copy, Clone, PartialEq, Eq)]
pub(super) enum Damage {
    Allowed,
    Refused,
}

/// Whether an item of a payload begins here.
pub(super) fn begins(input: &str) -> bool {
    input.starts_with(['"', '~'])
        || input.starts_with("file:")
        || input.starts_with("gen:")
        || hex_pair(input).is_ok_and(|(rest, _)| close(rest, ()).is_ok())
}

/// Items up to what cannot be one; perhaps none.
pub(super) fn some(input: &str, damage: Damage) -> Parsed<'_, Payload> {
    let mut items = Vec::new();
    let mut input = input;
    while begins(input) {
        let (rest, item) = item(input, damage)?;
        items.push(item);
        input = rest;
    }
    Ok((input, Payload::new(items)))
}

/// Items to the end of the line, at least one; `""` is one.
pub(super) fn all(input: &str, damage: Damage) -> Parsed<'_, Payload> {
    let (rest, payload) = some(input, damage)?;
    if payload.is_absent() || !at_end(rest) { expected(rest, ITEM) } else { Ok((rest, payload)) }
}

/// Items to the end of the line, at least one byte.
pub(super) fn bytes(input: &str, damage: Damage) -> Parsed<'_, Payload> {
    let (rest, payload) = all(input, damage)?;
    if payload.length() == Some(0) {
        fail(input, ParseErrorKind::NoBytes)
    } else {
        Ok((rest, payload))
    }
}

fn item(input: &str, damage: Damage) -> Parsed<'_, Item> {
    if input.starts_with('"') {
        let (rest, text) = quoted(input)?;
        return close(rest, Item::Text(text));
    }
    if input.starts_with('~') {
        return match damage {
            Damage::Allowed => bad(input),
            Damage::Refused => fail(input, ParseErrorKind::BadCharacterHere),
        };
    }
    if input.starts_with("file:") {
        return file(input);
    }
    if input.starts_with("gen:") {
        return generated(input);
    }
    let (rest, byte) = demand(ITEM, hex_pair).parse(input)?;
    close(rest, Item::Hex(vec![byte]))
}

fn bad(input: &str) -> Parsed<'_, Item> {
    const LIKE: &str = "a damaged character: ~p31 parity, ~f31 framing, ~e31 either";
    let mut letters = input.strip_prefix('~').unwrap_or(input).chars();
    let kind = match letters.next() {
        Some('p') => BadKind::Parity,
        Some('f') => BadKind::Framing,
        Some('e') => BadKind::ParityOrFraming,
        _ => return expected(input, LIKE),
    };
    let Ok((rest, byte)) = hex_pair(letters.as_str()) else { return expected(input, LIKE) };
    close(rest, Item::Bad { kind, byte })
}

fn file(input: &str) -> Parsed<'_, Item> {
    let (input, _) = tag("file:").parse(input)?;
    let mut digest = [0; 32];
    let mut rest = input;
    for place in &mut digest {
        let Ok((after, byte)) = hex_pair(rest) else { return expected(input, DIGITS) };
        *place = byte;
        rest = after;
    }
    if rest.starts_with(|c: char| c.is_ascii_hexdigit()) {
        return expected(input, DIGITS);
    }
    close(rest, Item::File(Digest(digest)))
}

fn generated(input: &str) -> Parsed<'_, Item> {
    let (name_at, _) = tag("gen:").parse(input)?;
    let (rest, name) =
        demand("the name of a generator", take_while1(|c: char| c.is_ascii_alphanumeric()))
            .parse(name_at)?;
    let Some(kind) = GENERATORS.iter().copied().find(|kind| kind.name() == name) else {
        return fail(
            name_at,
            unknown("a generator", name, GENERATORS.iter().map(|kind| kind.name())),
        );
    };
    let (rest, _) = demand("(SEED,LENGTH)", char('(')).parse(rest)?;
    let (rest, seed) = digits("a generator's seed", 0, u64::MAX, skip_space(rest))?;
    let (rest, _) = demand("a comma and the length", char(',')).parse(skip_space(rest))?;
    let (rest, length) = digits("a generator's length", 0, ITEM_BYTES, skip_space(rest))?;
    let (rest, _) = demand("a closing parenthesis", char(')')).parse(skip_space(rest))?;
    close(rest, Item::Generated(Generator { kind, seed, length }))
}

/// `rts+ dtr-` to the end of the line; no line twice.
pub(super) fn levels<'a>(
    input: &'a str,
    lines: &[crate::ModemLine],
) -> Parsed<'a, crate::ModemLevels> {
    let table: Vec<(String, (crate::ModemLine, bool))> = lines
        .iter()
        .flat_map(|line| {
            [
                (format!("{}+", line.name()), (*line, true)),
                (format!("{}-", line.name()), (*line, false)),
            ]
        })
        .collect();
    let mut levels = crate::ModemLevels::default();
    let mut input = input;
    while !at_end(input) {
        let (rest, found) = super::lex::word("modem lines", input)?;
        let Some((_, (line, on))) = table.iter().find(|(name, _)| name == found) else {
            return fail(
                input,
                unknown("a modem line", found, table.iter().map(|(name, _)| name.as_str())),
            );
        };
        if levels.0.insert(*line, *on).is_some() {
            return fail(
                input,
                ParseErrorKind::Twice { what: "the modem line", name: line.name().to_owned() },
            );
        }
        input = rest;
    }
    if levels.0.is_empty() { expected(input, "modem lines") } else { Ok((input, levels)) }
}

/// `auto` and the like, from names.
pub(super) fn named<'a, T: Copy>(
    what: &'static str,
    all: &[T],
    name: impl Fn(T) -> &'static str,
    input: &'a str,
) -> Parsed<'a, T> {
    let table: Vec<(&'static str, T)> = all.iter().map(|value| (name(*value), *value)).collect();
    choice(what, &table, input)
}
