//! What a plug-in does that can be seen from outside, in one form for what is
//! demanded and what was observed.

use crate::given::fields::assignments;
use crate::given::lines::output_levels;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Failure, Micros, ModemLines};
use softplug_link::Observed;
use softplug_trace::{
    CheckFault, DeliveryEnd, Entry, Expected, Payload, SourceLine, Time, What, When,
};

/// Something that a plug-in did, or must do.
///
/// The example of [`replay`](crate::replay) shows some.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Effect {
    /// A character on the wire, at its start bit.
    Byte(u8),
    /// A break of so many µs.
    Break(u32),
    /// Modem lines set: which, and those of them that are on.
    Lines(ModemLines, ModemLines),
    /// A delivery has ended.
    Deliver(Delivered),
    /// A job is done.
    Done {
        /// The job.
        id: u32,
        /// Bytes that left for it; `None`: not looked at.
        sent: Option<u64>,
    },
    /// A job has failed.
    Fail {
        /// The job.
        id: u32,
        /// Why.
        failure: Failure,
        /// The protocol's own code.
        status: u16,
        /// Bytes that left for it; `None`: not looked at.
        sent: Option<u64>,
    },
    /// A check pass has ended.
    Check {
        /// The job.
        id: u32,
        /// `None`: good.
        failure: Option<Failure>,
        /// The protocol's own code.
        status: u16,
        /// Line of the fault, 0 without.
        line: u32,
        /// Column of the fault, 0 without.
        column: u32,
    },
    /// It asks the host for something.
    Request {
        /// The request.
        id: u32,
        /// Place of its kind in the manifest.
        kind: u16,
        /// Value records.
        fields: Vec<u8>,
    },
    /// A request was withdrawn.
    Withdraw(u32),
}

/// A delivery at its end.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{Effect, Delivered, FromFn, Permutation, load, replay};
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.rx.quiet.spt"])?[0];
/// let outcome = replay(&subject, case, &Permutation::Uncut, 0);
/// let delivered = outcome.seen.iter().find_map(|seen| match &seen.effect {
///     Effect::Deliver(delivered) => Some(delivered),
///     _ => None,
/// });
/// let Delivered { id, bytes, failure, .. } = delivered.expect("the trace has a delivery");
/// assert_eq!((*id, *failure), (1, None));
/// assert!(!bytes.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Delivered {
    /// The plug-in's id for it.
    pub id: u32,
    /// All its bytes.
    pub bytes: Vec<u8>,
    /// `None`: complete.
    pub failure: Option<Failure>,
    /// The protocol's own code.
    pub status: u16,
    /// The name that was found.
    pub name: Option<String>,
}

/// Things of one channel have an order even at one time.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub(crate) enum Channel {
    Wire,
    Lines,
    Host,
}

impl Effect {
    pub(crate) fn channel(&self) -> Channel {
        match self {
            Self::Byte(_) | Self::Break(_) => Channel::Wire,
            Self::Lines(..) => Channel::Lines,
            _ => Channel::Host,
        }
    }

    /// Whether `observed` is what this demands.
    pub(crate) fn allows(&self, observed: &Self) -> bool {
        match (self, observed) {
            (Self::Done { id: a, sent: None }, Self::Done { id: b, .. }) => a == b,
            (
                Self::Fail { id, failure, status, sent: None },
                Self::Fail { id: id_b, failure: failure_b, status: status_b, .. },
            ) => (id, failure, status) == (id_b, failure_b, status_b),
            _ => self == observed,
        }
    }

    /// From what a link saw; `None` for what stands outside a trace.
    pub(crate) fn of(observed: Observed) -> Option<Self> {
        Some(match observed {
            Observed::Byte(byte) => Self::Byte(byte),
            Observed::Break(micros) => Self::Break(micros),
            Observed::ModemLines(mask, on) => Self::Lines(mask, on),
            Observed::Delivery(delivery) => Self::Deliver(Delivered {
                id: delivery.id.0,
                bytes: delivery.bytes,
                failure: delivery.failure,
                status: delivery.status,
                name: delivery.name,
            }),
            Observed::Done { job, sent } => Self::Done { id: job.0, sent: Some(sent) },
            Observed::Failed { job, failure, status, sent } => {
                Self::Fail { id: job.0, failure, status, sent: Some(sent) }
            }
            Observed::Checked { job, failure, status, line, column } => {
                Self::Check { id: job.0, failure, status, line, column }
            }
            Observed::Request { request, kind, fields } => {
                Self::Request { id: request.0, kind, fields }
            }
            Observed::Withdraw(request) => Self::Withdraw(request.0),
            Observed::Hold | Observed::Release | Observed::Note(..) | Observed::State(_) => {
                return None;
            }
        })
    }

