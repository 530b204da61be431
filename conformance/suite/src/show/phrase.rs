//! Events and actions of the ABI in words, and whom they concern.

use serde::Serialize;
use softplug_abi::manifest::{Kind, Manifest};
use softplug_abi::{Action, Event, JobId, MarkId, Micros, ModemLines, Parity, Pass};
use std::fmt::Write as _;

/// Who is at the other end of an event or an action.
///
/// The example of [`Stepper`](crate::Stepper) shows one.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Other {
    /// The machine at the far end of the line.
    Line,
    /// Whoever sends and receives programs.
    Host,
    /// The plug-in's own link: timers, room, marks, settings.
    Link,
}

/// An event or an action, for people.
///
/// The example of [`Stepper`](crate::Stepper) shows one.
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Phrase {
    /// Who gives the event, or whom the action concerns.
    pub other: Other,
    /// In words, without its bytes.
    pub text: String,
    /// The bytes that it carries; none where there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub bytes: Vec<u8>,
}

impl Phrase {
    fn new(other: Other, text: impl Into<String>) -> Self {
        Self { other, text: text.into(), bytes: Vec::new() }
    }

    fn with(self, bytes: &[u8]) -> Self {
        Self { bytes: bytes.to_vec(), ..self }
    }

    /// An event.
    pub(crate) fn of_event(event: &Event<'_>, manifest: &Manifest) -> Self {
        let name = event.kind().name();
        let line = |text: String| Self::new(Other::Line, text);
        let host = |text: String| Self::new(Other::Host, text);
        let link = |text: String| Self::new(Other::Link, text);
        match event {
            Event::Settings { values, .. } => {
                let count = values.clone().flatten().count();
                link(format!("settings, {count} of them"))
            }
            Event::Open { resumed, line, transmit_room, delivery_room } => {
                let again = if *resumed { "resumed, " } else { "" };
                let parity = match line.parity {
                    Parity::None => 'N',
                    Parity::Even => 'E',
                    Parity::Odd => 'O',
                    Parity::Mark => 'M',
                    Parity::Space => 'S',
                };
                let stop = f64::from(line.stop_half_bits) / 2.0;
                link(format!(
                    "open: {again}{} Bd {}{parity}{stop}, room to transmit {transmit_room}, to deliver {delivery_room}",
                    line.baud, line.data_bits
                ))
            }
            Event::Received(bytes) => line(name.to_owned()).with(bytes),
            Event::LineError { kind, byte, span } => {
                let text = match span {
                    0 => format!("{name}: {kind}"),
                    span => format!("{name}: {kind}, in the last {span} bytes"),
                };
                line(text).with(byte.as_slice())
            }
            Event::ModemLines { known, on } => line(format!("modem lines {}", levels(*known, *on))),
            Event::LinkDown(reason) => line(format!("{name}: {reason}")),
            Event::LinkUp => line(name.to_owned()),
            Event::Timer { id, .. } => link(format!("timer {id} runs out")),
            Event::Mark { mark, state } => link(format!("mark {mark} {state}")),
            Event::TransmitRoom { grown } => link(format!("room to transmit +{grown}")),
            Event::Discarded { bytes } => link(format!("{name} {bytes} bytes")),
            Event::DeliveryRoom { grown } => link(format!("room to deliver +{grown}")),
            Event::JobBegin { job, kind, pass, size, fields } => {
                let mut text = format!("job {job} {}", kind_name(&manifest.jobs, *kind));
                text.push_str(&named(&manifest.jobs, *kind, fields.as_bytes()));
                if let Some(size) = size {
                    let _ = write!(text, ", {size} bytes");
                }
                if *pass == Pass::Check {
                    text.push_str(", to be checked");
                }
                host(text)
            }
            Event::JobData { job, bytes } => host(format!("data of job {job}")).with(bytes),
            Event::JobEnd { job } => host(format!("end of job {job}'s data")),
            Event::Abort { job: JobId::NONE } => host("abort the delivery".to_owned()),
            Event::Pause { job } | Event::Resume { job } | Event::Abort { job } => {
                host(format!("{name} job {job}"))
            }
            Event::ForceResume => host("force-resume".to_owned()),
            Event::Answer { request, refused, bytes, .. } => {
                let text = match refused {
                    None => format!("request {request} granted"),
                    Some(failure) => format!("request {request} refused: {failure}"),
                };
                host(text).with(bytes)
            }
            Event::Restore { format, offset, total, bytes } => {
                let end = *offset as usize + bytes.len();
                link(format!("restore format {format}, bytes {offset} to {end} of {total}"))
            }
            Event::Close | Event::Save | Event::Continue => link(name.to_owned()),
        }
    }

