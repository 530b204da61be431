//! A sequence diagram for the terminal: who did what, and what came of each character.

use std::fmt::Write as _;

use softplug_abi::Micros;
use softplug_explore::{Exploration, Log, Way};
use softplug_link::Observed;
use softplug_models::{Given, HostRequest, LineInput, Step};

/// Width of what each end says beside its line.
const SIDE: usize = 34;

/// The way that an exploration found, from the top down.
pub(crate) fn drawn(explored: &Exploration, way: &Way) -> String {
    let faults = way.faults.iter().map(|(at, choice)| (*at, Row::Fault(choice.to_string())));
    let mut rows: Vec<(Micros, Row)> = faults.collect();
    for (end, log) in way.logs.iter().enumerate() {
        rows.extend(said(log).into_iter().map(|(at, text)| (at, Row::Said(end, text))));
    }
    rows.sort_by_key(|(at, _)| *at);
    let head = partner(way.logs.len());
    let mut drawing = format!("  {:>10}  {:<SIDE$}|{head:>SIDE$}\n", "s", "plug-in (0)");
    for (at, row) in rows {
        let time = (at.0 - explored.begin.0) as f64 / 1e6;
        let _ = match row {
            Row::Said(0, text) => writeln!(drawing, "  {time:>10.6}  {text:<SIDE$}|"),
            Row::Said(_, text) => writeln!(drawing, "  {time:>10.6}  {:<SIDE$}|{text:>SIDE$}", ""),
            Row::Fault(text) => {
                let text = format!(" {text} ");
                writeln!(drawing, "  {time:>10.6}  {text:*^width$}", width = 2 * SIDE + 1)
            }
        };
    }
    drawing.truncate(drawing.trim_end().len());
    drawing
}

/// A line of the drawing.
enum Row {
    /// An end was given something, or did it.
    Said(usize, String),
    /// Something went wrong between them.
    Fault(String),
}

fn partner(plug_ins: usize) -> &'static str {
    if plug_ins == 2 { "second plug-in (1)" } else { "partner (1)" }
}

fn said(log: &Log) -> Vec<(Micros, String)> {
    let given = log.inputs.iter().filter_map(|(at, step)| Some((*at, given(step)?)));
    let did = log.observed.iter().filter_map(|(at, observed)| Some((*at, did(observed)?)));
    // At one time, what is given comes first.
    let mut all: Vec<_> = given.chain(did).collect();
    all.sort_by_key(|(at, _)| *at);
    all
}

fn given(step: &Step) -> Option<String> {
    Some(match step {
        Step::Swap => "new instance takes over".to_owned(),
        Step::Given(Given::Nothing) => return None,
        Step::Given(Given::Line(input)) => match input {
            LineInput::Bytes(data) => format!("->{}", bytes(data)),
            LineInput::Damaged { kind, byte: Some(byte), .. } => {
                format!("-> {byte:02X} ({})", kind.name())
            }
            LineInput::Damaged { kind, .. } => format!("-> {}", kind.name()),
            LineInput::ModemLines(..) => "modem lines".to_owned(),
            LineInput::Down(_) => "port gone".to_owned(),
            LineInput::Up => "port back".to_owned(),
        },
        Step::Given(Given::Host(request)) => match request {
            HostRequest::Open | HostRequest::Close => return None,
            HostRequest::Job { id, data, .. } => format!("job {id}:{}", bytes(data)),
            HostRequest::Pause(job) => format!("pause job {job}"),
            HostRequest::Resume(job) => format!("resume job {job}"),
            HostRequest::Abort(0) => "abort the delivery".to_owned(),
            HostRequest::Abort(job) => format!("abort job {job}"),
            HostRequest::ForceResume => "force".to_owned(),
            HostRequest::Keep | HostRequest::PutAway(_) | HostRequest::PutAllAway => {
                "room".to_owned()
            }
            HostRequest::Answer(request, _) => format!("answer to request {request}"),
        },
    })
}

fn did(observed: &Observed) -> Option<String> {
    Some(match observed {
        Observed::Byte(byte) => format!("<- {byte:02X}"),
        Observed::Delivery(delivery) => match delivery.failure {
            None => format!("DELIVERED{}", bytes(&delivery.bytes)),
            Some(failure) => format!("delivery failed: {}", failure.name()),
        },
        Observed::Done { job, .. } => format!("JOB {job} DONE"),
        Observed::Failed { job, failure, .. } => format!("job {job} failed: {}", failure.name()),
        _ => return None,
    })
}

fn bytes(data: &[u8]) -> String {
    data.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, " {byte:02X}");
        text
    })
}
