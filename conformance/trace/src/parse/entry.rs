//! One line of the body that says what happens.

use nom::Parser;
use nom::branch::alt;
use nom::bytes::complete::{tag, take_while};
use softplug_abi::{Failure, LineErrorKind, LinkDownReason};

use super::lex::{
    Parsed, assignments, at_end, choice, close, demand, end, expected, fail, id, name, number,
    options, time, unknown,
};
use super::payload::{self, Damage, levels, named};
use crate::error::ParseErrorKind;
use crate::limits::BREAK_MICROS;
use crate::model::{
    Drain, Entry, Exact, Expected, Given, HostRequest, LineEvent, ModemLine, Room, SourceLine,
    Time, UNDER_WAY, What, When,
};

const NOTHING_MORE: &str = "nothing more here, or an annotation after `;`";
const JOB: &str = "a job id";
const DELIVERY: &str = "a delivery id";
const REQUEST: &str = "a request id";
const KIND: &str = "a kind: lower-case letters, digits, `-` and `_`";
const CODE: &str = "a reason like no-answer";
const STATUS: &str = "a status of 1 to 4 hex digits";
const SENT: &str = "a number of bytes sent";

/// An entry that begins at `floor` or later.
pub(super) fn entry(input: &str, floor: Time, line: u32) -> Parsed<'_, Entry> {
    let (rest, sign) = demand(
        "one of `<` `<<` `>` `!` `?` `=` `@` `.` `#` `{ alt`",
        alt((tag("<<"), tag("<"), tag(">"), tag("!"), tag("?"), tag("="), tag("@"), tag("."))),
    )
    .parse(input)?;
    let (time_at, ()) = close(rest, ())?;
    let (rest, when) = when(time_at, matches!(sign, "." | "@"))?;
    if when.from < floor {
        return fail(time_at, ParseErrorKind::NotSorted { time: when.from, before: floor });
    }
    let given = |(rest, given)| (rest, What::Given(given));
    let demanded = |(rest, expected)| (rest, What::Expected(expected));
    let (rest, what) = match sign {
        "<<" => payload::bytes(rest, Damage::Allowed)
            .map(|(rest, bytes)| given((rest, Given::Burst(bytes)))),
        "<" => payload::bytes(rest, Damage::Allowed)
            .map(|(rest, bytes)| given((rest, Given::Receive(bytes)))),
        ">" => output(rest).map(demanded),
        "!" => line_event(rest).map(|(rest, event)| given((rest, Given::Line(event)))),
        "?" => host(rest).map(|(rest, request)| given((rest, Given::Host(request)))),
        "=" => action(rest).map(demanded),
        "@" => exact(rest).map(|(rest, exact)| given((rest, Given::Exact(exact)))),
        _ => Ok((rest, What::Quiet)),
    }?;
    end(rest, NOTHING_MORE)?;
    Ok((rest, Entry { when, what, line: SourceLine(line) }))
}

fn when(input: &str, only_a_time: bool) -> Parsed<'_, When> {
    let (rest, from) = time(input)?;
    let Some(to_at) = rest.strip_prefix('~') else { return close(rest, When::at(from)) };
    if only_a_time {
        return expected(rest, "a single time; `.` and `@` have no window");
    }
    let (rest, to) = time(to_at)?;
    if to < from {
        return fail(to_at, ParseErrorKind::WindowBackwards);
    }
    close(rest, When { from, to })
}

fn output(input: &str) -> Parsed<'_, Expected> {
    if payload::begins(input) {
        let (rest, bytes) = payload::bytes(input, Damage::Refused)?;
        return Ok((rest, Expected::Send(bytes)));
    }
    let (_, first) = take_while(|c: char| c.is_ascii_alphabetic()).parse(input)?;
    if first == "break" {
        let (rest, ()) = close(&input[first.len()..], ())?;
        let (rest, micros) = number("a break's length in µs", 1, u64::from(BREAK_MICROS), rest)?;
        return Ok((rest, Expected::SendBreak(micros as u32)));
    }
    if input[first.len()..].starts_with(['+', '-']) && !first.is_empty() {
        let (rest, set) = levels(input, ModemLine::OUTPUTS)?;
        return Ok((rest, Expected::SetLines(set)));
    }
    expected(
        input,
        "bytes (41 42, \"text\", file:SHA256, gen:NAME(SEED,LENGTH)), modem lines (rts+ dtr-) or break MICROSECONDS",
    )
}

fn exact(input: &str) -> Parsed<'_, Exact> {
    let (rest, event) = name("an event of the ABI, or under-way", input)?;
    if event == UNDER_WAY {
        let (rest, facts) = assignments(rest, |_| true)?;
        return Ok((rest, Exact::UnderWay(facts)));
    }
    let (rest, payload) = if at_end(rest) {
        (rest, crate::Payload::default())
    } else {
        payload::bytes(rest, Damage::Refused)?
    };
    Ok((rest, Exact::Event { name: event.to_owned(), payload }))
}

