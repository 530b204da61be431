//! What a trace demands of a plug-in, line by line.

use crate::given::case::Case;
use crate::given::fields::records;
use crate::given::lines::modem_lines;
use crate::given::timeline::{NotPossible, TimelineError, micros};
use crate::run::seen::{Channel, channel};
use softplug_abi::manifest::Manifest;
use softplug_abi::{DeliveryId, JobId, Micros, RequestId};
use softplug_link::{Delivery, Observed};
use softplug_trace::{Entry, Expected, Payload, What};

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
    /// This has to be seen. What has left for a job is looked at only if it is counted.
    Once { what: Observed, is_counted: bool },
}

impl Demand {
    /// How many things it takes to be seen.
    pub(crate) fn length(&self) -> usize {
        match &self.what {
            Demanded::Bytes(bytes) => bytes.len(),
            Demanded::Once { .. } => 1,
        }
    }

    /// The thing with this number, from 0.
    pub(crate) fn thing(&self, number: usize) -> Observed {
        match &self.what {
            Demanded::Bytes(bytes) => Observed::Byte(bytes[number]),
            Demanded::Once { what, .. } => what.clone(),
        }
    }

    pub(crate) fn channel(&self) -> Option<Channel> {
        match &self.what {
            Demanded::Bytes(_) => Some(Channel::Wire),
            Demanded::Once { what, .. } => channel(what),
        }
    }

    pub(crate) fn is_counted(&self) -> bool {
        !matches!(self.what, Demanded::Once { is_counted: false, .. })
    }

    /// Whether `observed` is the thing with this number.
    pub(crate) fn allows(&self, number: usize, observed: &Observed) -> bool {
        match (&self.what, observed) {
            (Demanded::Bytes(bytes), observed) => *observed == Observed::Byte(bytes[number]),
            (
                Demanded::Once { what: Observed::Done { job, .. }, is_counted: false },
                Observed::Done { job: own, .. },
            ) => job == own,
            (
                Demanded::Once {
                    what: Observed::Failed { job, failure, status, .. },
                    is_counted: false,
                },
                Observed::Failed { job: own, failure: why, status: code, .. },
            ) => (job, failure, status) == (own, why, code),
            (Demanded::Once { what, .. }, observed) => what == observed,
        }
    }
}

/// Everything that one timeline of events of a trace demands.
pub(crate) fn demands(
    case: &Case,
    manifest: &Manifest,
    timeline: &[&Entry],
) -> Result<Vec<Demand>, TimelineError> {
    let demand = |entry: &&Entry| {
        let What::Expected(expected) = &entry.what else { return None };
        let (from, to, line) = (micros(entry.when.from), micros(entry.when.to), entry.line.0);
        let what = demanded(case, manifest, expected).map_err(|error| error.at(line));
        Some(what.map(|what| Demand { from, to, line, what }))
    };
    timeline.iter().filter_map(demand).collect()
}

fn demanded(
    case: &Case,
    manifest: &Manifest,
    expected: &Expected,
) -> Result<Demanded, NotPossible> {
    let bytes = |payload: &Payload| payload.bytes(&case.files());
    let mut is_counted = true;
    let mut count = |sent: &Option<u64>| {
        is_counted = sent.is_some();
        sent.unwrap_or(0)
    };
    let what = match expected {
        Expected::Send(payload) => return Ok(Demanded::Bytes(bytes(payload)?)),
        Expected::SendBreak(micros) => Observed::Break(*micros),
        Expected::SetLines(levels) => {
            let (named, on) = modem_lines(levels);
            Observed::ModemLines(named, on)
        }
        Expected::Deliver { id, data, failure, status, name } => Observed::Delivery(Delivery {
            id: DeliveryId(*id),
            job: JobId::NONE,
            bytes: bytes(data)?,
            name: name.clone(),
            failure: *failure,
            status: *status,
        }),
        Expected::Done { id, sent } => Observed::Done { job: JobId(*id), sent: count(sent) },
        Expected::Fail { id, failure, status, sent } => Observed::Failed {
            job: JobId(*id),
            failure: *failure,
            status: *status,
            sent: count(sent),
        },
        Expected::Check { id, failure, status, line, column } => Observed::Checked {
            job: JobId(*id),
            failure: *failure,
            status: *status,
            line: *line,
            column: *column,
        },
        Expected::Request { id, kind, fields } => {
            let place = manifest.requests.iter().position(|known| known.name == *kind);
            let place = place.ok_or_else(|| NotPossible::Request(kind.clone()))?;
            let fields = records(&manifest.requests[place], fields)?;
            Observed::Request { request: RequestId(*id), kind: place as u16, fields }
        }
        Expected::Withdraw(id) => Observed::Withdraw(RequestId(*id)),
    };
    Ok(Demanded::Once { what, is_counted })
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_abi::Failure;

    fn failed(job: u32, failure: Failure, status: u16, sent: u64) -> Observed {
        Observed::Failed { job: JobId(job), failure, status, sent }
    }

    fn done(job: u32, sent: u64) -> Observed {
        Observed::Done { job: JobId(job), sent }
    }

    fn demand(what: Observed, is_counted: bool) -> Demand {
        let what = Demanded::Once { what, is_counted };
        Demand { from: Micros::ZERO, to: Micros::ZERO, line: 0, what }
    }

    #[test]
    fn only_a_count_that_is_not_named_is_open() {
        let open = demand(failed(1, Failure::NoAnswer, 7, 0), false);
        assert!(open.allows(0, &failed(1, Failure::NoAnswer, 7, 3)));
        assert!(!open.allows(0, &failed(2, Failure::NoAnswer, 7, 3)));
        assert!(!open.allows(0, &failed(1, Failure::Refused, 7, 3)));
        assert!(!open.allows(0, &failed(1, Failure::NoAnswer, 8, 3)));
        let exact = demand(failed(1, Failure::NoAnswer, 7, 3), true);
        assert!(!exact.allows(0, &failed(1, Failure::NoAnswer, 7, 4)));
        assert!(demand(done(1, 0), false).allows(0, &done(1, 3)));
        assert!(!demand(done(1, 0), false).allows(0, &done(2, 3)));
        assert!(!demand(done(1, 3), true).allows(0, &done(1, 4)));
    }
}
