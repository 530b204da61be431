//! Hex dumps as `text2pcap -D -t %s.%f` reads them: a line with direction and time,
//! then lines with an offset and up to 16 bytes.

use std::fmt::Write as _;

use super::Source;
use super::error::ImportError;
use super::note::{Left, Notes};
use super::text::lines;
use super::timeline::{Event, Timeline};
use crate::Time;
use crate::model::{Expected, Given, Payload, What};

/// Bytes of a packet that is written, at most. More than 65,535 would need longer
/// offsets, more than 262,144 `text2pcap` refuses.
const LONGEST: usize = 32 << 10;
/// Bytes of a line.
const ROW: usize = 16;

pub(super) fn write(timeline: &Timeline, notes: &mut Notes) -> Vec<u8> {
    let mut text = String::new();
    for Record { at, received, bytes } in records(timeline, LONGEST, notes) {
        let _ = writeln!(text, "{} {}", if received { 'I' } else { 'O' }, Time(at as u64));
        for (place, row) in bytes.chunks(ROW).enumerate() {
            let _ = write!(text, "{:04x}", place * ROW);
            for byte in row {
                let _ = write!(text, " {byte:02x}");
            }
            text.push('\n');
        }
    }
    text.into_bytes()
}

pub(super) fn read(source: Source<'_>, timeline: &mut Timeline) -> Result<(), ImportError> {
    // The packet that is being read: its head and its bytes.
    let mut open: Option<(Event, Vec<u8>)> = None;
    for mut line in lines(source)? {
        if line.is_at_end() || line.rest().starts_with('#') {
            continue;
        }
        let direction = line.take_while(|c| c == 'I' || c == 'O');
        if direction.len() == 1 {
            line.skip_space();
            let at = line.seconds()?;
            close(open.take(), timeline);
            let nothing = Payload::default();
            let what = if direction == "I" {
                What::Given(Given::Receive(nothing))
            } else {
                What::Expected(Expected::Send(nothing))
            };
            open = Some((Event { at, what, place: line.line }, Vec::new()));
            line.skip_space();
            if line.is_at_end() {
                continue;
            }
        }
        let Some((_, bytes)) = &mut open else {
            return line.expected("the direction and the time of a packet, like `I 1.500000`");
        };
        let here = line;
        let offset = line.take_while(|c| c.is_ascii_hexdigit());
        if usize::from_str_radix(offset, 16) != Ok(bytes.len()) || offset.len() < 3 {
            return here.expected(
                "the offset of the next byte in at least three hex digits, or the direction and the time of a packet",
            );
        }
        line.skip_space();
        // Some tools put the bytes as text behind a bar.
        while !line.is_at_end() && !line.rest().starts_with('|') {
            let Some(byte) = line.hex_pair() else {
                return line.expected("pairs of hex digits with spaces between them");
            };
            if !line.is_at_end() && !line.rest().starts_with([' ', '\t', '\r']) {
                return line.expected("a space behind two hex digits");
            }
            bytes.push(byte);
            line.skip_space();
        }
    }
    close(open, timeline);
    Ok(())
}

fn close(open: Option<(Event, Vec<u8>)>, timeline: &mut Timeline) {
    if let Some((event, bytes)) = open.filter(|(_, bytes)| !bytes.is_empty()) {
        let what = event.what.with_payload(Payload::hex(&bytes));
        timeline.events.push(Event { what, ..event });
    }
}

/// Bytes of one time and one direction.
pub(super) struct Record {
    pub(super) at: i64,
    pub(super) received: bool,
    pub(super) bytes: Vec<u8>,
}

/// A timeline as records, `most` bytes at most in each, sorted by time; a reader that
/// knows only the time of each record finds the time of every byte. What is no byte
/// is noted.
pub(super) fn records(timeline: &Timeline, most: usize, notes: &mut Notes) -> Vec<Record> {
    let pace = timeline.pace;
    let mut records = Vec::new();
    for event in &timeline.events {
        notes.unheld(&event.what, event.place);
        let characters: Vec<_> = event.characters(pace).collect();
        for _ in characters.iter().filter(|character| character.damage.is_some()) {
            notes.add(Left::LineErrors, event.place);
        }
        let length = match event.what {
            // Characters that come one after the other have a time each.
            What::Given(Given::Burst(_)) => 1,
            What::Expected(Expected::Send(_)) => pace.cut(most),
            _ => most,
        };
        records.extend(characters.chunks(length).map(|characters| Record {
            at: characters[0].at,
            received: characters[0].received,
            bytes: characters.iter().map(|character| character.byte).collect(),
        }));
    }
    records.sort_by_key(|record| record.at);
    records
}