fn line_event(input: &str) -> Parsed<'_, LineEvent> {
    const EVENT: &str = "a line event";
    const KNOWN: &[&str] = &["cts+", "cts-", "dsr+", "dsr-", "dcd+", "dcd-", "ri+", "ri-"];
    let (rest, word) = super::lex::word(EVENT, input)?;
    let error = |kind| LineEvent::Error { kind, byte: None, span: 0 };
    match word {
        "break" => Ok((rest, error(LineErrorKind::Break))),
        "overrun" => Ok((rest, error(LineErrorKind::Overrun))),
        "up" => Ok((rest, LineEvent::Up)),
        "down" => {
            let (rest, reason) =
                named("a reason", LinkDownReason::ALL, LinkDownReason::name, rest)?;
            Ok((rest, LineEvent::Down(reason)))
        }
        "lineerror" => {
            let (rest, kind) =
                named("a line error", LineErrorKind::ALL, LineErrorKind::name, rest)?;
            let (rest, options) = options(&["byte", "span"], rest)?;
            let byte =
                options.hex("byte", "a byte of 1 or 2 hex digits", 2)?.map(|byte| byte as u8);
            let span = options.number32("span", "a span in bytes", 0)?.unwrap_or(0);
            Ok((rest, LineEvent::Error { kind, byte, span }))
        }
        word if word.ends_with(['+', '-']) => {
            let (rest, changed) = levels(input, ModemLine::INPUTS)?;
            Ok((rest, LineEvent::Modem(changed)))
        }
        word => {
            let known = ["break", "overrun", "lineerror", "down", "up"];
            fail(input, unknown(EVENT, word, known.into_iter().chain(KNOWN.iter().copied())))
        }
    }
}

#[derive(Copy, Clone)]
enum Verb {
    Send,
    Job,
    Pause,
    Resume,
    Abort,
    ForceResume,
    Room,
    Drain,
    Answer,
    Swap,
    Close,
    Open,
}

const VERBS: &[(&str, Verb)] = &[
    ("send", Verb::Send),
    ("job", Verb::Job),
    ("pause", Verb::Pause),
    ("resume", Verb::Resume),
    ("abort", Verb::Abort),
    ("force-resume", Verb::ForceResume),
    ("room", Verb::Room),
    ("drain", Verb::Drain),
    ("answer", Verb::Answer),
    ("swap", Verb::Swap),
    ("close", Verb::Close),
    ("open", Verb::Open),
];

fn host(input: &str) -> Parsed<'_, HostRequest> {
    let (rest, verb) = choice("a request of the host", VERBS, input)?;
    match verb {
        Verb::Send => {
            let (rest, id) = id(JOB, rest)?;
            let (rest, data) = payload::all(rest, Damage::Refused)?;
            Ok((rest, HostRequest::Job { id, kind: "send".to_owned(), fields: Vec::new(), data }))
        }
        Verb::Job => {
            let (rest, id) = id(JOB, rest)?;
            let (rest, kind) = name(KIND, rest)?;
            let (rest, fields) = assignments(rest, |input| !payload::begins(input))?;
            let (rest, data) = if at_end(rest) {
                (rest, crate::Payload::default())
            } else {
                payload::all(rest, Damage::Refused)?
            };
            Ok((rest, HostRequest::Job { id, kind: kind.to_owned(), fields, data }))
        }
        Verb::Pause => id(JOB, rest).map(|(rest, id)| (rest, HostRequest::Pause(id))),
        Verb::Resume => id(JOB, rest).map(|(rest, id)| (rest, HostRequest::Resume(id))),
        Verb::Abort => {
            let (rest, id) =
                number("a job id, or 0 for the delivery", 0, u64::from(u32::MAX), rest)?;
            Ok((rest, HostRequest::Abort(id as u32)))
        }
        Verb::ForceResume => Ok((rest, HostRequest::ForceResume)),
        Verb::Room => room(rest, 1).map(|(rest, room)| (rest, HostRequest::Room(room))),
        Verb::Drain => {
            let (rest, drain) = choice(
                "a drain mode: auto or off",
                &[("auto", Drain::Auto), ("off", Drain::Off)],
                rest,
            )?;
            Ok((rest, HostRequest::Drain(drain)))
        }
        Verb::Answer => answer(rest),
        Verb::Swap => Ok((rest, HostRequest::Swap)),
        Verb::Close => Ok((rest, HostRequest::Close)),
        Verb::Open => Ok((rest, HostRequest::Open)),
    }
}

/// `transmit=N delivery=N`, at least one of them.
pub(super) fn room(input: &str, low: u64) -> Parsed<'_, Room> {
    let (rest, options) = options(&["transmit", "delivery"], input)?;
    let room = Room {
        transmit: options.number32("transmit", "a number of bytes of room", low)?,
        delivery: options.number32("delivery", "a number of bytes of room", low)?,
    };
    if room == Room::default() {
        expected(input, "transmit=BYTES or delivery=BYTES")
    } else {
        Ok((rest, room))
    }
}

