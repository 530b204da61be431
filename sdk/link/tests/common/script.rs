//! The scripted plug-in.

use softplug_abi::manifest::SettingValues;
use softplug_abi::{Action, ActionWriter, Event, Instance, Micros, Output, Pass, Refusal, Value};
use std::cell::RefCell;
use std::rc::Rc;

/// What one event is answered with.
#[derive(Clone, Debug, Default)]
struct Reply {
    bytes: Vec<u8>,
    more: bool,
    refused: bool,
}

#[derive(Debug)]
struct Entry {
    /// Beginning of the event's description.
    event: String,
    reply: Reply,
    once: bool,
}

/// The script, and what the plug-in was given; a handle that tests keep.
#[derive(Clone, Debug, Default)]
pub(crate) struct Script {
    entries: Rc<RefCell<Vec<Entry>>>,
    seen: Rc<RefCell<Vec<(i64, String)>>>,
}

impl Script {
    /// Answers every event whose description begins so.
    pub(crate) fn on(&self, event: &str, actions: &[Action<'_>]) {
        self.add(event, Reply { bytes: encode(actions), ..Reply::default() }, false);
    }

    /// Answers the next event whose description begins so.
    pub(crate) fn once(&self, event: &str, actions: &[Action<'_>]) {
        self.add(event, Reply { bytes: encode(actions), ..Reply::default() }, true);
    }

    /// Like [`once`](Self::once), with more output to come.
    pub(crate) fn once_more(&self, event: &str, actions: &[Action<'_>]) {
        self.add(event, Reply { bytes: encode(actions), more: true, refused: false }, true);
    }

    /// Answers every event that begins so with more output to come.
    pub(crate) fn on_more(&self, event: &str, actions: &[Action<'_>]) {
        self.add(event, Reply { bytes: encode(actions), more: true, refused: false }, false);
    }

    /// Answers the next event that begins so with these bytes.
    pub(crate) fn once_raw(&self, event: &str, bytes: &[u8]) {
        self.add(event, Reply { bytes: bytes.to_vec(), ..Reply::default() }, true);
    }

    /// Refuses every event that begins so.
    pub(crate) fn refuse(&self, event: &str) {
        self.add(event, Reply { refused: true, ..Reply::default() }, false);
    }

    fn add(&self, event: &str, reply: Reply, once: bool) {
        self.entries.borrow_mut().push(Entry { event: event.to_owned(), reply, once });
    }

    /// What the plug-in was given since the last look, with times in µs.
    pub(crate) fn take(&self) -> Vec<(i64, String)> {
        self.seen.take()
    }

    /// An instance that follows this script, with an input buffer of 512 bytes.
    pub(crate) fn plugin(&self) -> Plugin {
        Plugin { script: self.clone(), output: Vec::new() }
    }

    fn reply(&self, description: &str) -> Reply {
        let mut entries = self.entries.borrow_mut();
        let found = entries.iter().position(|entry| description.starts_with(&entry.event));
        let Some(at) = found else { return Reply::default() };
        if entries[at].once { entries.remove(at).reply } else { entries[at].reply.clone() }
    }
}

fn encode(actions: &[Action<'_>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for action in actions {
        let mut buffer = [0; 4_096];
        let mut writer = ActionWriter::new(&mut buffer);
        writer.push(action).expect("an action of a test fits 4 KiB");
        bytes.extend(writer.written());
    }
    bytes
}

/// An instance that follows a script.
#[derive(Debug)]
pub(crate) struct Plugin {
    script: Script,
    output: Vec<u8>,
}

/// The script refuses the event.
#[derive(Copy, Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the script refuses it: {}", .0.text())]
pub(crate) struct Refused(Refusal);

impl Instance for Plugin {
    type Fault = Refused;

    fn input_capacity(&self) -> usize {
        512
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Refused> {
        let mut payload = [0; 512];
        event.encode(&mut payload).expect("every event fits the input buffer");
        let description = describe(event);
        self.script.seen.borrow_mut().push((now.0, description.clone()));
        let reply = self.script.reply(&description);
        if reply.refused {
            return Err(Refused(Refusal::Settings));
        }
        self.output = reply.bytes;
        Ok(Output { actions: &self.output, more: reply.more })
    }
}

/// One line on an event.
pub(crate) fn describe(event: &Event<'_>) -> String {
    let text = |bytes: &[u8]| format!("\"{}\"", bytes.escape_ascii());
    let name = event.kind().name();
    match event {
        Event::Settings { first, last, values } => {
            let shown = |value: &Value<'_>| match value {
                Value::Bool(value) => value.to_string(),
                Value::Int(value) => value.to_string(),
                Value::Text(value) => (*value).to_owned(),
                Value::Bytes(value) => text(value),
                Value::Choice(value) => format!("#{value}"),
            };
            let mut line = format!("{name} first={first} last={last}");
            for value in values.clone() {
                let (index, value) = value.expect("the host gives whole records");
                line = [line, format!(" {index}={}", shown(&value))].concat();
            }
            line
        }
        Event::Open { resumed, transmit_room, delivery_room, .. } => {
            let how = if *resumed { "resumed" } else { "new" };
            format!("{name} {how} transmit={transmit_room} delivery={delivery_room}")
        }
        Event::Received(bytes) => format!("{name} {}", text(bytes)),
        Event::LineError { kind, byte, span } => {
            let byte = byte.map_or("none".to_owned(), |byte| format!("{byte:02x}"));
            format!("{name} {kind} byte={byte} span={span}")
        }
        Event::ModemLines { known, on } => format!("{name} known={} on={}", known.0, on.0),
        Event::LinkDown(reason) => format!("{name} {reason}"),
        Event::Timer { id, deadline } => format!("{name} {id} set for {}", deadline.0),
        Event::Mark { mark, state } => format!("{name} {mark} {state}"),
        Event::TransmitRoom { grown } | Event::DeliveryRoom { grown } => format!("{name} {grown}"),
        Event::Discarded { bytes } => format!("{name} {bytes}"),
        Event::JobBegin { job, pass, .. } => {
            let pass = if *pass == Pass::Check { "check" } else { "run" };
            format!("{name} {job} {pass}")
        }
        Event::JobData { job, bytes } => format!("{name} {job} {}", text(bytes)),
        Event::JobEnd { job }
        | Event::Pause { job }
        | Event::Resume { job }
        | Event::Abort { job } => {
            format!("{name} {job}")
        }
        Event::Answer { request, refused: Some(failure), more, bytes } => {
            format!("{name} {request} refused {failure} more={more} {}", text(bytes))
        }
        Event::Answer { request, refused: None, more, bytes } => {
            format!("{name} {request} more={more} {} bytes", bytes.len())
        }
        Event::Restore { format, offset, total, bytes } => {
            format!("{name} {format} {offset}+{}/{total}", bytes.len())
        }
        Event::Close | Event::LinkUp | Event::ForceResume | Event::Save | Event::Continue => {
            name.to_owned()
        }
    }
}

/// The values of a manifest with these settings (JSON objects, one after the other).
pub(crate) fn setting_values(settings: &str, asked: &[(&str, &str)]) -> SettingValues {
    let json = format!(
        r#"{{"abi":"1.0","name":"t","version":"1","licence":"MIT","protocol":"t","description":"t",
        "settings":[{settings}],
        "presets":[{{"name":"other","text":"t","values":{{"b":7,"c":8}}}}]}}"#
    );
    let manifest = softplug_abi::manifest::Manifest::parse(json.as_bytes())
        .expect("the test's manifest is right");
    manifest.resolve_settings(asked.iter().copied()).expect("the test's settings are right")
}
