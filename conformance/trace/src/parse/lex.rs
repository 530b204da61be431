//! The smallest parts of a line: words, numbers, quoted text, assignments.
//!
//! Every parser takes a suffix of one line, so that what is left when it fails
//! tells the column. A token takes the spaces behind it along.

use nom::branch::alt;
use nom::bytes::complete::{is_not, take_while, take_while_m_n, take_while1};
use nom::character::complete::{char, digit1};
use nom::combinator::value;
use nom::multi::fold_many0;
use nom::sequence::preceded;
use nom::{IResult, Parser};

use crate::error::ParseErrorKind;
use crate::limits::NAME_BYTES;
use crate::model::Assignment;
use crate::suggest::nearest;
use crate::{file_name, limits};

/// A fault, and how many bytes of the line were left at it.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) struct Fault {
    pub(crate) rest: usize,
    pub(crate) kind: ParseErrorKind,
}

pub(crate) type Parsed<'a, T> = IResult<&'a str, T, Fault>;

impl nom::error::ParseError<&str> for Fault {
    fn from_error_kind(input: &str, _kind: nom::error::ErrorKind) -> Self {
        Self { rest: input.len(), kind: ParseErrorKind::Expected("something else") }
    }

    fn append(_input: &str, _kind: nom::error::ErrorKind, other: Self) -> Self {
        other
    }
}

/// Ends the parse with this fault.
pub(crate) fn fail<T>(at: &str, kind: ParseErrorKind) -> Parsed<'_, T> {
    Err(nom::Err::Failure(Fault { rest: at.len(), kind }))
}

/// Ends the parse: something else belongs here.
pub(crate) fn expected<'a, T>(at: &'a str, what: &'static str) -> Parsed<'a, T> {
    fail(at, ParseErrorKind::Expected(what))
}

/// Runs a parser; what it does not match ends the parse with this message.
pub(crate) fn demand<'a, T>(
    what: &'static str,
    mut parser: impl Parser<&'a str, Output = T, Error = Fault>,
) -> impl FnMut(&'a str) -> Parsed<'a, T> {
    move |input| match parser.parse(input) {
        Err(nom::Err::Error(_)) => expected(input, what),
        other => other,
    }
}

/// Skips spaces and tabs.
pub(crate) fn skip_space(input: &str) -> &str {
    input.trim_start_matches([' ', '\t'])
}

/// Whether nothing but the annotation is left.
pub(crate) fn at_end(input: &str) -> bool {
    input.is_empty() || input.starts_with(';')
}

/// Demands the end of what a line says.
pub(crate) fn end<'a>(input: &'a str, what: &'static str) -> Parsed<'a, ()> {
    if at_end(input) { Ok((input, ())) } else { expected(input, what) }
}

/// Ends a token: a space, the annotation or the line's end must follow.
pub(crate) fn close<T>(rest: &str, value: T) -> Parsed<'_, T> {
    if at_end(rest) || rest.starts_with([' ', '\t']) {
        Ok((skip_space(rest), value))
    } else {
        expected(rest, "a space before this")
    }
}

fn is_word(c: char) -> bool {
    !c.is_whitespace() && c != ';' && c != '"'
}

/// A run of characters without space, quote or semicolon.
pub(crate) fn word<'a>(what: &'static str, input: &'a str) -> Parsed<'a, &'a str> {
    let (rest, word) = demand(what, take_while1(is_word)).parse(input)?;
    close(rest, word)
}

/// A word of a table.
pub(crate) fn choice<'a, T: Copy>(
    what: &'static str,
    table: &[(&'static str, T)],
    input: &'a str,
) -> Parsed<'a, T> {
    let (rest, found) = demand(what, take_while1(is_word)).parse(input)?;
    match table.iter().find(|(name, _)| *name == found) {
        Some((_, value)) => close(rest, *value),
        None => fail(input, unknown(what, found, table.iter().map(|(name, _)| *name))),
    }
}

/// The fault that a word is none of those known.
pub(crate) fn unknown<'k>(
    what: &'static str,
    word: &str,
    known: impl Iterator<Item = &'k str> + Clone,
) -> ParseErrorKind {
    // "a failure code" in "expected a failure code", but "unknown failure code".
    let bare = what.strip_prefix("a ").or_else(|| what.strip_prefix("an ")).unwrap_or(what);
    let bare = bare.split_once(':').map_or(bare, |(bare, _)| bare);
    ParseErrorKind::UnknownWord {
        what: bare,
        word: word.to_owned(),
        suggestion: nearest(word, known.clone()).map(str::to_owned),
        known: known.collect::<Vec<_>>().join(", "),
    }
}

