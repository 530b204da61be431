//! Actions: what a plug-in asks of its host, as records in the output buffer.
//!
//! A record is: kind u16, payload length u16, payload.

mod records;

pub use records::{ActionWriter, Actions};

use crate::code::codes;
use crate::event::{failure, state_piece, timer_id};
use crate::limits::{
    BREAK_MICROS, DELIVERY_NAME_BYTES, NOTE_BYTES, STATE_NAME_BYTES, URGENT_BYTES,
};
use crate::value::Values;
use crate::wire::{MalformedReason, Reader, Writer};
use crate::{DeliveryId, Failure, JobId, MarkId, Micros, ModemLines, RequestId};

codes! {
    /// How much a note matters.
    pub enum NoteLevel: u8 {
        1 "error" Error "something was lost or went wrong",
        2 "warning" Warning "something is not as it should be",
        3 "info" Info "good to know",
        4 "debug" Debug "for whoever mends a set-up",
    }
}

mod kind {
    pub(super) const TRANSMIT: u16 = 1;
    pub(super) const TRANSMIT_URGENT: u16 = 2;
    pub(super) const HOLD: u16 = 3;
    pub(super) const RELEASE: u16 = 4;
    pub(super) const DISCARD: u16 = 5;
    pub(super) const SET_TIMER: u16 = 6;
    pub(super) const CANCEL_TIMER: u16 = 7;
    pub(super) const MODEM_LINES: u16 = 8;
    pub(super) const BREAK: u16 = 9;
    pub(super) const WANT: u16 = 10;
    pub(super) const DELIVERY_BEGIN: u16 = 11;
    pub(super) const DELIVER: u16 = 12;
    pub(super) const DELIVERY_NAME: u16 = 13;
    pub(super) const DELIVERY_END: u16 = 14;
    pub(super) const JOB_DONE: u16 = 15;
    pub(super) const JOB_FAILED: u16 = 16;
    pub(super) const CHECK_RESULT: u16 = 17;
    pub(super) const REQUEST: u16 = 18;
    pub(super) const WITHDRAW: u16 = 19;
    pub(super) const NOTE: u16 = 20;
    pub(super) const STATE: u16 = 21;
    pub(super) const SAVED: u16 = 22;
}

/// One action. Payload layouts: `docs/abi.md`, section "Actions".
///
/// ```
/// use softplug_abi::{Action, Actions, Micros};
///
/// // Timer 3 at 2 s, as it stands in the output buffer.
/// let record = [6, 0, 9, 0, 3, 0x80, 0x84, 0x1E, 0, 0, 0, 0, 0];
/// let action = Actions::new(&record).next().unwrap()?;
/// assert_eq!(action, Action::SetTimer { id: 3, deadline: Micros(2_000_000) });
/// # Ok::<(), softplug_abi::Malformed>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Action<'a> {
    /// Append bytes to the transmit queue.
    Transmit {
        /// Not 0: report when the last of these bytes has left. With no bytes:
        /// when the last byte of the queue has.
        mark: MarkId,
        /// Must fit the room for transmitting.
        bytes: &'a [u8],
    },
    /// Send bytes ahead of queue and hold, at the next character boundary.
    TransmitUrgent {
        /// As for `Transmit`.
        mark: MarkId,
        /// 1 to 16 bytes.
        bytes: &'a [u8],
    },
    /// Stop the transmit queue before its next byte.
    Hold,
    /// Let the transmit queue go on.
    Release,
    /// Drop what the transmit queue holds; answered by `Discarded`.
    Discard,
    /// Set a timer, or set it anew.
    SetTimer {
        /// 0 to 15.
        id: u8,
        /// Absolute, on the link's clock; one in the past fires now.
        deadline: Micros,
    },
    /// Cancel a timer; the event never comes.
    CancelTimer {
        /// 0 to 15.
        id: u8,
    },
    /// Set our modem lines.
    ModemLines {
        /// Which lines to set: RTS, DTR.
        mask: ModemLines,
        /// Which of these are on.
        on: ModemLines,
    },
    /// Send a break, at the next character boundary.
    Break {
        /// How long, at most 10 s.
        micros: u32,
    },
    /// Ask for more data of the job.
    Want {
        /// The job's id.
        job: JobId,
        /// Bytes beyond what was asked for before.
        bytes: u32,
    },
    /// A delivery begins; none other may be under way.
    DeliveryBegin {
        /// Chosen by the plug-in, never 0.
        delivery: DeliveryId,
        /// The job that it answers, or 0.
        job: JobId,
    },
    /// Bytes for the host.
    Deliver {
        /// The delivery under way.
        delivery: DeliveryId,
        /// At least one; must fit the room for deliveries.
        bytes: &'a [u8],
    },
    /// A name for the delivery was found.
    DeliveryName {
        /// The delivery under way.
        delivery: DeliveryId,
        /// From the line: the host trusts nothing in it.
        name: &'a str,
    },
    /// The delivery has ended.
    DeliveryEnd {
        /// The delivery under way.
        delivery: DeliveryId,
        /// `None`: complete.
        failure: Option<Failure>,
        /// The protocol's own code, 0 without.
        status: u16,
    },
    /// The job is done.
    JobDone {
        /// The job's id.
        job: JobId,
        /// Bytes that left for it.
        sent: u64,
    },
    /// The job has failed.
    JobFailed {
        /// The job's id.
        job: JobId,
        /// Why.
        failure: Failure,
        /// The protocol's own code, 0 without.
        status: u16,
        /// Bytes that left for it.
        sent: u64,
    },
    /// The check pass has ended.
    CheckResult {
        /// The job's id.
        job: JobId,
        /// `None`: good.
        failure: Option<Failure>,
        /// The protocol's own code, 0 without.
        status: u16,
        /// Line of the fault, from 1; 0 without.
        line: u32,
        /// Column of the fault in bytes, from 1; 0 without.
        column: u32,
    },
    /// Ask the host for something.
    Request {
        /// Chosen by the plug-in, never 0.
        request: RequestId,
        /// Place of the request's kind in the manifest.
        kind: u16,
        /// The request's fields.
        fields: Values<'a>,
    },
    /// The request no longer matters.
    Withdraw {
        /// The request's id.
        request: RequestId,
    },
    /// Something for the log.
    Note {
        /// How much it matters.
        level: NoteLevel,
        /// The protocol's own code, 0 without.
        code: u16,
        /// At most 240 bytes.
        text: &'a str,
    },
    /// Name of the state that the plug-in is now in, for people.
    State {
        /// At most 48 bytes.
        name: &'a str,
    },
    /// A piece of the saved state; only in answer to `Save`.
    Saved {
        /// The format, listed in the manifest.
        format: u16,
        /// Where the piece begins.
        offset: u32,
        /// Length of the whole state, at most 64 KiB.
        total: u32,
        /// The piece.
        bytes: &'a [u8],
    },
}