    /// As a line of a trace.
    pub(crate) fn entry(&self, at: Micros, manifest: &Manifest) -> Entry {
        let when = When::at(Time(at.0.max(0) as u64));
        Entry { when, what: self.what(manifest), line: SourceLine::default() }
    }

    fn what(&self, manifest: &Manifest) -> What {
        let code = |failure: &Failure| failure.name().to_owned();
        let status = |status: u16| (status != 0).then_some(status);
        let place = |place: u32| (place != 0).then_some(place);
        What::Act(match self {
            Self::Byte(byte) => return What::Send(Payload::hex(&[*byte])),
            Self::Break(micros) => return What::SendBreak(*micros),
            Self::Lines(named, on) => return What::SetLines(output_levels(*named, *on)),
            Self::Deliver(delivered) => Expected::Deliver {
                id: delivered.id,
                data: Payload::from_bytes(&delivered.bytes),
                end: match &delivered.failure {
                    None => DeliveryEnd::Complete,
                    Some(failure) => DeliveryEnd::Failed(code(failure)),
                },
                status: status(delivered.status),
                name: delivered.name.clone(),
            },
            Self::Done { id, sent } => Expected::Done { id: *id, sent: *sent },
            Self::Fail { id, failure, status: own, sent } => {
                Expected::Fail { id: *id, code: code(failure), status: status(*own), sent: *sent }
            }
            Self::Check { id, failure, status: own, line, column } => Expected::Check {
                id: *id,
                fault: failure.as_ref().map(|failure| CheckFault {
                    code: code(failure),
                    line: place(*line),
                    column: place(*column),
                    status: status(*own),
                }),
            },
            Self::Request { id, kind, fields } => {
                let kind = manifest.requests.get(usize::from(*kind));
                Expected::Request {
                    id: *id,
                    kind: kind.map_or_else(|| "unknown".to_owned(), |kind| kind.name.clone()),
                    fields: kind.map(|kind| assignments(kind, fields)).unwrap_or_default(),
                }
            }
            Self::Withdraw(id) => Expected::Withdraw(*id),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn failed(id: u32, failure: Failure, status: u16, sent: Option<u64>) -> Effect {
        Effect::Fail { id, failure, status, sent }
    }

    #[test]
    fn only_a_count_that_is_not_named_is_open() {
        let demand = failed(1, Failure::NoAnswer, 7, None);
        assert!(demand.allows(&failed(1, Failure::NoAnswer, 7, Some(3))));
        assert!(!demand.allows(&failed(2, Failure::NoAnswer, 7, Some(3))));
        assert!(!demand.allows(&failed(1, Failure::Refused, 7, Some(3))));
        assert!(!demand.allows(&failed(1, Failure::NoAnswer, 8, Some(3))));
        let exact = failed(1, Failure::NoAnswer, 7, Some(3));
        assert!(!exact.allows(&failed(1, Failure::NoAnswer, 7, Some(4))));
        let done = |id, sent| Effect::Done { id, sent };
        assert!(done(1, None).allows(&done(1, Some(3))));
        assert!(!done(1, None).allows(&done(2, Some(3))));
        assert!(!done(1, Some(3)).allows(&done(1, Some(4))));
    }

    #[test]
    fn wire_lines_and_host_have_an_order_each() {
        let lines = Effect::Lines(ModemLines::default(), ModemLines::default());
        let channels = [Effect::Byte(0), Effect::Break(1), lines, Effect::Withdraw(1)];
        assert_eq!(
            channels.map(|effect| effect.channel()),
            [Channel::Wire, Channel::Wire, Channel::Lines, Channel::Host]
        );
    }

    #[test]
    fn a_status_and_a_place_are_told_only_if_there_are_any() {
        let manifest = br#"{"abi": "1.0", "name": "x", "version": "1.0.0", "licence": "MIT", "protocol": "none",
            "description": "For the suite's own tests."}"#;
        let manifest = Manifest::parse(manifest).unwrap();
        for (number, told) in [(0, None), (7, Some(7))] {
            let failed = failed(1, Failure::NoAnswer, number, None);
            let What::Act(Expected::Fail { status, .. }) = failed.what(&manifest) else {
                panic!("it failed")
            };
            assert_eq!(status, told);

            let failure = Some(Failure::UnsupportedCharacter);
            let line = number.into();
            let checked = Effect::Check { id: 1, failure, status: 0, line, column: line };
            let What::Act(Expected::Check { fault: Some(fault), .. }) = checked.what(&manifest)
            else {
                panic!("the check found a fault")
            };
            assert_eq!((fault.line, fault.column), (told.map(u32::from), told.map(u32::from)));
        }
    }
}
