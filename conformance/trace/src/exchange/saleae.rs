//! Tables of Saleae Logic's analyser of serial lines, of both its generations: a row
//! for each character, with the time of its start bit.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use csv::StringRecord;

use super::error::{ImportError, ImportFault, Place};
use super::note::{Left, Notes};
use super::text::{decode, micros};
use super::timeline::{Event, Timeline};
use super::{Import, Source};
use crate::model::{BadKind, Expected, Given, Item, Payload, What};

const RECEIVED: &str = "rx";
const SENT: &str = "tx";

/// As Logic 2 writes it, with "rx" for the line that the plug-in receives from and
/// "tx" for the other.
pub(super) fn write(timeline: &Timeline, notes: &mut Notes) -> Vec<u8> {
    let mut text = String::from("name,type,start_time,duration,\"data\",\"error\"\n");
    let duration = timeline.pace.of_characters(1);
    let mut rows = Vec::new();
    for event in &timeline.events {
        notes.unheld(&event.what, event.place);
        for character in event.characters(timeline.pace) {
            let name = if character.received { RECEIVED } else { SENT };
            let start = if character.received { character.at - duration } else { character.at };
            let error = match character.damage {
                None => "",
                Some(BadKind::Parity) => "\"parity\"",
                Some(BadKind::Framing) => "\"framing\"",
                Some(BadKind::ParityOrFraming) => {
                    notes.add(Left::EitherError, event.place);
                    "\"framing\""
                }
            };
            rows.push((start, name, character.byte, error));
        }
    }
    // Logic sorts its rows by their start.
    rows.sort_by_key(|(start, ..)| *start);
    for (start, name, byte, error) in rows {
        let (start, duration) = (Seconds(start), Seconds(duration));
        let _ = writeln!(text, "\"{name}\",\"data\",{start},{duration},0x{byte:02X},{error}");
    }
    text.into_bytes()
}

/// A time that may be negative.
struct Seconds(i64);

impl std::fmt::Display for Seconds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sign = if self.0 < 0 { "-" } else { "" };
        write!(f, "{sign}{}", crate::Time(self.0.unsigned_abs()))
    }
}

