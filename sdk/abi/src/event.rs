//! Events: what a host tells a plug-in, one call each.

use crate::code::codes;
use crate::limits::{STATE_BYTES, TIMERS};
use crate::value::Values;
use crate::wire::{MalformedReason, NoSpace, Reader, Writer, copy_quick};
use crate::{Failure, JobId, LineParameters, MarkId, Micros, ModemLines, Parity, RequestId};

codes! {
    /// The kinds of event, as given to `softplug_v1_step`.
    pub enum EventKind: u16 {
        1 "settings" Settings "settings, in pieces, before open",
        2 "open" Open "the link is there",
        3 "close" Close "the link ends; what follows begins as new",
        4 "received" Received "bytes from the line",
        5 "line-error" LineError "a damaged character, an overrun or a break",
        6 "modem-lines" ModemLines "the modem lines, at open and at each change",
        7 "link-down" LinkDown "the port or connection is gone",
        8 "link-up" LinkUp "the port or connection is back",
        9 "timer" Timer "a timer has run out",
        10 "mark" Mark "a marked byte has left, or was dropped",
        11 "transmit-room" TransmitRoom "more room in the transmit queue",
        12 "discarded" Discarded "how many bytes a discard dropped",
        13 "delivery-room" DeliveryRoom "more room for deliveries",
        14 "job-begin" JobBegin "a job begins, as a check or for good",
        15 "job-data" JobData "data of the job, as much as asked for",
        16 "job-end" JobEnd "the job's data has ended",
        17 "pause" Pause "the host asks for a pause",
        18 "resume" Resume "the host ends the pause",
        19 "abort" Abort "the host aborts a job or the delivery under way",
        20 "force-resume" ForceResume "go on although the partner holds the line",
        21 "answer" Answer "the answer to a request, in pieces",
        22 "save" Save "write the state",
        23 "restore" Restore "take a saved state, in pieces",
        24 "continue" Continue "write the rest of the actions",
    }
}

codes! {
    /// What happened to a character on the line.
    pub enum LineErrorKind: u8 {
        1 "parity" Parity "the parity bit is wrong",
        2 "framing" Framing "the stop bit is missing",
        3 "parity-or-framing" ParityOrFraming "parity or framing, the port cannot tell",
        4 "overrun" Overrun "characters were lost in the port",
        5 "break" Break "the line was held low for longer than a character",
    }
}

codes! {
    /// Why the link went down.
    pub enum LinkDownReason: u8 {
        1 "unplugged" Unplugged "the device is gone",
        2 "disconnected" Disconnected "the connection was closed by the other side",
        3 "failed" Failed "reading or writing failed",
    }
}

codes! {
    /// What became of a marked byte.
    pub enum MarkState: u8 {
        1 "maybe-left" MaybeLeft "its last bit can have left by now: never reported late",
        2 "surely-left" SurelyLeft "its last bit has left for certain: never reported early",
        3 "dropped" Dropped "a discard dropped it before the port had it",
    }
}

/// Whether a job is only checked or carried out.
///
/// ```
/// use softplug_abi::{Event, JobId, Pass, Values};
///
/// let fields = Values::new(&[]);
/// let check = Event::JobBegin { job: JobId(1), kind: 0, pass: Pass::Check, size: Some(40_000), fields };
/// assert!(matches!(check, Event::JobBegin { pass: Pass::Check, .. }));
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug, Hash)]
pub enum Pass {
    /// Carry the job out.
    Run,
    /// Look at the data and send nothing; answered by a check result.
    Check,
}