impl<'a> Action<'a> {
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    fn kind(&self) -> u16 {
        match self {
            Self::Transmit { .. } => kind::TRANSMIT,
            Self::TransmitUrgent { .. } => kind::TRANSMIT_URGENT,
            Self::Hold => kind::HOLD,
            Self::Release => kind::RELEASE,
            Self::Discard => kind::DISCARD,
            Self::SetTimer { .. } => kind::SET_TIMER,
            Self::CancelTimer { .. } => kind::CANCEL_TIMER,
            Self::ModemLines { .. } => kind::MODEM_LINES,
            Self::Break { .. } => kind::BREAK,
            Self::Want { .. } => kind::WANT,
            Self::DeliveryBegin { .. } => kind::DELIVERY_BEGIN,
            Self::Deliver { .. } => kind::DELIVER,
            Self::DeliveryName { .. } => kind::DELIVERY_NAME,
            Self::DeliveryEnd { .. } => kind::DELIVERY_END,
            Self::JobDone { .. } => kind::JOB_DONE,
            Self::JobFailed { .. } => kind::JOB_FAILED,
            Self::CheckResult { .. } => kind::CHECK_RESULT,
            Self::Request { .. } => kind::REQUEST,
            Self::Withdraw { .. } => kind::WITHDRAW,
            Self::Note { .. } => kind::NOTE,
            Self::State { .. } => kind::STATE,
            Self::Saved { .. } => kind::SAVED,
        }
    }

    #[cfg_attr(target_arch = "wasm32", inline(always))]
    fn write(&self, w: &mut Writer<'_>) {
        match self {
            Self::Transmit { mark, bytes } | Self::TransmitUrgent { mark, bytes } => {
                w.u32(mark.0);
                w.bytes(bytes);
            }
            Self::Hold | Self::Release | Self::Discard => {}
            Self::SetTimer { id, deadline } => {
                w.u8(*id);
                w.i64(deadline.0);
            }
            Self::CancelTimer { id } => w.u8(*id),
            Self::ModemLines { mask, on } => {
                w.u8(mask.0);
                w.u8(on.0);
            }
            Self::Break { micros } => w.u32(*micros),
            Self::Want { job, bytes } => {
                w.u32(job.0);
                w.u32(*bytes);
            }
            Self::DeliveryBegin { delivery, job } => {
                w.u32(delivery.0);
                w.u32(job.0);
            }
            Self::Deliver { delivery, bytes } => {
                w.u32(delivery.0);
                w.bytes(bytes);
            }
            Self::DeliveryName { delivery, name } => {
                w.u32(delivery.0);
                w.bytes(name.as_bytes());
            }
            Self::DeliveryEnd { delivery, failure, status } => {
                w.u32(delivery.0);
                w.u16(failure.map_or(0, Failure::code));
                w.u16(*status);
            }
            Self::JobDone { job, sent } => {
                w.u32(job.0);
                w.u64(*sent);
            }
            Self::JobFailed { job, failure, status, sent } => {
                w.u32(job.0);
                w.u16(failure.code());
                w.u16(*status);
                w.u64(*sent);
            }
            Self::CheckResult { job, failure, status, line, column } => {
                w.u32(job.0);
                w.u16(failure.map_or(0, Failure::code));
                w.u16(*status);
                w.u32(*line);
                w.u32(*column);
            }
            Self::Request { request, kind, fields } => {
                w.u32(request.0);
                w.u16(*kind);
                w.bytes(fields.as_bytes());
            }
            Self::Withdraw { request } => w.u32(request.0),
            Self::Note { level, code, text } => {
                w.u8(level.code());
                w.u8(0);
                w.u16(*code);
                w.bytes(text.as_bytes());
            }
            Self::State { name } => w.bytes(name.as_bytes()),
            Self::Saved { format, offset, total, bytes } => {
                w.u16(*format);
                w.u16(0);
                w.u32(*offset);
                w.u32(*total);
                w.bytes(bytes);
            }
        }
    }

