//! Lines like those of `candump -L -x`: `(SECONDS) PORT#HEX R`, where R is received
//! and T transmitted; and its own, `(SECONDS) INTERFACE ID#HEX`, for a line that was taken from a
//! CAN bus.

use std::fmt::Write as _;

use super::error::{ImportError, ImportFault};
use super::hexdump::{Record, records};
use super::note::{Left, Notes};
use super::text::{Cursor, lines};
use super::timeline::{Event, Timeline};
use super::{Import, Source};
use crate::Time;
use crate::model::{Expected, Given, Payload, What};

/// Bytes of a line that is written, at most.
const LONGEST: usize = 64;

pub(super) fn write(timeline: &Timeline, notes: &mut Notes) -> Vec<u8> {
    let mut text = String::new();
    for Record { at, received, bytes } in records(timeline, LONGEST, notes) {
        let _ = write!(text, "({}) port#", Time(at as u64));
        for byte in bytes {
            let _ = write!(text, "{byte:02X}");
        }
        text.push_str(if received { " R\n" } else { " T\n" });
    }
    text.into_bytes()
}

/// A line of a log.
struct Logged {
    at: i64,
    line: u32,
    /// The identifier of its CAN frame; none for a line that names only a port.
    id: Option<String>,
    /// As the line says: received or transmitted.
    received: Option<bool>,
    bytes: Vec<u8>,
}

pub(super) fn read(
    source: Source<'_>,
    import: &Import,
    timeline: &mut Timeline,
    notes: &mut Notes,
) -> Result<(), ImportError> {
    let mut log = Vec::new();
    for mut line in lines(source)? {
        if !line.is_at_end() {
            log.extend(logged(&mut line, notes)?);
        }
    }
    let (received, sent) = (import.received.as_deref(), import.sent.as_deref());
    let are_named = received.is_some() || sent.is_some();
    let is_clear = are_named || (is_one_line(&log, true) && is_one_line(&log, false));
    let unclear = || ImportError::whole(source.name, ImportFault::Frames { found: found(&log) });
    if !is_clear {
        return Err(unclear());
    }
    for Logged { at, line, id, received: told, bytes } in &log {
        let is = |name: Option<&str>| {
            id.as_deref().zip(name).is_some_and(|(id, name)| id.eq_ignore_ascii_case(name))
        };
        let is_received = match (id, told) {
            (Some(_), _) if is(received) => true,
            (Some(_), _) if is(sent) => false,
            (Some(_), _) if are_named => {
                notes.add(Left::OtherPackets, *line);
                continue;
            }
            (_, Some(told)) => *told,
            (_, None) => return Err(unclear()),
        };
        // A frame may carry nothing.
        if bytes.is_empty() {
            continue;
        }
        let payload = Payload::hex(bytes);
        let what = if is_received {
            What::Given(Given::Receive(payload))
        } else {
            What::Expected(Expected::Send(payload))
        };
        timeline.events.push(Event { at: *at, what, place: *line });
    }
    Ok(())
}

/// Whether all frames of a direction have one identifier.
fn is_one_line(log: &[Logged], received: bool) -> bool {
    let mut ids = log
        .iter()
        .filter(|logged| logged.received == Some(received))
        .filter_map(|logged| logged.id.as_deref());
    let first = ids.next();
    ids.all(|id| Some(id) == first)
}

/// The identifiers that there are, in the order in which they appear.
fn found(log: &[Logged]) -> String {
    const SHOWN: usize = 8;
    let mut ids: Vec<&str> = Vec::new();
    for id in log.iter().filter_map(|logged| logged.id.as_deref()) {
        if ids.contains(&id) {
            continue;
        }
        if ids.len() == SHOWN {
            ids.push("…");
            break;
        }
        ids.push(id);
    }
    ids.join(", ")
}

/// `(SECONDS) PORT#HEX R`, or as candump logs frames: `(SECONDS) INTERFACE ID#HEX`, with R or T
/// behind it or not. Nothing for a frame that asks for data and has none.
fn logged(line: &mut Cursor<'_>, notes: &mut Notes) -> Result<Option<Logged>, ImportError> {
    if !line.take("(") {
        return line.expected("a time in parentheses, like (1.500000)");
    }
    let at = line.seconds()?;
    if !line.take(")") {
        return line.expected("a closing parenthesis behind the time");
    }
    line.skip_space();
    let is_of_name = |c: char| !c.is_whitespace() && c != '#';
    let mut name = line.take_while(is_of_name);
    let is_frame = !name.is_empty() && line.rest().starts_with([' ', '\t']);
    if is_frame {
        line.skip_space();
        let here = *line;
        name = line.take_while(is_of_name);
        if name.is_empty() || name.len() > 8 || !name.bytes().all(|c| c.is_ascii_hexdigit()) {
            return here
                .expected("`#` and hex pairs, or a CAN identifier before them, like 123#4142");
        }
    }
    if name.is_empty() || !line.take("#") {
        return line.expected("the port, `#` and hex pairs, like ttyUSB0#4142");
    }
    if is_frame && line.take("#") && line.hex_digit().is_none() {
        return line.expected("the flags of a CAN FD frame and hex pairs, like 123##04142");
    }
    let is_remote = is_frame && line.rest().starts_with('R');
    if is_remote {
        line.take_while(|c| !c.is_whitespace());
    }
    let mut bytes = Vec::new();
    while let Some(byte) = line.hex_pair() {
        bytes.push(byte);
    }
    let is_whole = line.rest().starts_with([' ', '\t']) || (is_frame && line.is_at_end());
    if !is_whole || (bytes.is_empty() && !is_frame) {
        return line.expected("hex pairs without spaces, then the direction");
    }
    line.skip_space();
    let received = if line.take("R") {
        Some(true)
    } else if line.take("T") {
        Some(false)
    } else if is_frame {
        None
    } else {
        return line.expected("the direction, R for received or T for transmitted");
    };
    line.skip_space();
    if !line.is_at_end() {
        return line.expected("the end of the line");
    }
    if is_remote {
        notes.add(Left::OtherPackets, line.line);
        return Ok(None);
    }
    let id = is_frame.then(|| name.to_ascii_uppercase());
    Ok(Some(Logged { at, line: line.line, id, received, bytes }))
}