/// One event. Payload layouts: `docs/abi.md`, section "Events".
///
/// ```
/// use softplug_abi::{Event, EventKind, Micros};
///
/// let event = Event::Timer { id: 3, deadline: Micros(2_000_000) };
/// let mut buffer = [0; 64];
/// let length = event.encode(&mut buffer).unwrap();
/// let payload = &buffer[..length];
/// assert_eq!(Event::decode(EventKind::Timer, payload), Ok(event));
/// ```
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Event<'a> {
    /// Settings in the manifest's order, in pieces, before `Open`.
    Settings {
        /// This is the first piece.
        first: bool,
        /// This is the last piece.
        last: bool,
        /// Whole records; none stands across two pieces.
        values: Values<'a>,
    },
    /// The link is there; the clock runs.
    Open {
        /// The plug-in was restored: it goes on instead of starting anew, takes
        /// both rooms from here and sets its timers again.
        resumed: bool,
        /// The characters on the line.
        line: LineParameters,
        /// Bytes that may be transmitted until more room is reported.
        transmit_room: u32,
        /// Bytes that may be delivered until more room is reported.
        delivery_room: u32,
    },
    /// The link ends. The instance may be opened again, as new.
    Close,
    /// Bytes that arrived at this time, at least one.
    Received(&'a [u8]),
    /// A damaged character or a break.
    LineError {
        /// What happened.
        kind: LineErrorKind,
        /// The character as it was read, if known.
        byte: Option<u8>,
        /// 0: exactly here. n: one of the last n bytes received.
        span: u32,
    },
    /// State of the modem lines; the first event after `Open`.
    ModemLines {
        /// The lines that this link has.
        known: ModemLines,
        /// The lines that are on.
        on: ModemLines,
    },
    /// The port is gone. Nothing is lost that the queue still holds.
    LinkDown(LinkDownReason),
    /// The port is back.
    LinkUp,
    /// The timer with this id and deadline has run out.
    Timer {
        /// 0 to 15.
        id: u8,
        /// As it was set.
        deadline: Micros,
    },
    /// News of a marked byte.
    Mark {
        /// As given with the transmit, never 0.
        mark: MarkId,
        /// What became of it.
        state: MarkState,
    },
    /// The transmit queue has room for this many bytes more.
    TransmitRoom {
        /// Growth in bytes since the last report.
        grown: u32,
    },
    /// Answer to a discard.
    Discarded {
        /// Bytes dropped; they count as room again.
        bytes: u32,
    },
    /// The host has taken deliveries: room for this many bytes more.
    DeliveryRoom {
        /// Growth in bytes since the last report.
        grown: u32,
    },
    /// A job begins.
    JobBegin {
        /// The job's id, never 0.
        job: JobId,
        /// Place of the job's kind in the manifest.
        kind: u16,
        /// Check or run.
        pass: Pass,
        /// Bytes of data, if known.
        size: Option<u64>,
        /// The job's fields.
        fields: Values<'a>,
    },
    /// Data of the job, at most as much as was asked for.
    JobData {
        /// The job's id.
        job: JobId,
        /// At least one byte.
        bytes: &'a [u8],
    },
    /// All data of the job was given.
    JobEnd {
        /// The job's id.
        job: JobId,
    },
    /// Pause the job where the protocol allows it.
    Pause {
        /// The job's id.
        job: JobId,
    },
    /// Go on with the job.
    Resume {
        /// The job's id.
        job: JobId,
    },
    /// Abort the job; 0: the delivery under way.
    Abort {
        /// The job's id, or 0.
        job: JobId,
    },
    /// Go on although the partner holds the line.
    ForceResume,
    /// The answer to a request.
    Answer {
        /// The request's id.
        request: RequestId,
        /// `None`: granted. Otherwise why it was refused.
        refused: Option<Failure>,
        /// More pieces of this answer follow.
        more: bool,
        /// Data of a granted request.
        bytes: &'a [u8],
    },
    /// Write the state; changes nothing.
    Save,
    /// A piece of a saved state.
    Restore {
        /// The format that it was saved in.
        format: u16,
        /// Where the piece begins, in bytes.
        offset: u32,
        /// Length of the whole state in bytes.
        total: u32,
        /// The piece.
        bytes: &'a [u8],
    },
    /// Write the rest of the actions of the event before.
    Continue,
}