    fn decode(kind: u16, payload: &'a [u8]) -> Result<Self, MalformedReason> {
        let mut r = Reader::new(payload);
        let action = Self::read(kind, &mut r)?;
        r.end()?;
        Ok(action)
    }

    fn read(kind: u16, r: &mut Reader<'a>) -> Result<Self, MalformedReason> {
        let action = match kind {
            kind::TRANSMIT => {
                let (mark, bytes) = (MarkId(r.u32()), r.rest());
                if mark == MarkId::NONE && bytes.is_empty() {
                    r.fail(MalformedReason::Truncated);
                }
                Self::Transmit { mark, bytes }
            }
            kind::TRANSMIT_URGENT => {
                let (mark, bytes) = (MarkId(r.u32()), r.rest());
                r.require("bytes", (1..=URGENT_BYTES).contains(&bytes.len()));
                Self::TransmitUrgent { mark, bytes }
            }
            kind::HOLD => Self::Hold,
            kind::RELEASE => Self::Release,
            kind::DISCARD => Self::Discard,
            kind::SET_TIMER => Self::SetTimer { id: timer_id(r), deadline: Micros(r.i64()) },
            kind::CANCEL_TIMER => Self::CancelTimer { id: timer_id(r) },
            kind::MODEM_LINES => {
                let (mask, on) = (ModemLines(r.u8()), ModemLines(r.u8()));
                r.require("mask", ModemLines::OUTPUTS.contains(mask) && mask.contains(on));
                Self::ModemLines { mask, on }
            }
            kind::BREAK => {
                let micros = r.u32();
                r.require("micros", (1..=BREAK_MICROS).contains(&micros));
                Self::Break { micros }
            }
            kind::WANT => Self::Want { job: JobId(r.non_zero("job")), bytes: r.non_zero("bytes") },
            kind::DELIVERY_BEGIN => Self::DeliveryBegin {
                delivery: DeliveryId(r.non_zero("delivery")),
                job: JobId(r.u32()),
            },
            kind::DELIVER => Self::Deliver {
                delivery: DeliveryId(r.non_zero("delivery")),
                bytes: r.rest_not_empty(),
            },
            kind::DELIVERY_NAME => Self::DeliveryName {
                delivery: DeliveryId(r.non_zero("delivery")),
                name: r.text("name", DELIVERY_NAME_BYTES),
            },
            kind::DELIVERY_END => Self::DeliveryEnd {
                delivery: DeliveryId(r.non_zero("delivery")),
                failure: failure(r, "failure"),
                status: r.u16(),
            },
            kind::JOB_DONE => Self::JobDone { job: JobId(r.non_zero("job")), sent: r.u64() },
            kind::JOB_FAILED => {
                let (job, failure) = (JobId(r.non_zero("job")), failure(r, "failure"));
                let failure = r.known("failure", failure, Failure::Internal);
                Self::JobFailed { job, failure, status: r.u16(), sent: r.u64() }
            }
            kind::CHECK_RESULT => Self::CheckResult {
                job: JobId(r.non_zero("job")),
                failure: failure(r, "failure"),
                status: r.u16(),
                line: r.u32(),
                column: r.u32(),
            },
            kind::REQUEST => Self::Request {
                request: RequestId(r.non_zero("request")),
                kind: r.u16(),
                fields: Values::new(r.rest()),
            },
            kind::WITHDRAW => Self::Withdraw { request: RequestId(r.non_zero("request")) },
            kind::NOTE => {
                let level = NoteLevel::from_code(r.u8());
                let level = r.known("level", level, NoteLevel::Error);
                r.zeros(1);
                Self::Note { level, code: r.u16(), text: r.text("text", NOTE_BYTES) }
            }
            kind::STATE => Self::State { name: r.text("name", STATE_NAME_BYTES) },
            kind::SAVED => {
                let (format, offset, total, bytes) = state_piece(r);
                Self::Saved { format, offset, total, bytes }
            }
            _ => return Err(MalformedReason::UnknownKind(kind)),
        };
        Ok(action)
    }
}
