//! The lines that mean something: what happens at a time.

use softplug_abi::{Failure, LineErrorKind, LinkDownReason};

use super::{Assignment, ModemLevels, Payload, Room, When};

/// Something that happens, or must happen, at a time.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Entry {
    /// For inputs the moment, or both ends of a window; for expectations the
    /// moments at which it may happen.
    pub when: When,
    /// What happens.
    pub what: What,
    /// Where it stands in the file it was read from.
    pub line: SourceLine,
}

/// The line of a file, from 1; 0 where the entry was not read from one. Two
/// entries that differ in nothing else are equal.
#[derive(Copy, Clone, Debug, Default)]
pub struct SourceLine(pub u32);

impl PartialEq for SourceLine {
    fn eq(&self, _other: &Self) -> bool {
        true
    }
}

impl Eq for SourceLine {}

impl Entry {
    /// This with one byte in place of another in what it carries.
    pub(crate) fn replace_byte(&mut self, written: u8, other: u8) {
        if let Some(payload) = self.what.payload_mut() {
            payload.replace_byte(written, other);
        }
    }
}

/// What happens.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum What {
    /// The plug-in is given this.
    Given(Given),
    /// The plug-in does this.
    Expected(Expected),
    /// `.`: nothing that is not listed happens until here.
    Quiet,
}

/// What a plug-in is given.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Given {
    /// `<`: these characters reach the plug-in, all at this time.
    Receive(Payload),
    /// `<<`: these characters reach the plug-in at the line rate; the first
    /// one's stop bit ends at this time.
    Burst(Payload),
    /// `!`: something happens on the line or in the port.
    Line(LineEvent),
    /// `?`: the host asks for or says something.
    Host(HostRequest),
    /// `@`: this, exactly, is given to the plug-in, and nothing else is.
    Exact(Exact),
}

/// Not an event: what stands on the link before the first.
pub(crate) const UNDER_WAY: &str = "under-way";

/// A line of a flight recording.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Exact {
    /// What is under way on the link when the recording begins.
    UnderWay(Vec<Assignment>),
    /// An event of the ABI.
    Event {
        /// Its name.
        name: String,
        /// Its payload, as the ABI encodes it.
        payload: Payload,
    },
}

/// The bytes in a [`What`], borrowed as it is.
macro_rules! payload_in {
    ($what:expr) => {
        match $what {
            What::Given(
                Given::Receive(payload)
                | Given::Burst(payload)
                | Given::Exact(Exact::Event { payload, .. })
                | Given::Host(
                    HostRequest::Job { data: payload, .. }
                    | HostRequest::Grant { data: payload, .. },
                ),
            )
            | What::Expected(Expected::Send(payload) | Expected::Deliver { data: payload, .. }) => {
                Some(payload)
            }
            _ => None,
        }
    };
}

impl What {
    /// Whether the plug-in is given it.
    pub fn is_input(&self) -> bool {
        matches!(self, Self::Given(_))
    }

    /// Whether it is demanded of the plug-in.
    pub fn is_expectation(&self) -> bool {
        matches!(self, Self::Expected(_))
    }

    /// The kind, as it stands at the start of the line.
    pub fn sign(&self) -> &'static str {
        match self {
            Self::Given(Given::Receive(_)) => "<",
            Self::Given(Given::Burst(_)) => "<<",
            Self::Given(Given::Line(_)) => "!",
            Self::Given(Given::Host(_)) => "?",
            Self::Given(Given::Exact(_)) => "@",
            Self::Expected(Expected::Send(_) | Expected::SetLines(_) | Expected::SendBreak(_)) => {
                ">"
            }
            Self::Expected(_) => "=",
            Self::Quiet => ".",
        }
    }

    /// The bytes that it carries, if it can carry any.
    pub fn payload(&self) -> Option<&Payload> {
        payload_in!(self)
    }

    /// This with other bytes; unchanged if it cannot carry any.
    pub(crate) fn with_payload(mut self, new: Payload) -> Self {
        if let Some(payload) = self.payload_mut() {
            *payload = new;
        }
        self
    }

    fn payload_mut(&mut self) -> Option<&mut Payload> {
        payload_in!(self)
    }
}

