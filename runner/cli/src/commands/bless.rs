//! `softplug replay --bless`: traces take over what a plug-in does, and lose nothing without a word.

use serde::Serialize;
use softplug_abi::Micros;
use softplug_conformance::{Blessing, Case, Judge, Lost, blessing};
use softplug_trace::Time;

use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::numbers;
use crate::screen::Screen;

/// Places of one trace that are told.
const SHOWN: usize = 5;

/// What machines get.
#[derive(Serialize)]
struct Document {
    traces: usize,
    blessed: Vec<String>,
    /// What stood on `>` lines and is no longer sent.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    lost: Vec<JsonLost>,
    /// What is not as somebody who blesses may think.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    notes: Vec<String>,
}

#[derive(Serialize)]
struct JsonLost {
    file: String,
    line: u32,
    at: String,
    recorded: String,
    sent: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    sent_at: Option<String>,
}

pub(super) fn run<'a>(
    judge: &dyn Judge,
    cases: impl Iterator<Item = &'a Case>,
    force: bool,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let mut document =
        Document { traces: 0, blessed: Vec::new(), lost: Vec::new(), notes: Vec::new() };
    let mut all = Vec::new();
    // All are looked at before one is written.
    for case in cases {
        document.traces += 1;
        let blessing = blessing(judge, case).map_err(|error| {
            Failure::new(Exit::Failed, format_args!("{}: {error}", case.path.display()))
        })?;
        let file = case.path.display().to_string();
        document.lost.extend(blessing.lost.iter().map(|lost| JsonLost::new(&file, lost)));
        all.push((case, file, blessing));
    }
    let name = &judge.manifest().name;
    let refused = if force { 0 } else { all.iter().filter(|(.., b)| !b.lost.is_empty()).count() };
    for (case, file, blessing) in &all {
        tell(name, file, blessing, force, screen);
        for note in notes(name, file, blessing) {
            screen.note(format_args!("note: {note}"));
            document.notes.push(note);
        }
        let text = blessing.trace.format();
        if refused == 0 && text != files::read_text(&case.path)? {
            files::replace(&case.path, text.as_bytes())?;
            screen.say(file);
            document.blessed.push(file.clone());
        }
    }
    screen.document(&document);
    if refused == 0 {
        return Ok(Exit::Done);
    }
    screen.error(format_args!(
        "nothing was written: by blessing, {} would lose bytes that stand there as sent",
        numbers::things(refused as u64, "trace")
    ));
    screen.report(
        "look first whether settings (config), requests (?) and the line are those of the session, \
         and whether it is the plug-in that was recorded; --force takes what is sent now",
    );
    Ok(Exit::Failed)
}

/// Says what a trace loses.
fn tell(name: &str, file: &str, blessing: &Blessing, force: bool, screen: &Screen) {
    let Blessing { lost, lost_bytes, stood, .. } = blessing;
    if lost.is_empty() {
        return;
    }
    let begin = if force { "note: " } else { "" };
    let (lost_bytes, all) = (numbers::count(*lost_bytes as u64), *stood as u64);
    let all = numbers::things(all, "byte");
    screen.report(format_args!(
        "{begin}{file}: {name} no longer sends {lost_bytes} of {all} that stand there"
    ));
    for lost in lost.iter().take(SHOWN) {
        screen.report(format_args!("  {lost}"));
    }
    if lost.len() > SHOWN {
        let more = numbers::things((lost.len() - SHOWN) as u64, "more place");
        screen.report(format_args!("  and at {more}"));
    }
}

/// What else is not as somebody who blesses may think.
fn notes(name: &str, file: &str, blessing: &Blessing) -> Vec<String> {
    let Blessing { stood, more, more_at, failed, leaves_delivery, .. } = blessing;
    // A trace that says nothing of what is sent is only being written.
    let more = more_at.filter(|_| *stood > 0).map(|at| {
        let more = numbers::things(*more as u64, "byte");
        let at = seconds(at);
        format!("{file}: {name} sends {more} that did not stand there, the first at {at}")
    });
    let failed = failed.iter().map(|(job, at, why)| {
        format!(
            "{file}: job {job} fails at {} ({why}): if it went well on the line, this is no case \
             of it",
            seconds(*at)
        )
    });
    let left = leaves_delivery.then(|| {
        format!(
            "{file}: a delivery is under way at the end, into which the bytes of the next case would \
             go: let it end, or say so in the head: leaves: a delivery under way"
        )
    });
    more.into_iter().chain(failed).chain(left).collect()
}

impl JsonLost {
    fn new(file: &str, lost: &Lost) -> Self {
        let hex = |bytes: &[u8]| {
            bytes.iter().map(|byte| format!("{byte:02X}")).collect::<Vec<_>>().join(" ")
        };
        Self {
            file: file.to_owned(),
            line: lost.line,
            at: seconds(lost.at),
            recorded: hex(&lost.recorded),
            sent: hex(&lost.sent),
            sent_at: lost.sent_at.map(seconds),
        }
    }
}

fn seconds(at: Micros) -> String {
    format!("{} s", Time(at.0.max(0) as u64))
}