pub(super) fn read(
    sources: &[Source<'_>],
    import: &Import,
    timeline: &mut Timeline,
    notes: &mut Notes,
) -> Result<(), ImportError> {
    for (place, source) in sources.iter().enumerate() {
        table(*source, place == 0, import, timeline, notes)?;
    }
    Ok(())
}

/// Where a table has what.
struct Columns {
    time: usize,
    data: usize,
    /// Columns that say that the character is damaged.
    parity: Option<usize>,
    framing: Option<usize>,
    error: Option<usize>,
    kind: Option<usize>,
    name: Option<usize>,
    duration: Option<usize>,
}

impl Columns {
    /// By the headings of either generation.
    fn find(headings: &StringRecord) -> Result<Self, ImportFault> {
        let find = |name: &str| headings.iter().position(|heading| heading.trim() == name);
        let columns = |time, data| Self {
            time,
            data,
            parity: find("Parity Error"),
            framing: find("Framing Error"),
            error: find("error"),
            kind: find("type"),
            name: find("name"),
            duration: find("duration"),
        };
        match (find("start_time"), find("Time [s]")) {
            (Some(time), _) => {
                find("data").map(|data| columns(time, data)).ok_or(ImportFault::NoColumn("data"))
            }
            (None, Some(time)) => {
                find("Value").map(|data| columns(time, data)).ok_or(ImportFault::NoColumn("Value"))
            }
            (None, None) => Err(ImportFault::NoColumn("start_time")),
        }
    }
}

fn table(
    source: Source<'_>,
    first: bool,
    import: &Import,
    timeline: &mut Timeline,
    notes: &mut Notes,
) -> Result<(), ImportError> {
    let fault = |line: u64, fault| ImportError {
        file: source.name.to_owned(),
        place: Place::Line { line: line as u32, column: 1 },
        fault,
    };
    let row_fault = |error: csv::Error| {
        let line = error.position().map_or(1, csv::Position::line);
        fault(line, ImportFault::Row(error.to_string()))
    };
    let text = decode(source)?;
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes());
    let columns =
        Columns::find(reader.headers().map_err(row_fault)?).map_err(|missing| fault(1, missing))?;
    let mut names = BTreeSet::new();
    let begin = timeline.events.len();
    for row in reader.records() {
        let row = row.map_err(row_fault)?;
        let line = row.position().map_or(1, csv::Position::line);
        let field = |column: Option<usize>| column.and_then(|column| row.get(column)).unwrap_or("");
        let name = field(columns.name).trim();
        let received = match direction(name, first, &columns, import) {
            Some(received) if columns.kind.is_none() || field(columns.kind) == "data" => received,
            _ => {
                // More are not shown.
                if names.len() < 8 {
                    names.insert(name.to_owned());
                }
                notes.add(Left::OtherRows, line as u32);
                continue;
            }
        };
        let start = micros(field(Some(columns.time)).trim()).map_err(|bad| fault(line, bad))?;
        let byte = byte(field(Some(columns.data)).trim()).map_err(|bad| fault(line, bad))?;
        let what = match damage(&field, &columns).map_err(|bad| fault(line, bad))? {
            Some(kind) if received => {
                What::Given(Given::Receive(Payload::new([Item::Bad { kind, byte }])))
            }
            None if received => What::Given(Given::Receive(Payload::hex(&[byte]))),
            damage => {
                // In a trace what the plug-in sends is never damaged.
                if damage.is_some() {
                    notes.add(Left::LineErrors, line as u32);
                }
                What::Expected(Expected::Send(Payload::hex(&[byte])))
            }
        };
        let mut length = timeline.pace.of_characters(1);
        if length == 0 && received && columns.duration.is_some() {
            length = micros(field(columns.duration).trim()).map_err(|bad| fault(line, bad))?;
        }
        let at = if received { start + length } else { start };
        timeline.events.push(Event { at, what, place: line as u32 });
    }
    if timeline.events.len() == begin && !names.is_empty() {
        let found = names.iter().map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ");
        return Err(fault(1, ImportFault::Names { found }));
    }
    Ok(())
}

/// Whether the plug-in receives what this analyser sees; `None`: it is another one.
/// A table without names belongs to one line as a whole.
fn direction(name: &str, first: bool, columns: &Columns, import: &Import) -> Option<bool> {
    if columns.name.is_none() {
        return Some(first);
    }
    let is = |chosen: &Option<String>, usual: &str| match chosen {
        Some(chosen) => name == chosen,
        None => name.eq_ignore_ascii_case(usual),
    };
    if is(&import.received, RECEIVED) {
        return Some(true);
    }
    is(&import.sent, SENT).then_some(false)
}

/// How the character is damaged.
fn damage<'a>(
    field: &impl Fn(Option<usize>) -> &'a str,
    columns: &Columns,
) -> Result<Option<BadKind>, ImportFault> {
    let is_set = |column| !field(column).trim().is_empty();
    Ok(match field(columns.error).trim() {
        "parity" => Some(BadKind::Parity),
        "framing" => Some(BadKind::Framing),
        "" if is_set(columns.framing) => Some(BadKind::Framing),
        "" if is_set(columns.parity) => Some(BadKind::Parity),
        "" => None,
        _ => {
            return Err(ImportFault::Expected(
                "\"parity\", \"framing\" or nothing in the column \"error\"",
            ));
        }
    })
}

/// A character as a hexadecimal or binary number. Decimal numbers and ASCII are not
/// told apart in these tables: `5` may be either.
fn byte(text: &str) -> Result<u8, ImportFault> {
    let (digits, radix) = match (text.strip_prefix("0x"), text.strip_prefix("0b")) {
        (Some(digits), _) => (digits, 16),
        (None, Some(digits)) => (digits, 2),
        (None, None) => ("", 16),
    };
    if !digits.bytes().all(|c| c.is_ascii_alphanumeric()) {
        return Err(ImportFault::Expected(HEX));
    }
    u8::from_str_radix(digits, radix).map_err(|_| ImportFault::Expected(HEX))
}

const HEX: &str = "a byte like 0x41; export the table with hexadecimal values";
