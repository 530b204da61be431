//! What a plug-in did that a trace can demand, at its time.

use crate::given::fields::assignments;
use crate::given::lines::{entry, output_levels};
use softplug_abi::manifest::Manifest;
use softplug_abi::{JobId, Micros};
use softplug_link::{Delivery, Observed};
use softplug_trace::{Entry, Expected, Payload, What};
use std::fmt;

/// What a link's recorder saw, at its time.
///
/// The example of [`replay`](crate::replay) shows some.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Seen {
    /// When, on the trace's clock.
    pub at: Micros,
    /// What. A trace does not say which job a delivery answers: that is 0 here.
    pub what: Observed,
}

/// Things of one channel have an order even at one time.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) enum Channel {
    Wire,
    Lines,
    Host,
}

impl Seen {
    /// `None` for what stands outside a trace.
    pub(crate) fn of(at: Micros, observed: Observed) -> Option<Self> {
        channel(&observed)?;
        let what = match observed {
            Observed::Delivery(delivery) => {
                Observed::Delivery(Delivery { job: JobId::NONE, ..delivery })
            }
            other => other,
        };
        Some(Self { at, what })
    }

    pub(crate) fn channel(&self) -> Option<Channel> {
        channel(&self.what)
    }

    /// Bytes that left or were delivered.
    pub(crate) fn bytes(&self) -> u64 {
        match &self.what {
            Observed::Byte(_) => 1,
            Observed::Delivery(delivery) => delivery.bytes.len() as u64,
            _ => 0,
        }
    }

    /// As a line of a trace.
    pub(crate) fn entry(&self, manifest: &Manifest) -> Option<Entry> {
        Some(entry(self.at, What::Expected(expected(&self.what, manifest)?)))
    }
}

/// As digests have it for ever, whatever these things are called elsewhere.
impl fmt::Display for Seen {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} ", self.at)?;
        match &self.what {
            Observed::ModemLines(named, on) => write!(f, "Lines({named:?}, {on:?})"),
            Observed::Delivery(Delivery { id, bytes, failure, status, name, .. }) => write!(
                f,
                "Deliver(Delivered {{ id: {id}, bytes: {bytes:?}, failure: {failure:?}, status: {status}, name: {name:?} }})"
            ),
            Observed::Done { job, sent } => write!(f, "Done {{ id: {job}, sent: Some({sent}) }}"),
            Observed::Failed { job, failure, status, sent } => write!(
                f,
                "Fail {{ id: {job}, failure: {failure:?}, status: {status}, sent: Some({sent}) }}"
            ),
            Observed::Checked { job, failure, status, line, column } => write!(
                f,
                "Check {{ id: {job}, failure: {failure:?}, status: {status}, line: {line}, column: {column} }}"
            ),
            Observed::Request { request, kind, fields } => {
                write!(f, "Request {{ id: {request}, kind: {kind}, fields: {fields:?} }}")
            }
            other => write!(f, "{other:?}"),
        }
    }
}

/// Where something is seen; `None`: it stands outside a trace.
pub(crate) fn channel(observed: &Observed) -> Option<Channel> {
    match observed {
        Observed::Byte(_) | Observed::Break(_) => Some(Channel::Wire),
        Observed::ModemLines(..) => Some(Channel::Lines),
        Observed::Delivery(_)
        | Observed::Done { .. }
        | Observed::Failed { .. }
        | Observed::Checked { .. }
        | Observed::Request { .. }
        | Observed::Withdraw(_) => Some(Channel::Host),
        Observed::Hold | Observed::Release | Observed::Note(..) | Observed::State(_) => None,
    }
}

/// As a trace demands it.
fn expected(observed: &Observed, manifest: &Manifest) -> Option<Expected> {
    Some(match observed {
        Observed::Byte(byte) => Expected::Send(Payload::hex(&[*byte])),
        Observed::Break(micros) => Expected::SendBreak(*micros),
        Observed::ModemLines(named, on) => Expected::SetLines(output_levels(*named, *on)),
        Observed::Delivery(Delivery { id, bytes, failure, status, name, .. }) => {
            Expected::Deliver {
                id: id.0,
                data: Payload::from_bytes(bytes),
                failure: *failure,
                status: *status,
                name: name.clone(),
            }
        }
        Observed::Done { job, sent } => Expected::Done { id: job.0, sent: Some(*sent) },
        Observed::Failed { job, failure, status, sent } => {
            Expected::Fail { id: job.0, failure: *failure, status: *status, sent: Some(*sent) }
        }
        Observed::Checked { job, failure, status, line, column } => Expected::Check {
            id: job.0,
            failure: *failure,
            status: *status,
            line: *line,
            column: *column,
        },
        Observed::Request { request, kind, fields } => {
            let kind = manifest.requests.get(usize::from(*kind));
            Expected::Request {
                id: request.0,
                kind: kind.map_or_else(|| "unknown".to_owned(), |kind| kind.name.clone()),
                fields: kind.map(|kind| assignments(kind, fields)).unwrap_or_default(),
            }
        }
        Observed::Withdraw(request) => Expected::Withdraw(request.0),
        Observed::Hold | Observed::Release | Observed::Note(..) | Observed::State(_) => {
            return None;
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_abi::{ModemLines, RequestId};

    #[test]
    fn wire_lines_and_host_have_an_order_each() {
        let lines = Observed::ModemLines(ModemLines::default(), ModemLines::default());
        let withdrawn = Observed::Withdraw(RequestId(1));
        let all = [Observed::Byte(0), Observed::Break(1), lines, withdrawn, Observed::Hold];
        assert_eq!(
            all.map(|observed| channel(&observed)),
            [
                Some(Channel::Wire),
                Some(Channel::Wire),
                Some(Channel::Lines),
                Some(Channel::Host),
                None
            ]
        );
    }

    #[test]
    fn the_job_that_a_delivery_answers_is_not_looked_at() {
        let delivery = |job| Observed::Delivery(Delivery { job, ..Delivery::default() });
        let [seen, other] = [JobId(1), JobId(2)].map(|job| Seen::of(Micros::ZERO, delivery(job)));
        assert_eq!(seen, other);
    }

    #[test]
    fn digests_keep_their_words() {
        let delivery = Delivery { bytes: vec![65], ..Delivery::default() };
        let done = Observed::Done { job: JobId(1), sent: 4 };
        let withdrawn = Observed::Withdraw(RequestId(2));
        let all = [Observed::Byte(65), Observed::Delivery(delivery), done, withdrawn];
        let written = all.map(|what| Seen { at: Micros(7), what }.to_string());
        let delivered = "Delivered { id: 0, bytes: [65], failure: None, status: 0, name: None }";
        let words = [
            "Byte(65)".to_owned(),
            format!("Deliver({delivered})"),
            "Done { id: 1, sent: Some(4) }".to_owned(),
            "Withdraw(2)".to_owned(),
        ];
        assert_eq!(written, words.map(|words| format!("{} {words}", Micros(7))));
    }
}
