//! Every call of the ABI in a replay, for hosts written in other languages: `docs/hosts/README.md`.

use std::cell::{Cell, RefCell};
use std::error::Error;
use std::rc::Rc;

use serde::Serialize;
use softplug_abi::limits::INPUT_BYTES;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Event, Instance, MORE_OUTPUT, Micros, Output};
use softplug_conformance::{Case, Permutation, Subject, SubjectError, replay};
use softplug_host::SessionFault;

use crate::dump::hex;
use crate::plugin::{AnyFault, AnyInstance, Chosen};

/// A new instance begins here.
#[derive(Serialize)]
struct Head<'a> {
    /// The form of these lines.
    calls: u32,
    /// Its number; a trace that swaps has two at once.
    instance: u32,
    plugin: &'a str,
    #[serde(skip_serializing_if = "Option::is_none")]
    sha256: Option<String>,
    trace: &'a str,
}

/// One call of `softplug_v1_step`.
#[derive(Serialize)]
struct Call {
    instance: u32,
    kind: u16,
    name: &'static str,
    now: i64,
    /// As hex digits.
    payload: String,
    /// As it was returned; none where the instance ended instead.
    #[serde(skip_serializing_if = "Option::is_none")]
    result: Option<i32>,
    /// As hex digits.
    actions: String,
    /// How the instance ended.
    #[serde(skip_serializing_if = "Option::is_none")]
    fault: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    last_words: Option<String>,
}

/// The calls of these traces, each run as it is written, as JSON lines.
pub(super) fn of<'a>(plugin: &Chosen, cases: impl Iterator<Item = &'a Case>) -> Vec<u8> {
    let lines = Rc::new(RefCell::new(Vec::new()));
    let instances = Cell::new(0);
    for case in cases {
        let subject = Overheard {
            plugin,
            trace: &case.trace.front.id,
            lines: lines.clone(),
            instances: &instances,
        };
        replay(&subject, case, Permutation::Uncut, 0);
    }
    lines.take()
}

/// A plug-in whose instances write down their calls.
struct Overheard<'a> {
    plugin: &'a Chosen,
    trace: &'a str,
    lines: Rc<RefCell<Vec<u8>>>,
    instances: &'a Cell<u32>,
}

impl Subject for Overheard<'_> {
    type Instance = OverheardInstance;

    fn instantiate(&self) -> Result<Self::Instance, SubjectError> {
        let instance = self.plugin.instantiate();
        let instance =
            instance.map_err(|failure| Box::<dyn Error + Send + Sync>::from(failure.message))?;
        let sha256 = match self.plugin {
            Chosen::Sandboxed(plugin) => Some(plugin.digest().to_string()),
            #[cfg(feature = "native")]
            Chosen::Native(..) => None,
        };
        let plugin = &self.manifest().name;
        let number = self.instances.get() + 1;
        self.instances.set(number);
        let head = Head { calls: 1, instance: number, plugin, sha256, trace: self.trace };
        push(&self.lines, &head);
        Ok(OverheardInstance { instance, number, lines: self.lines.clone() })
    }

    fn manifest(&self) -> &Manifest {
        self.plugin.manifest()
    }

    fn label(&self) -> &str {
        &self.manifest().name
    }
}

struct OverheardInstance {
    instance: AnyInstance,
    number: u32,
    lines: Rc<RefCell<Vec<u8>>>,
}

impl Instance for OverheardInstance {
    type Fault = AnyFault;

    fn input_capacity(&self) -> usize {
        self.instance.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, AnyFault> {
        let mut payload = vec![0; *INPUT_BYTES.end() as usize];
        let length = event.encode(&mut payload).unwrap_or(0);
        let kind = event.kind();
        let mut call = Call {
            instance: self.number,
            kind: kind.code(),
            name: kind.name(),
            now: now.0,
            payload: hex(&payload[..length]),
            result: None,
            actions: String::new(),
            fault: None,
            last_words: None,
        };
        let stepped = self.instance.step(event, now);
        match &stepped {
            Ok(Output { actions, more }) => {
                let length = i32::try_from(actions.len()).expect("no longer than the buffer");
                call.result = Some(if *more { length | MORE_OUTPUT } else { length });
                call.actions = hex(actions);
            }
            Err(AnyFault::Sandboxed(SessionFault::Refused { refusal, .. })) => {
                call.result = Some(-i32::from(refusal.code()));
            }
            Err(fault) => {
                if let AnyFault::Sandboxed(SessionFault::Trapped { last_words, .. }) = fault {
                    call.last_words.clone_from(last_words);
                }
                call.fault = Some(fault.to_string());
            }
        }
        push(&self.lines, &call);
        stepped
    }
}

fn push(lines: &RefCell<Vec<u8>>, line: &impl Serialize) {
    let mut lines = lines.borrow_mut();
    serde_json::to_writer(&mut *lines, line).expect("numbers and texts are JSON");
    lines.push(b'\n');
}
