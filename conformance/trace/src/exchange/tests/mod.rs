//! Exchange as a whole.

mod broken;
mod files;
mod notes;
mod round;

use super::note::Notes;
use super::timeline::{Event, Timeline};
use super::*;
use crate::limits;
use crate::model::{Expected, Given, Line, LineEvent, ModemLine, NoFiles, What};

/// Front matter for a line.
fn front(line: &str) -> FrontMatter {
    FrontMatter::parse(&format!(
        "id: p.case\ntitle: T\nprofile: p\nclauses: p.c\nlevel: may\nline: {line}\nsince: 1\n\
         origin: recorded(machine, 2026-03-01, tool)\n---\n"
    ))
    .unwrap_or_else(|error| panic!("{}", error.report("front")))
}

/// A trace at 9600 8N1 with this body.
fn trace(body: &str) -> Trace {
    let front = front("9600 8N1 depth=1 reaction=0");
    let text = Trace { front, body: Vec::new() }.format() + body;
    Trace::parse(&text).unwrap_or_else(|error| panic!("{}", error.report("test.spt")))
}

fn body(trace: &Trace) -> String {
    trace.format().split_once("---\n").expect("the formatter ends the front matter so").1.to_owned()
}

fn import_text(text: impl AsRef<[u8]>, format: Format) -> Result<Imported, ImportError> {
    let source = Source { name: "file", bytes: text.as_ref() };
    import(&[source], format, &Import::new(front("9600 8N1")))
}

/// The body that a file gives at 9600 8N1.
fn imported(text: impl AsRef<[u8]>, format: Format) -> String {
    body(&import_text(text, format).unwrap_or_else(|error| panic!("{error}")).trace)
}

/// Why a file is refused.
fn refused(text: impl AsRef<[u8]>, format: Format) -> String {
    import_text(text, format).expect_err("this file should be refused").to_string()
}

/// What happens on the line, character by character and modem line by modem line,
/// however it is written.
fn timeline(trace: &Trace) -> Vec<(i64, String)> {
    let timeline = Timeline::of(trace, &NoFiles, &mut Notes::default()).unwrap();
    let mut known = timeline.modem.clone();
    let mut all = Vec::new();
    for event in &timeline.events {
        let Event { at, what, .. } = event;
        match what {
            What::Given(Given::Receive(_) | Given::Burst(_))
            | What::Expected(Expected::Send(_)) => {
                all.extend(event.characters(timeline.pace).map(|character| {
                    let way = if character.received { "received" } else { "sent" };
                    let damage =
                        character.damage.map_or(String::new(), |kind| format!(" {kind:?}"));
                    (character.at, format!("{way} {:02X}{damage}", character.byte))
                }));
            }
            What::Expected(Expected::SetLines(levels))
            | What::Given(Given::Line(LineEvent::Modem(levels))) => {
                for (line, on) in &levels.0 {
                    if known.0.insert(*line, *on) != Some(*on) {
                        all.push((*at, format!("{} {on}", line.name())));
                    }
                }
            }
            what => all.push((*at, format!("{what:?}"))),
        }
    }
    // Each direction and the modem lines are lines of their own: at one moment none
    // comes first.
    let wire = |text: &str| match text.split(' ').next() {
        Some("sent") => 1,
        Some("cts" | "dsr" | "dcd" | "ri" | "rts" | "dtr") => 2,
        _ => 0,
    };
    all.sort_by_key(|(at, text)| (*at, wire(text)));
    all
}

/// Exports, imports again and compares what happens.
fn there_and_back(trace: &Trace, format: Format) -> Trace {
    let exported = export(trace, format, &NoFiles).unwrap();
    let source = Source { name: "exported", bytes: &exported.bytes };
    let import_as = Import::new(trace.front.clone());
    let back = import(&[source], format, &import_as).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(
        timeline(&back.trace),
        timeline(trace),
        "{}\n{}",
        trace.format(),
        back.trace.format()
    );
    let text = back.trace.format();
    assert_eq!(Trace::parse(&text).map(|trace| trace.format()), Ok(text));
    back.trace
}

/// Whether a format has a place for it.
fn is_held(format: Format, line: &Line) -> bool {
    let Line::Entry(entry) = line else { return false };
    match &entry.what {
        What::Given(Given::Receive(_) | Given::Burst(_)) | What::Expected(Expected::Send(_)) => {
            true
        }
        What::Expected(Expected::SetLines(_))
        | What::Given(Given::Line(LineEvent::Modem(_) | LineEvent::Error { .. })) => {
            format == Format::Pcapng
        }
        _ => false,
    }
}

/// All modem lines off.
fn all_off() -> crate::ModemLevels {
    crate::ModemLevels(ModemLine::INPUTS.iter().map(|line| (*line, false)).collect())
}