    /// An action; times are told on a clock that began at `since`.
    pub(crate) fn of_action(action: &Action<'_>, manifest: &Manifest, since: Micros) -> Self {
        let line = |text: String| Self::new(Other::Line, text);
        let host = |text: String| Self::new(Other::Host, text);
        let link = |text: String| Self::new(Other::Link, text);
        let marked = |mark: &MarkId| {
            if *mark == MarkId::NONE { String::new() } else { format!(", mark {mark}") }
        };
        match action {
            Action::Transmit { mark, bytes } => {
                line(format!("transmit{}", marked(mark))).with(bytes)
            }
            Action::TransmitUrgent { mark, bytes } => {
                line(format!("transmit at once{}", marked(mark))).with(bytes)
            }
            Action::Hold => line("hold".to_owned()),
            Action::Release => line("release".to_owned()),
            Action::Discard => line("discard what is queued".to_owned()),
            Action::ModemLines { mask, on } => line(format!("set {}", levels(*mask, *on))),
            Action::Break { micros } => line(format!("break of {micros} µs")),
            Action::SetTimer { id, deadline } => {
                link(format!("timer {id} until {}", *deadline - since))
            }
            Action::CancelTimer { id } => link(format!("cancel timer {id}")),
            Action::Want { job, bytes } => host(format!("want {bytes} bytes of job {job}")),
            Action::DeliveryBegin { delivery, job: JobId::NONE } => {
                host(format!("delivery {delivery} begins"))
            }
            Action::DeliveryBegin { delivery, job } => {
                host(format!("delivery {delivery} begins, for job {job}"))
            }
            Action::Deliver { delivery, bytes } => host(format!("deliver {delivery}")).with(bytes),
            Action::DeliveryName { delivery, name } => {
                host(format!("delivery {delivery} is called \"{}\"", name.escape_debug()))
            }
            Action::DeliveryEnd { delivery, failure: None, .. } => {
                host(format!("delivery {delivery} complete"))
            }
            Action::DeliveryEnd { delivery, failure: Some(failure), status } => {
                host(format!("delivery {delivery} failed: {failure}{}", code(*status)))
            }
            Action::JobDone { job, sent } => host(format!("job {job} done, {sent} bytes sent")),
            Action::JobFailed { job, failure, status, sent } => {
                host(format!("job {job} failed: {failure}{}, {sent} bytes sent", code(*status)))
            }
            Action::CheckResult { job, failure: None, .. } => {
                host(format!("job {job} checked: good"))
            }
            Action::CheckResult { job, failure: Some(failure), status, line, column } => {
                host(format!(
                    "job {job} checked: {failure}{} at line {line}, column {column}",
                    code(*status)
                ))
            }
            Action::Request { request, kind, fields } => host(format!(
                "request {request} {}{}",
                kind_name(&manifest.requests, *kind),
                named(&manifest.requests, *kind, fields.as_bytes())
            )),
            Action::Withdraw { request } => host(format!("withdraw request {request}")),
            Action::Note { level, code: own, text } => {
                link(format!("note ({level}{}): {}", code(*own), text.escape_debug()))
            }
            Action::State { name } => link(format!("state: {}", name.escape_debug())),
            Action::Saved { format, offset, total, bytes } => {
                let end = *offset as usize + bytes.len();
                link(format!("saved format {format}, bytes {offset} to {end} of {total}"))
            }
        }
    }
}

fn kind_name(kinds: &[Kind], place: u16) -> &str {
    kinds.get(usize::from(place)).map_or("of an unknown kind", |kind| &kind.name)
}

/// The fields as ` name=value`.
fn named(kinds: &[Kind], place: u16, records: &[u8]) -> String {
    let fields = kinds.get(usize::from(place)).map(|kind| kind.assignments(records));
    let mut text = String::new();
    for (name, value) in fields.unwrap_or_default() {
        let _ = write!(text, " {name}={}", value.escape_debug());
    }
    text
}

fn levels(known: ModemLines, on: ModemLines) -> String {
    const NAMES: [(ModemLines, &str); 6] = [
        (ModemLines::RTS, "rts"),
        (ModemLines::DTR, "dtr"),
        (ModemLines::CTS, "cts"),
        (ModemLines::DSR, "dsr"),
        (ModemLines::DCD, "dcd"),
        (ModemLines::RI, "ri"),
    ];
    let named = NAMES.iter().filter(|(line, _)| known.contains(*line));
    let shown =
        named.map(|(line, name)| format!("{name}{}", if on.contains(*line) { '+' } else { '-' }));
    shown.collect::<Vec<_>>().join(" ")
}

/// The protocol's own code, if there is one.
fn code(status: u16) -> String {
    if status == 0 { String::new() } else { format!(" ({status:04X})") }
}
