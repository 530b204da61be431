//! What a trace demands of a plug-in, line by line.

use crate::given::case::Case;
use crate::given::fields::records;
use crate::given::lines::modem_lines;
use crate::given::timeline::{NotPossible, TimelineError, failure, micros};
use crate::run::effect::{Delivered, Effect};
use softplug_abi::Micros;
use softplug_abi::manifest::Manifest;
use softplug_trace::{Assignment, CheckFault, DeliveryEnd, Entry, Expected, Payload, What};

/// A line of a trace that demands something.
#[derive(Clone, Debug)]
pub(crate) struct Demand {
    pub(crate) from: Micros,
    pub(crate) to: Micros,
    /// The line of the trace's file.
    pub(crate) line: u32,
    pub(crate) what: Demanded,
}

#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Demanded {
    /// Characters back to back.
    Bytes(Vec<u8>),
    Effect(Effect),
}

impl Demand {
    /// How many effects it takes.
    pub(crate) fn length(&self) -> usize {
        match &self.what {
            Demanded::Bytes(bytes) => bytes.len(),
            Demanded::Effect(_) => 1,
        }
    }

    /// The effect with this number, from 0.
    pub(crate) fn effect(&self, number: usize) -> Effect {
        match &self.what {
            Demanded::Bytes(bytes) => Effect::Byte(bytes[number]),
            Demanded::Effect(effect) => effect.clone(),
        }
    }
}

/// Everything that one timeline of events of a trace demands.
pub(crate) fn demands(
    case: &Case,
    manifest: &Manifest,
    timeline: &[&Entry],
) -> Result<Vec<Demand>, TimelineError> {
    let expected = timeline.iter().filter(|entry| entry.what.is_expectation());
    let demand = |entry: &&Entry| {
        let what = demanded(case, manifest, &entry.what).map_err(|error| error.at(entry.line.0))?;
        let (from, to) = (micros(entry.when.from), micros(entry.when.to));
        Ok(Demand { from, to, line: entry.line.0, what })
    };
    expected.map(demand).collect()
}

fn demanded(case: &Case, manifest: &Manifest, what: &What) -> Result<Demanded, NotPossible> {
    let bytes = |payload: &Payload| payload.bytes(&case.files());
    Ok(Demanded::Effect(match what {
        What::Send(payload) => return Ok(Demanded::Bytes(bytes(payload)?)),
        What::SendBreak(micros) => Effect::Break(*micros),
        What::SetLines(levels) => {
            let (named, on) = modem_lines(levels);
            Effect::Lines(named, on)
        }
        What::Act(Expected::Deliver { id, data, end, status, name }) => {
            Effect::Deliver(Delivered {
                id: *id,
                bytes: bytes(data)?,
                failure: match end {
                    DeliveryEnd::Complete => None,
                    DeliveryEnd::Failed(code) => Some(failure(code)?),
                },
                status: status.unwrap_or(0),
                name: name.clone(),
            })
        }
        What::Act(Expected::Done { id, sent }) => Effect::Done { id: *id, sent: *sent },
        What::Act(Expected::Fail { id, code, status, sent }) => Effect::Fail {
            id: *id,
            failure: failure(code)?,
            status: status.unwrap_or(0),
            sent: *sent,
        },
        What::Act(Expected::Check { id, fault }) => check(*id, fault.as_ref())?,
        What::Act(Expected::Request { id, kind, fields }) => request(manifest, *id, kind, fields)?,
        What::Act(Expected::Withdraw(id)) => Effect::Withdraw(*id),
        What::Receive(_)
        | What::Burst(_)
        | What::Line(_)
        | What::Host(_)
        | What::Exact(_)
        | What::Quiet => {
            unreachable!("only expectations are asked for")
        }
    }))
}

fn check(id: u32, fault: Option<&CheckFault>) -> Result<Effect, NotPossible> {
    let Some(fault) = fault else {
        return Ok(Effect::Check { id, failure: None, status: 0, line: 0, column: 0 });
    };
    Ok(Effect::Check {
        id,
        failure: Some(failure(&fault.code)?),
        status: fault.status.unwrap_or(0),
        line: fault.line.unwrap_or(0),
        column: fault.column.unwrap_or(0),
    })
}

fn request(
    manifest: &Manifest,
    id: u32,
    kind: &str,
    fields: &[Assignment],
) -> Result<Effect, NotPossible> {
    let place = manifest.requests.iter().position(|known| known.name == kind);
    let place = place.ok_or_else(|| NotPossible::Request(kind.to_owned()))?;
    let fields = records(&manifest.requests[place], fields)?;
    Ok(Effect::Request { id, kind: place as u16, fields })
}