/// A whole number from `low` to `high`, without the end of a token.
pub(crate) fn digits<'a>(
    what: &'static str,
    low: u64,
    high: u64,
    input: &'a str,
) -> Parsed<'a, u64> {
    let (rest, digits) = demand(what, digit1).parse(input)?;
    match digits.parse::<u64>() {
        Ok(number) if (low..=high).contains(&number) => Ok((rest, number)),
        _ => fail(input, ParseErrorKind::OutOfRange { what, low, high }),
    }
}

/// A whole number from `low` to `high`.
pub(crate) fn number<'a>(
    what: &'static str,
    low: u64,
    high: u64,
    input: &'a str,
) -> Parsed<'a, u64> {
    let (rest, number) = digits(what, low, high, input)?;
    close(rest, number)
}

/// An id from 1 up.
pub(crate) fn id<'a>(what: &'static str, input: &'a str) -> Parsed<'a, u32> {
    let (rest, id) = number(what, 1, u64::from(u32::MAX), input)?;
    Ok((rest, id as u32))
}

/// Two hex digits.
pub(crate) fn hex_pair(input: &str) -> Parsed<'_, u8> {
    take_while_m_n(2, 2, |c: char| c.is_ascii_hexdigit())
        .map_opt(|pair: &str| u8::from_str_radix(pair, 16).ok())
        .parse(input)
}

/// A slug.
pub(crate) fn slug<'a>(what: &'static str, input: &'a str) -> Parsed<'a, &'a str> {
    let (rest, found) = word(what, input)?;
    if file_name::is_slug(found) { Ok((rest, found)) } else { expected(input, what) }
}

fn is_name(c: char) -> bool {
    c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-'
}

fn name_part<'a>(what: &'static str, input: &'a str) -> Parsed<'a, &'a str> {
    let (rest, name) = take_while(is_name).parse(input)?;
    if !name.starts_with(|c: char| c.is_ascii_lowercase()) {
        return expected(input, what);
    }
    if name.len() > NAME_BYTES {
        return fail(
            input,
            ParseErrorKind::OutOfRange {
                what: "the bytes of a name",
                low: 1,
                high: NAME_BYTES as u64,
            },
        );
    }
    Ok((rest, name))
}

/// Lower-case letters, digits, `_` and `-`, a letter first.
pub(crate) fn name<'a>(what: &'static str, input: &'a str) -> Parsed<'a, &'a str> {
    let (rest, name) = name_part(what, input)?;
    close(rest, name)
}

/// Quoted text as bytes, without the end of a token.
pub(crate) fn quoted(input: &str) -> Parsed<'_, Vec<u8>> {
    enum Fragment<'a> {
        Plain(&'a str),
        Escaped(u8),
    }
    let escape = demand(
        "one of the escapes \\n \\r \\t \\\" \\\\ \\xNN",
        alt((
            value(b'\n', char('n')),
            value(b'\r', char('r')),
            value(b'\t', char('t')),
            value(b'"', char('"')),
            value(b'\\', char('\\')),
            preceded(char('x'), hex_pair),
        )),
    );
    let fragment = alt((
        is_not("\"\\").map(Fragment::Plain),
        preceded(char('\\'), escape).map(Fragment::Escaped),
    ));
    let body = fold_many0(fragment, Vec::new, |mut bytes: Vec<u8>, fragment| {
        match fragment {
            Fragment::Plain(text) => bytes.extend_from_slice(text.as_bytes()),
            Fragment::Escaped(byte) => bytes.push(byte),
        }
        bytes
    });
    let (rest, bytes) = preceded(char('"'), body).parse(input)?;
    let (rest, _) = demand("a closing quote", char('"')).parse(rest)?;
    Ok((rest, bytes))
}

/// A value: a bare word or quoted text in UTF-8.
fn text_value(input: &str) -> Parsed<'_, String> {
    if !input.starts_with('"') {
        let (rest, bare) =
            demand("a value: a word or \"quoted text\"", take_while1(is_word)).parse(input)?;
        return close(rest, bare.to_owned());
    }
    let (rest, bytes) = quoted(input)?;
    match String::from_utf8(bytes) {
        Ok(text) => close(rest, text),
        Err(_) => fail(input, ParseErrorKind::NotUtf8),
    }
}

/// `name=value` with the place of each.
pub(crate) struct Pair<'a> {
    pub(crate) name_at: &'a str,
    pub(crate) value_at: &'a str,
    pub(crate) assignment: Assignment,
}

fn pair(input: &str) -> Parsed<'_, Pair<'_>> {
    let (value_at, name) = name_part("name=value", input)?;
    let (value_at, _) = demand("name=value", char('=')).parse(value_at)?;
    let (rest, value) = text_value(value_at)?;
    Ok((
        rest,
        Pair { name_at: input, value_at, assignment: Assignment { name: name.to_owned(), value } },
    ))
}