impl<'a> Event<'a> {
    /// The event's kind.
    pub fn kind(&self) -> EventKind {
        match self {
            Self::Settings { .. } => EventKind::Settings,
            Self::Open { .. } => EventKind::Open,
            Self::Close => EventKind::Close,
            Self::Received(_) => EventKind::Received,
            Self::LineError { .. } => EventKind::LineError,
            Self::ModemLines { .. } => EventKind::ModemLines,
            Self::LinkDown(_) => EventKind::LinkDown,
            Self::LinkUp => EventKind::LinkUp,
            Self::Timer { .. } => EventKind::Timer,
            Self::Mark { .. } => EventKind::Mark,
            Self::TransmitRoom { .. } => EventKind::TransmitRoom,
            Self::Discarded { .. } => EventKind::Discarded,
            Self::DeliveryRoom { .. } => EventKind::DeliveryRoom,
            Self::JobBegin { .. } => EventKind::JobBegin,
            Self::JobData { .. } => EventKind::JobData,
            Self::JobEnd { .. } => EventKind::JobEnd,
            Self::Pause { .. } => EventKind::Pause,
            Self::Resume { .. } => EventKind::Resume,
            Self::Abort { .. } => EventKind::Abort,
            Self::ForceResume => EventKind::ForceResume,
            Self::Answer { .. } => EventKind::Answer,
            Self::Save => EventKind::Save,
            Self::Restore { .. } => EventKind::Restore,
            Self::Continue => EventKind::Continue,
        }
    }

    /// Writes the payload into `buffer`; returns its length in bytes.
    #[inline]
    pub fn encode(&self, buffer: &mut [u8]) -> Result<usize, NoSpace> {
        // By far the most events.
        if let Self::Received(bytes) = self {
            let place = buffer.get_mut(..bytes.len()).ok_or(NoSpace)?;
            copy_quick(place, bytes);
            return Ok(bytes.len());
        }
        self.encode_any(buffer)
    }

    fn encode_any(&self, buffer: &mut [u8]) -> Result<usize, NoSpace> {
        let mut writer = Writer::new(buffer);
        self.write(&mut writer);
        writer.end(0)?;
        Ok(writer.len())
    }

    fn write(&self, w: &mut Writer<'_>) {
        match self {
            Self::Settings { first, last, values } => {
                w.u8(u8::from(*first) | u8::from(*last) << 1);
                w.bytes(values.as_bytes());
            }
            Self::Open { resumed, line, transmit_room, delivery_room } => {
                w.u8(u8::from(*resumed));
                w.u8(line.data_bits);
                w.u8(line.parity as u8);
                w.u8(line.stop_half_bits);
                w.u32(line.baud);
                w.u32(*transmit_room);
                w.u32(*delivery_room);
            }
            Self::Received(bytes) => w.bytes(bytes),
            Self::LineError { kind, byte, span } => {
                w.u8(kind.code());
                w.u8(u8::from(byte.is_some()));
                w.u8(byte.unwrap_or(0));
                w.u8(0);
                w.u32(*span);
            }
            Self::ModemLines { known, on } => {
                w.u8(known.0);
                w.u8(on.0);
            }
            Self::LinkDown(reason) => w.u8(reason.code()),
            Self::Timer { id, deadline } => {
                w.u8(*id);
                w.i64(deadline.0);
            }
            Self::Mark { mark, state } => {
                w.u32(mark.0);
                w.u8(state.code());
            }
            Self::TransmitRoom { grown } | Self::DeliveryRoom { grown } => w.u32(*grown),
            Self::Discarded { bytes } => w.u32(*bytes),
            Self::JobBegin { job, kind, pass, size, fields } => {
                w.u32(job.0);
                w.u16(*kind);
                w.u8(u8::from(*pass == Pass::Check));
                w.u8(u8::from(size.is_some()));
                w.u64(size.unwrap_or(0));
                w.bytes(fields.as_bytes());
            }
            Self::JobData { job, bytes } => {
                w.u32(job.0);
                w.bytes(bytes);
            }
            Self::JobEnd { job }
            | Self::Pause { job }
            | Self::Resume { job }
            | Self::Abort { job } => w.u32(job.0),
            Self::Answer { request, refused, more, bytes } => {
                w.u32(request.0);
                w.u16(refused.map_or(0, Failure::code));
                w.u8(u8::from(*more));
                w.u8(0);
                w.bytes(bytes);
            }
            Self::Restore { format, offset, total, bytes } => {
                w.u16(*format);
                w.u16(0);
                w.u32(*offset);
                w.u32(*total);
                w.bytes(bytes);
            }
            Self::Close | Self::LinkUp | Self::ForceResume | Self::Save | Self::Continue => {}
        }
    }

