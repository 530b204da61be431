//! Every call of the ABI in a replay, for hosts written in other languages: `docs/hosts/README.md`.

use data_encoding::HEXLOWER;
use serde::Serialize;
use softplug_abi::MORE_OUTPUT;
use softplug_conformance::{self as conformance, Case};

use crate::plugin::Chosen;

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
struct Call<'a> {
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
    fault: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    last_words: Option<&'a str>,
}

/// The calls of these traces, each run as it is written, as JSON lines. Instances are
/// numbered through.
pub(super) fn of<'a>(plugin: &Chosen, cases: impl Iterator<Item = &'a Case>) -> Vec<u8> {
    let mut lines = Vec::new();
    let sha256 = match plugin {
        Chosen::Sandboxed(plugin) => Some(plugin.digest().to_string()),
        #[cfg(feature = "native")]
        Chosen::Native(..) => None,
    };
    let mut instances = 0;
    for case in cases {
        let earlier = instances;
        for call in plugin.calls(case) {
            let instance = earlier + call.instance;
            if instance > instances {
                instances = instance;
                let sha256 = sha256.clone();
                let (plugin, trace) = (&plugin.manifest().name, &case.trace.front.id);
                push(&mut lines, &Head { calls: 1, instance, plugin, sha256, trace });
            }
            push(&mut lines, &Call::of(&call, instance));
        }
    }
    lines
}

impl<'a> Call<'a> {
    fn of(call: &'a conformance::Call, instance: u32) -> Self {
        let length = i32::try_from(call.actions.len()).expect("no longer than the buffer");
        let result = match (call.refusal, &call.fault) {
            (Some(refusal), _) => Some(-i32::from(refusal.code())),
            (None, Some(_)) => None,
            (None, None) => Some(if call.more { length | MORE_OUTPUT } else { length }),
        };
        Self {
            instance,
            kind: call.event.code(),
            name: call.event.name(),
            now: call.now.0,
            payload: HEXLOWER.encode(&call.payload),
            result,
            actions: HEXLOWER.encode(&call.actions),
            fault: call.fault.as_deref().filter(|_| call.refusal.is_none()),
            last_words: call.last_words.as_deref(),
        }
    }
}

fn push(lines: &mut Vec<u8>, line: &impl Serialize) {
    serde_json::to_writer(&mut *lines, line).expect("numbers and texts are JSON");
    lines.push(b'\n');
}
