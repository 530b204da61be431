//! Lines like those of `candump -L -x`: `(SECONDS) PORT#HEX R`, where R is received
//! and T transmitted.

use std::fmt::Write as _;

use super::Source;
use super::course::{Course, Event};
use super::error::ImportError;
use super::hexdump::{Record, records};
use super::note::Notes;
use super::text::{Cursor, lines};
use crate::Time;
use crate::model::{Payload, What};

/// Bytes of a line that is written, at most.
const LONGEST: usize = 64;

pub(super) fn write(course: &Course, notes: &mut Notes) -> Vec<u8> {
    let mut text = String::new();
    for Record { at, received, bytes } in records(course, LONGEST, notes) {
        let _ = write!(text, "({}) port#", Time(at as u64));
        for byte in bytes {
            let _ = write!(text, "{byte:02X}");
        }
        text.push_str(if received { " R\n" } else { " T\n" });
    }
    text.into_bytes()
}

pub(super) fn read(source: Source<'_>, course: &mut Course) -> Result<(), ImportError> {
    for mut line in lines(source)? {
        if !line.is_at_end() {
            course.events.push(event(&mut line)?);
        }
    }
    Ok(())
}

fn event(line: &mut Cursor<'_>) -> Result<Event, ImportError> {
    if !line.take("(") {
        return line.expected("a time in parentheses, like (1.500000)");
    }
    let at = line.seconds()?;
    if !line.take(")") {
        return line.expected("a closing parenthesis behind the time");
    }
    line.skip_space();
    let port = line.take_while(|c| !c.is_whitespace() && c != '#');
    if port.is_empty() || !line.take("#") {
        return line.expected("the port, `#` and hex pairs, like ttyUSB0#4142");
    }
    let mut bytes = Vec::new();
    while let Some(byte) = line.hex_pair() {
        bytes.push(byte);
    }
    if bytes.is_empty() || !line.rest().starts_with([' ', '\t']) {
        return line.expected("hex pairs without spaces, then the direction");
    }
    line.skip_space();
    let payload = Payload::hex(&bytes);
    let what = if line.take("R") {
        What::Receive(payload)
    } else if line.take("T") {
        What::Send(payload)
    } else {
        return line.expected("the direction, R for received or T for transmitted");
    };
    line.skip_space();
    if !line.is_at_end() {
        return line.expected("the end of the line");
    }
    Ok(Event { at, what, place: line.line })
}
