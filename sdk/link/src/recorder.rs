//! An outside that keeps all that happens, in memory.

use crate::{LinkHost, Supply, WireHost};
use alloc::borrow::ToOwned;
use alloc::collections::BTreeMap;
use alloc::string::String;
use alloc::vec::Vec;
use core::num::NonZeroUsize;
use softplug_abi::{Action, DeliveryId, Failure, JobId, Micros, ModemLines, NoteLevel, RequestId};

/// Something that a plug-in was seen to do.
///
/// The example of [`Recorder`] shows one.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub enum Observed {
    /// A character on the wire.
    Byte(u8),
    /// A break of so many µs.
    Break(u32),
    /// Modem lines set: which, and those of them that are on.
    ModemLines(ModemLines, ModemLines),
    /// The transmit queue held.
    Hold,
    /// The transmit queue released.
    Release,
    /// A delivery, at its end.
    Delivery(Delivery),
    /// A job was done, after so many bytes.
    Done {
        /// The job.
        job: JobId,
        /// Bytes that left for it.
        sent: u64,
    },
    /// A job failed.
    Failed {
        /// The job.
        job: JobId,
        /// Why.
        failure: Failure,
        /// The protocol's own code.
        status: u16,
        /// Bytes that left for it.
        sent: u64,
    },
    /// The result of a check pass.
    Checked {
        /// The job.
        job: JobId,
        /// `None`: good.
        failure: Option<Failure>,
        /// The protocol's own code.
        status: u16,
        /// Line of the fault.
        line: u32,
        /// Column of the fault.
        column: u32,
    },
    /// A request, with its fields as value records.
    Request {
        /// Its id.
        request: RequestId,
        /// Place of its kind in the manifest.
        kind: u16,
        /// Value records.
        fields: Vec<u8>,
    },
    /// A request was withdrawn.
    Withdraw(RequestId),
    /// A note.
    Note(NoteLevel, u16, String),
    /// The name of the state that it is in.
    State(String),
}

/// A delivery with all its bytes.
///
/// The example of [`Recorder`] shows one.
#[derive(Clone, PartialEq, Eq, Hash, Debug, Default)]
pub struct Delivery {
    /// The plug-in's id for it.
    pub id: DeliveryId,
    /// The job that it answers, or 0.
    pub job: JobId,
    /// All its bytes.
    pub bytes: Vec<u8>,
    /// The name that was found.
    pub name: Option<String>,
    /// `None`: complete.
    pub failure: Option<Failure>,
    /// The protocol's own code.
    pub status: u16,
}

/// Keeps all that happens, and supplies jobs from memory.
///
/// ```
/// use softplug_abi::{Action, DeliveryId, JobId, Micros};
/// use softplug_link::{Delivery, Observed, LinkHost, Recorder};
///
/// // As a link calls it: a delivery in two pieces.
/// let mut host = Recorder::default();
/// host.handle(Micros(1_000), &Action::DeliveryBegin { delivery: DeliveryId(1), job: JobId::NONE });
/// host.handle(Micros(1_000), &Action::Deliver { delivery: DeliveryId(1), bytes: b"%\n" });
/// host.handle(Micros(9_000), &Action::Deliver { delivery: DeliveryId(1), bytes: b"O1\n" });
/// let end = Action::DeliveryEnd { delivery: DeliveryId(1), failure: None, status: 0 };
/// host.handle(Micros(9_000), &end);
/// assert_eq!(host.deliveries()[0].bytes, b"%\nO1\n");
/// let whole = Delivery { id: DeliveryId(1), bytes: b"%\nO1\n".to_vec(), ..Delivery::default() };
/// assert_eq!(host.observed, [(Micros(9_000), Observed::Delivery(whole))]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    /// All that happened, in order. The time of a byte is that of its start bit.
    pub observed: Vec<(Micros, Observed)>,
    /// The delivery under way.
    pub open_delivery: Option<Delivery>,
    /// Deliveries are put away only when [`drain`](Self::drain) says so.
    pub drain_by_hand: bool,
    /// So many bytes of jobs' data are there to be given, the rest comes later;
    /// without it all are.
    pub source_has: Option<usize>,
    /// At most so many bytes of a job's data are given at once, if it is set.
    pub source_piece: Option<NonZeroUsize>,
    waiting: u32,
    drained: u32,
    sources: BTreeMap<JobId, (Vec<u8>, usize)>,
}

impl Recorder {
    /// Data for a job that is about to begin.
    pub fn add_source(&mut self, job: JobId, data: Vec<u8>) {
        self.sources.insert(job, (data, 0));
    }