    /// Reads an event of `kind` from its payload. Value records inside are not
    /// looked at yet.
    pub fn decode(kind: EventKind, payload: &'a [u8]) -> Result<Self, MalformedReason> {
        Self::decode_for(kind, payload, Itself)
    }

    /// Reads an event and gives it to `taker`, if it is well formed.
    #[inline]
    pub fn decode_for<T: TakeEvent<'a>>(
        kind: EventKind,
        payload: &'a [u8],
        taker: T,
    ) -> Result<T::Taken, MalformedReason> {
        let mut reader = Reader::new(payload);
        Self::read(kind, &mut reader, taker).ok_or_else(|| reader.reason())
    }

    /// Takes an event from all that is left of a payload, and gives it to `taker`, if it is well formed; else the
    /// reader [keeps](Reader::end) what is wrong.
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    pub fn read<T: TakeEvent<'a>>(
        kind: EventKind,
        r: &mut Reader<'a>,
        taker: T,
    ) -> Option<T::Taken> {
        // In one place for all: a fault ends at the bottom.
        macro_rules! give {
            ($event:expr) => {{
                let event = $event;
                if r.is_sound() {
                    return Some(taker.take(event));
                }
            }};
        }
        match kind {
            EventKind::Settings => {
                let flags = r.u8();
                r.require("flags", flags <= 0b11);
                let values = Values::new(r.rest());
                give!(Self::Settings { first: flags & 1 != 0, last: flags & 2 != 0, values });
            }
            EventKind::Open => {
                give!(Self::Open {
                    resumed: r.flag(),
                    line: line_parameters(r),
                    transmit_room: r.u32(),
                    delivery_room: r.u32(),
                });
            }
            EventKind::Close => give!(Self::Close),
            EventKind::Received => give!(Self::Received(r.rest_not_empty())),
            EventKind::LineError => {
                let kind = LineErrorKind::from_code(r.u8());
                let kind = r.known("kind", kind, LineErrorKind::Parity);
                let (has_byte, byte) = (r.flag(), r.u8());
                r.require("byte", has_byte || byte == 0);
                r.zeros(1);
                give!(Self::LineError { kind, byte: has_byte.then_some(byte), span: r.u32() });
            }
            EventKind::ModemLines => {
                let (known, on) = (ModemLines(r.u8()), ModemLines(r.u8()));
                r.require("lines", ModemLines::ALL.contains(known) && known.contains(on));
                give!(Self::ModemLines { known, on });
            }
            EventKind::LinkDown => {
                let reason = LinkDownReason::from_code(r.u8());
                give!(Self::LinkDown(r.known("reason", reason, LinkDownReason::Failed)));
            }
            EventKind::LinkUp => give!(Self::LinkUp),
            EventKind::Timer => give!(Self::Timer { id: timer_id(r), deadline: Micros(r.i64()) }),
            EventKind::Mark => {
                let (mark, state) = (MarkId(r.non_zero("mark")), MarkState::from_code(r.u8()));
                give!(Self::Mark { mark, state: r.known("state", state, MarkState::Dropped) });
            }
            EventKind::TransmitRoom => give!(Self::TransmitRoom { grown: r.u32() }),
            EventKind::Discarded => give!(Self::Discarded { bytes: r.u32() }),
            EventKind::DeliveryRoom => give!(Self::DeliveryRoom { grown: r.u32() }),
            EventKind::JobBegin => {
                let (job, kind) = (JobId(r.non_zero("job")), r.u16());
                let pass = if r.flag() { Pass::Check } else { Pass::Run };
                let (has_size, size) = (r.flag(), r.u64());
                r.require("size", has_size || size == 0);
                let fields = Values::new(r.rest());
                give!(Self::JobBegin { job, kind, pass, size: has_size.then_some(size), fields });
            }
            EventKind::JobData => {
                give!(Self::JobData { job: JobId(r.non_zero("job")), bytes: r.rest_not_empty() });
            }
            EventKind::JobEnd => give!(Self::JobEnd { job: JobId(r.non_zero("job")) }),
            EventKind::Pause => give!(Self::Pause { job: JobId(r.non_zero("job")) }),
            EventKind::Resume => give!(Self::Resume { job: JobId(r.non_zero("job")) }),
            EventKind::Abort => give!(Self::Abort { job: JobId(r.u32()) }),
            EventKind::ForceResume => give!(Self::ForceResume),
            EventKind::Answer => {
                let (request, refused) = (RequestId(r.non_zero("request")), failure(r, "refused"));
                let more = r.flag();
                r.zeros(1);
                give!(Self::Answer { request, refused, more, bytes: r.rest() });
            }
            EventKind::Save => give!(Self::Save),
            EventKind::Restore => {
                let (format, offset, total, bytes) = state_piece(r);
                give!(Self::Restore { format, offset, total, bytes });
            }
            EventKind::Continue => give!(Self::Continue),
        }
        None
    }
}