fn answer(input: &str) -> Parsed<'_, HostRequest> {
    let (rest, id) = id(REQUEST, input)?;
    let (rest, granted) =
        choice("an answer: granted or refused", &[("granted", true), ("refused", false)], rest)?;
    if granted {
        let (rest, data) = if at_end(rest) {
            (rest, crate::Payload::default())
        } else {
            payload::all(rest, Damage::Refused)?
        };
        return Ok((rest, HostRequest::Grant { id, data }));
    }
    let (rest, failure) = failure(rest)?;
    Ok((rest, HostRequest::Refuse { id, failure }))
}

fn failure(input: &str) -> Parsed<'_, Failure> {
    let (rest, code) = name(CODE, input)?;
    known(input, code, rest)
}

/// The failure of this name, which stands at `at`.
fn known<'a>(at: &'a str, code: &str, rest: &'a str) -> Parsed<'a, Failure> {
    match Failure::from_name(code) {
        Some(failure) => Ok((rest, failure)),
        None => fail(at, ParseErrorKind::NoFailure(code.to_owned())),
    }
}

#[derive(Copy, Clone)]
enum ActionVerb {
    Deliver,
    Done,
    Fail,
    Check,
    Request,
    Withdraw,
}

const ACTIONS: &[(&str, ActionVerb)] = &[
    ("deliver", ActionVerb::Deliver),
    ("done", ActionVerb::Done),
    ("fail", ActionVerb::Fail),
    ("check", ActionVerb::Check),
    ("request", ActionVerb::Request),
    ("withdraw", ActionVerb::Withdraw),
];

fn action(input: &str) -> Parsed<'_, Expected> {
    let (rest, verb) = choice("an action", ACTIONS, input)?;
    match verb {
        ActionVerb::Deliver => deliver(rest),
        ActionVerb::Done => {
            let (rest, id) = id(JOB, rest)?;
            let (rest, options) = options(&["sent"], rest)?;
            Ok((rest, Expected::Done { id, sent: options.number("sent", SENT, 0, u64::MAX)? }))
        }
        ActionVerb::Fail => {
            let (rest, id) = id(JOB, rest)?;
            let (rest, failure) = failure(rest)?;
            let (rest, options) = options(&["status", "sent"], rest)?;
            let status = options.hex("status", STATUS, 4)?.unwrap_or(0);
            let sent = options.number("sent", SENT, 0, u64::MAX)?;
            Ok((rest, Expected::Fail { id, failure, status, sent }))
        }
        ActionVerb::Check => check(rest),
        ActionVerb::Request => {
            let (rest, id) = id(REQUEST, rest)?;
            let (rest, kind) = name(KIND, rest)?;
            let (rest, fields) = assignments(rest, |_| true)?;
            Ok((rest, Expected::Request { id, kind: kind.to_owned(), fields }))
        }
        ActionVerb::Withdraw => id(REQUEST, rest).map(|(rest, id)| (rest, Expected::Withdraw(id))),
    }
}

fn deliver(input: &str) -> Parsed<'_, Expected> {
    let (rest, id) = id(DELIVERY, input)?;
    let (rest, data) = payload::some(rest, Damage::Refused)?;
    let (end_at, word) = take_while(|c: char| c.is_ascii_lowercase()).parse(rest)?;
    let (rest, failure) = match word {
        "complete" => close(end_at, None)?,
        "failed" => {
            let (rest, ()) = close(end_at, ())?;
            let (rest, failure) = failure(rest)?;
            (rest, Some(failure))
        }
        _ if at_end(rest) || end_at.starts_with('=') => (rest, None),
        _ => return expected(rest, "bytes, complete, failed REASON, status=HEX or name=\"…\""),
    };
    let (rest, options) = options(&["status", "name"], rest)?;
    let status = options.hex("status", STATUS, 4)?.unwrap_or(0);
    Ok((rest, Expected::Deliver { id, data, failure, status, name: options.text("name") }))
}

fn check(input: &str) -> Parsed<'_, Expected> {
    let (code_at, id) = id(JOB, input)?;
    let (rest, code) = name("good, or a reason like unsupported-character", code_at)?;
    if code == "good" {
        return Ok((rest, Expected::Check { id, failure: None, status: 0, line: 0, column: 0 }));
    }
    let (rest, failure) = known(code_at, code, rest)?;
    let failure = Some(failure);
    let (rest, options) = options(&["line", "column", "status"], rest)?;
    let line = options.number32("line", "a line from 1", 1)?.unwrap_or(0);
    let column = options.number32("column", "a column from 1", 1)?.unwrap_or(0);
    let status = options.hex("status", STATUS, 4)?.unwrap_or(0);
    Ok((rest, Expected::Check { id, failure, status, line, column }))
}