    /// Puts `bytes` of what was delivered away.
    pub fn drain(&mut self, bytes: u32) {
        let bytes = bytes.min(self.waiting);
        self.waiting -= bytes;
        self.drained += bytes;
    }

    /// Bytes of deliveries that are not put away yet.
    pub fn waiting(&self) -> u32 {
        self.waiting
    }

    /// Every byte on the wire, in order.
    pub fn sent(&self) -> Vec<u8> {
        let byte = |(_, observed): &(Micros, Observed)| match observed {
            Observed::Byte(byte) => Some(*byte),
            _ => None,
        };
        self.observed.iter().filter_map(byte).collect()
    }

    /// Every delivery that has ended.
    pub fn deliveries(&self) -> Vec<&Delivery> {
        self.observed
            .iter()
            .filter_map(|(_, observed)| match observed {
                Observed::Delivery(delivery) => Some(delivery),
                _ => None,
            })
            .collect()
    }

    fn push(&mut self, at: Micros, observed: Observed) {
        self.observed.push((at, observed));
    }
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl LinkHost for Recorder {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        let observed = match action {
            Action::Hold => Observed::Hold,
            Action::Release => Observed::Release,
            Action::ModemLines { mask, on } => Observed::ModemLines(*mask, *on),
            Action::Break { micros } => Observed::Break(*micros),
            Action::DeliveryBegin { delivery, job } => {
                let open = Delivery { id: *delivery, job: *job, ..Delivery::default() };
                self.open_delivery = Some(open);
                return;
            }
            Action::Deliver { bytes, .. } => {
                if let Some(open) = &mut self.open_delivery {
                    open.bytes.extend(*bytes);
                }
                self.waiting += bytes.len() as u32;
                if !self.drain_by_hand {
                    self.drain(u32::MAX);
                }
                return;
            }
            Action::DeliveryName { name, .. } => {
                if let Some(open) = &mut self.open_delivery {
                    open.name = Some((*name).to_owned());
                }
                return;
            }
            Action::DeliveryEnd { failure, status, .. } => {
                let Some(open) = self.open_delivery.take() else { return };
                Observed::Delivery(Delivery { failure: *failure, status: *status, ..open })
            }
            Action::JobDone { job, sent } => Observed::Done { job: *job, sent: *sent },
            Action::JobFailed { job, failure, status, sent } => {
                Observed::Failed { job: *job, failure: *failure, status: *status, sent: *sent }
            }
            Action::CheckResult { job, failure, status, line, column } => Observed::Checked {
                job: *job,
                failure: *failure,
                status: *status,
                line: *line,
                column: *column,
            },
            Action::Request { request, kind, fields } => Observed::Request {
                request: *request,
                kind: *kind,
                fields: fields.as_bytes().to_vec(),
            },
            Action::Withdraw { request } => Observed::Withdraw(*request),
            Action::Note { level, code, text } => Observed::Note(*level, *code, (*text).to_owned()),
            Action::State { name } => Observed::State((*name).to_owned()),
            // What the link handles itself never comes out.
            Action::Transmit { .. }
            | Action::TransmitUrgent { .. }
            | Action::Discard
            | Action::SetTimer { .. }
            | Action::CancelTimer { .. }
            | Action::Want { .. }
            | Action::Saved { .. } => return,
        };
        self.push(now, observed);
    }

    fn supply(&mut self, job: JobId, buffer: &mut [u8]) -> Supply {
        let Some((data, at)) = self.sources.get_mut(&job) else { return Supply::End };
        let most = buffer.len().min(data.len() - *at);
        let most = self.source_piece.map_or(most, |piece| most.min(piece.get()));
        if most == 0 {
            return Supply::End;
        }
        let count = self.source_has.map_or(most, |has| has.min(most));
        if count == 0 {
            return Supply::Later;
        }
        self.source_has = self.source_has.map(|has| has - count);
        buffer[..count].copy_from_slice(&data[*at..*at + count]);
        *at += count;
        Supply::Bytes(count)
    }

    fn rewind(&mut self, job: JobId) {
        if let Some((_, at)) = self.sources.get_mut(&job) {
            *at = 0;
        }
    }

    fn drained(&mut self) -> u32 {
        core::mem::take(&mut self.drained)
    }
}

impl WireHost for Recorder {
    fn on_wire(&mut self, start: Micros, byte: u8) {
        self.push(start, Observed::Byte(byte));
    }
}