/// `name=value` pairs as long as `goes_on`; no name stands twice.
pub(crate) fn pairs(input: &str, goes_on: impl Fn(&str) -> bool) -> Parsed<'_, Vec<Pair<'_>>> {
    let mut seen = std::collections::BTreeSet::new();
    let mut pairs = Vec::new();
    let mut input = input;
    while !at_end(input) && goes_on(input) {
        let (rest, pair) = pair(input)?;
        if !seen.insert(pair.assignment.name.clone()) {
            return fail(
                input,
                ParseErrorKind::Twice { what: "the name", name: pair.assignment.name },
            );
        }
        pairs.push(pair);
        input = rest;
    }
    Ok((input, pairs))
}

/// Free `name=value` pairs.
pub(crate) fn assignments(
    input: &str,
    goes_on: impl Fn(&str) -> bool,
) -> Parsed<'_, Vec<Assignment>> {
    let (rest, pairs) = pairs(input, goes_on)?;
    Ok((rest, pairs.into_iter().map(|pair| pair.assignment).collect()))
}

/// `name=value` pairs of a fixed set, to the end of the line.
pub(crate) struct Options<'a>(Vec<Pair<'a>>);

pub(crate) fn options<'a>(known: &[&'static str], input: &'a str) -> Parsed<'a, Options<'a>> {
    let (rest, pairs) = pairs(input, |_| true)?;
    match pairs.iter().find(|pair| !known.contains(&pair.assignment.name.as_str())) {
        Some(pair) => {
            fail(pair.name_at, unknown("an option", &pair.assignment.name, known.iter().copied()))
        }
        None => Ok((rest, Options(pairs))),
    }
}

impl<'a> Options<'a> {
    fn find(&self, name: &str) -> Option<&Pair<'a>> {
        self.0.iter().find(|pair| pair.assignment.name == name)
    }

    pub(crate) fn text(&self, name: &str) -> Option<String> {
        self.find(name).map(|pair| pair.assignment.value.clone())
    }

    pub(crate) fn number(
        &self,
        name: &str,
        what: &'static str,
        low: u64,
        high: u64,
    ) -> Result<Option<u64>, nom::Err<Fault>> {
        let Some(pair) = self.find(name) else { return Ok(None) };
        let digits = !pair.assignment.value.is_empty()
            && pair.assignment.value.bytes().all(|b| b.is_ascii_digit());
        let kind = match pair.assignment.value.parse::<u64>() {
            Ok(number) if digits && (low..=high).contains(&number) => return Ok(Some(number)),
            _ if digits => ParseErrorKind::OutOfRange { what, low, high },
            _ => ParseErrorKind::Expected(what),
        };
        Err(nom::Err::Failure(Fault { rest: pair.value_at.len(), kind }))
    }

    pub(crate) fn number32(
        &self,
        name: &str,
        what: &'static str,
        low: u64,
    ) -> Result<Option<u32>, nom::Err<Fault>> {
        Ok(self.number(name, what, low, u64::from(u32::MAX))?.map(|number| number as u32))
    }

    /// Up to `width` hex digits, `0x` before them or not.
    pub(crate) fn hex(
        &self,
        name: &str,
        what: &'static str,
        width: usize,
    ) -> Result<Option<u16>, nom::Err<Fault>> {
        let Some(pair) = self.find(name) else { return Ok(None) };
        let value = pair.assignment.value.as_str();
        let digits = value.strip_prefix("0x").unwrap_or(value);
        let good = (1..=width).contains(&digits.len())
            && digits.bytes().all(|byte| byte.is_ascii_hexdigit());
        match u16::from_str_radix(digits, 16) {
            Ok(number) if good => Ok(Some(number)),
            _ => {
                let kind = ParseErrorKind::Expected(what);
                Err(nom::Err::Failure(Fault { rest: pair.value_at.len(), kind }))
            }
        }
    }
}

/// Seconds with a fraction of 1 to 6 digits, in µs; not the end of a token.
pub(crate) fn time(input: &str) -> Parsed<'_, crate::Time> {
    const LIKE: &str = "a time like 0.500000";
    let (rest, seconds) = match digits(LIKE, 0, limits::SECONDS, input) {
        Err(nom::Err::Failure(Fault {
            rest,
            kind: ParseErrorKind::OutOfRange { low, high, .. },
        })) => {
            let kind = ParseErrorKind::OutOfRange { what: "the seconds of a time", low, high };
            return Err(nom::Err::Failure(Fault { rest, kind }));
        }
        other => other?,
    };
    let Ok((rest, fraction)) = preceded(char::<_, Fault>('.'), digit1).parse(rest) else {
        return expected(input, LIKE);
    };
    if fraction.len() > 6 {
        return expected(input, "a time with at most 6 digits after the point (the tick is 1 µs)");
    }
    let micros = fraction.bytes().chain(std::iter::repeat(b'0')).take(6);
    let micros = micros.fold(0, |sum, digit| sum * 10 + u64::from(digit - b'0'));
    Ok((rest, crate::Time(seconds * 1_000_000 + micros)))
}