/// Something that happens on the line or in the port.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum LineEvent {
    /// Modem lines change, inputs only.
    Modem(ModemLevels),
    /// A damaged character whose place is not exact, a break or an overrun.
    Error {
        /// What happened.
        kind: LineErrorKind,
        /// The character as it was read, if known.
        byte: Option<u8>,
        /// 0: exactly here. n: one of the last n bytes received.
        span: u32,
    },
    /// The port is gone.
    Down(LinkDownReason),
    /// The port is back.
    Up,
}

/// What the host asks for or says.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum HostRequest {
    /// `job`, or `send` for a job of kind "send" without fields.
    Job {
        /// Never 0.
        id: u32,
        /// The job's kind, as the manifest names it.
        kind: String,
        /// The job's fields.
        fields: Vec<Assignment>,
        /// The job's data.
        data: Payload,
    },
    /// Pause the job.
    Pause(u32),
    /// Go on with the job.
    Resume(u32),
    /// Abort the job; 0: the delivery under way.
    Abort(u32),
    /// Go on although the partner holds the line.
    ForceResume,
    /// The host frees so many bytes of room.
    Room(Room),
    /// From here on deliveries are taken as they come, or not.
    Drain(Drain),
    /// A request is granted.
    Grant {
        /// The request's id.
        id: u32,
        /// Data of the answer.
        data: Payload,
    },
    /// A request is refused.
    Refuse {
        /// The request's id.
        id: u32,
        /// Why.
        failure: Failure,
    },
    /// Save, and restore into a fresh instance.
    Swap,
    /// Close the link.
    Close,
    /// Open the link again.
    Open,
}

/// Whether the host takes deliveries as they come.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum Drain {
    /// At once; the state at the start.
    Auto,
    /// Only when a `room` line says so.
    Off,
}

/// What a plug-in must do.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Expected {
    /// `>`: the plug-in's bytes; the first one's start bit begins at this time,
    /// the rest follows back to back.
    Send(Payload),
    /// `>`: the plug-in sets its modem lines.
    SetLines(ModemLevels),
    /// `>`: the plug-in sends a break of so many µs.
    SendBreak(u32),
    /// `=`, as all below: a delivery has ended; the time is that of its end.
    Deliver {
        /// Never 0.
        id: u32,
        /// All of its bytes, joined.
        data: Payload,
        /// `None`: complete.
        failure: Option<Failure>,
        /// The protocol's own code, 0 without.
        status: u16,
        /// The name that the plug-in found.
        name: Option<String>,
    },
    /// A job is done.
    Done {
        /// The job's id.
        id: u32,
        /// Bytes that left for it; `None`: not looked at.
        sent: Option<u64>,
    },
    /// A job has failed.
    Fail {
        /// The job's id.
        id: u32,
        /// Why.
        failure: Failure,
        /// The protocol's own code, 0 without.
        status: u16,
        /// Bytes that left for it; `None`: not looked at.
        sent: Option<u64>,
    },
    /// A check pass has ended.
    Check {
        /// The job's id.
        id: u32,
        /// `None`: good, without all below.
        failure: Option<Failure>,
        /// The protocol's own code, 0 without.
        status: u16,
        /// Line of the fault, from 1; 0 without.
        line: u32,
        /// Column of the fault in bytes, from 1; 0 without.
        column: u32,
    },
    /// The plug-in asks the host for something.
    Request {
        /// Never 0.
        id: u32,
        /// The request's kind, as the manifest names it.
        kind: String,
        /// The request's fields.
        fields: Vec<Assignment>,
    },
    /// The request no longer matters.
    Withdraw(u32),
}
