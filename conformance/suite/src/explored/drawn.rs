//! A way that an exploration found, as rows: who did what, and what came of each character.

use softplug_abi::Micros;
use softplug_explore::{Log, Way};
use softplug_link::Observed;
use softplug_models::{Given, HostRequest, LineInput, Step};
use softplug_report::{Drawn, Side};
use std::fmt::Write as _;

/// A way from the top down.
///
/// The example of [`traces_of_way`](crate::traces_of_way) looks for one.
pub fn rows_of_way(begin: Micros, way: &Way) -> Vec<Drawn> {
    let row = |at: Micros, side, text| Drawn { at_us: at.0 - begin.0, side, text };
    let faults = way.faults.iter().map(|(at, choice)| row(*at, Side::Line, choice.to_string()));
    let mut rows: Vec<Drawn> = faults.collect();
    for (log, side) in way.logs.iter().zip([Side::Plugin, Side::Partner]) {
        rows.extend(said(log).into_iter().map(|(at, text)| row(at, side, text)));
    }
    rows.sort_by_key(|row| row.at_us);
    rows
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
