//! A sequence diagram for the terminal: who did what, and what came of each character.

use std::fmt::Write as _;

use softplug_abi::Micros;
use softplug_explore::{Exploration, Input, Log};
use softplug_link::Observed;

/// Width of what each end says beside its line.
const SIDE: usize = 34;

/// The way that an exploration found, from the top down.
pub(crate) fn drawn(explored: &Exploration) -> String {
    let Some(way) = &explored.counterexample else { return String::new() };
    let mut events: Vec<(Micros, usize, String)> = Vec::new();
    for (end, log) in way.logs.iter().enumerate() {
        events.extend(said(log).into_iter().map(|(at, text)| (at, end, text)));
    }
    events.sort_by_key(|(at, ..)| *at);
    let mut drawing = format!("  {:>10}  {:<SIDE$}|{:>SIDE$}\n", "s", "plug-in", partner(way.logs.len()));
    for (at, end, text) in events {
        let time = (at.0 - explored.begin.0) as f64 / 1e6;
        let (left, right) = if end == 0 { (text.as_str(), "") } else { ("", text.as_str()) };
        let _ = writeln!(drawing, "  {time:>10.6}  {left:<SIDE$}|{right:>SIDE$}");
    }
    drawing.truncate(drawing.trim_end().len());
    drawing
}

fn partner(plug_ins: usize) -> &'static str {
    if plug_ins == 2 { "second plug-in" } else { "partner" }
}

fn said(log: &Log) -> Vec<(Micros, String)> {
    let given = log.inputs.iter().map(|(at, input)| (*at, given(input)));
    let did = log.observed().iter().filter_map(|(at, observed)| Some((*at, did(observed)?)));
    // At one time, what is given comes first.
    let mut all: Vec<_> = given.chain(did).collect();
    all.sort_by_key(|(at, _)| *at);
    all
}

fn given(input: &Input) -> String {
    match input {
        Input::Byte(byte) => format!("-> {byte:02X}"),
        Input::Damaged(kind, Some(byte)) => format!("-> {byte:02X} ({})", kind.name()),
        Input::Damaged(kind, None) => format!("-> {}", kind.name()),
        Input::Job { id, data, .. } => format!("job {id}:{}", bytes(data)),
        Input::Abort(0) => "abort the delivery".to_owned(),
        Input::Abort(job) => format!("abort job {job}"),
        Input::Pause(job) => format!("pause job {job}"),
        Input::Resume(job) => format!("resume job {job}"),
        Input::Force => "force".to_owned(),
        Input::Grant(request, _) => format!("grant request {request}"),
        Input::Down => "port gone".to_owned(),
        Input::Up => "port back".to_owned(),
        Input::Swap => "new instance takes over".to_owned(),
    }
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
    data.iter().map(|byte| format!(" {byte:02X}")).collect()
}