/// Takes an event that was decoded.
///
/// In a plug-in [`take`](Self::take) is inlined once for each kind of event, where nothing
/// but that kind's part of it is left: the event itself is never put together.
///
/// ```
/// use softplug_abi::{Event, EventKind, TakeEvent};
///
/// /// Counts characters and carries no code for anything else.
/// struct Count;
///
/// impl<'a> TakeEvent<'a> for Count {
///     type Taken = usize;
///
///     fn take(self, event: Event<'a>) -> usize {
///         if let Event::Received(bytes) = event { bytes.len() } else { 0 }
///     }
/// }
///
/// assert_eq!(Event::decode_for(EventKind::Received, b"G1X2", Count), Ok(4));
/// ```
pub trait TakeEvent<'a> {
    /// What comes of it.
    type Taken;

    /// Takes the event.
    fn take(self, event: Event<'a>) -> Self::Taken;
}

/// Takes the event as it is.
struct Itself;

impl<'a> TakeEvent<'a> for Itself {
    type Taken = Event<'a>;

    fn take(self, event: Event<'a>) -> Event<'a> {
        event
    }
}

#[cfg_attr(target_arch = "wasm32", inline(always))]
fn line_parameters(r: &mut Reader<'_>) -> LineParameters {
    let data_bits = r.u8();
    let parity = match r.u8() {
        0 => Some(Parity::None),
        1 => Some(Parity::Odd),
        2 => Some(Parity::Even),
        3 => Some(Parity::Mark),
        4 => Some(Parity::Space),
        _ => None,
    };
    let parity = r.known("parity", parity, Parity::None);
    let stop_half_bits = r.u8();
    r.require("line", (5..=8).contains(&data_bits) && (2..=4).contains(&stop_half_bits));
    LineParameters { baud: r.u32(), data_bits, parity, stop_half_bits }
}

/// A failure code; 0 is none.
pub(crate) fn failure(r: &mut Reader<'_>, field: &'static str) -> Option<Failure> {
    let code = r.u16();
    let failure = Failure::from_code(code);
    r.require(field, code == 0 || failure.is_some());
    failure
}

pub(crate) fn timer_id(r: &mut Reader<'_>) -> u8 {
    let id = r.u8();
    r.require("timer", id < TIMERS);
    id
}

/// A piece of a saved state: format, offset, total, bytes. It lies inside the
/// total, which is within bounds.
pub(crate) fn state_piece<'a>(r: &mut Reader<'a>) -> (u16, u32, u32, &'a [u8]) {
    let format = r.u16();
    r.zeros(2);
    let (offset, total, bytes) = (r.u32(), r.u32(), r.rest());
    let end = u64::from(offset) + bytes.len() as u64;
    r.require("total", total <= STATE_BYTES && end <= u64::from(total));
    (format, offset, total, bytes)
}
