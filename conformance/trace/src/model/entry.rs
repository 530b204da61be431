//! The lines that mean something: what happens at a time.

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
        if let Some(mut payload) = self.what.payload().cloned() {
            payload.replace_byte(written, other);
            self.what = std::mem::replace(&mut self.what, What::Quiet).with_payload(payload);
        }
    }
}

/// What happens.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum What {
    /// `<`: these characters reach the plug-in, all at this time.
    Receive(Payload),
    /// `<<`: these characters reach the plug-in at the line rate; the first
    /// one's stop bit ends at this time.
    Burst(Payload),
    /// `>`: the plug-in's bytes; the first one's start bit begins at this time,
    /// the rest follows back to back.
    Send(Payload),
    /// `>`: the plug-in sets its modem lines.
    SetLines(ModemLevels),
    /// `>`: the plug-in sends a break of so many µs.
    SendBreak(u32),
    /// `!`: something happens on the line or in the port.
    Line(LineEvent),
    /// `?`: the host asks for or says something.
    Host(HostRequest),
    /// `=`: the plug-in takes this action.
    Act(Expected),
    /// `@`: this, exactly, is given to the plug-in, and nothing else is.
    Exact(Exact),
    /// `.`: nothing that is not listed happens until here.
    Quiet,
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

/// Which way an entry goes.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum Direction {
    /// Given to the plug-in.
    Input,
    /// Demanded of the plug-in.
    Expectation,
    /// Neither: a time.
    Neither,
}

impl What {
    /// Which way it goes.
    pub fn direction(&self) -> Direction {
        match self {
            Self::Receive(_) | Self::Burst(_) | Self::Line(_) | Self::Host(_) | Self::Exact(_) => {
                Direction::Input
            }
            Self::Send(_) | Self::SetLines(_) | Self::SendBreak(_) | Self::Act(_) => {
                Direction::Expectation
            }
            Self::Quiet => Direction::Neither,
        }
    }

    /// Whether the plug-in is given it.
    pub fn is_input(&self) -> bool {
        self.direction() == Direction::Input
    }

    /// Whether it is demanded of the plug-in.
    pub fn is_expectation(&self) -> bool {
        self.direction() == Direction::Expectation
    }

    /// The kind, as it stands at the start of the line.
    pub fn sign(&self) -> &'static str {
        match self {
            Self::Receive(_) => "<",
            Self::Burst(_) => "<<",
            Self::Send(_) | Self::SetLines(_) | Self::SendBreak(_) => ">",
            Self::Line(_) => "!",
            Self::Host(_) => "?",
            Self::Act(_) => "=",
            Self::Exact(_) => "@",
            Self::Quiet => ".",
        }
    }

    /// The bytes that it carries, if it can carry any.
    pub fn payload(&self) -> Option<&Payload> {
        match self {
            Self::Receive(payload)
            | Self::Burst(payload)
            | Self::Send(payload)
            | Self::Exact(Exact::Event { payload, .. })
            | Self::Host(
                HostRequest::Job { data: payload, .. } | HostRequest::Grant { data: payload, .. },
            )
            | Self::Act(Expected::Deliver { data: payload, .. }) => Some(payload),
            _ => None,
        }
    }

    /// This with other bytes; unchanged if it cannot carry any.
    pub(crate) fn with_payload(mut self, new: Payload) -> Self {
        match &mut self {
            Self::Receive(payload)
            | Self::Burst(payload)
            | Self::Send(payload)
            | Self::Exact(Exact::Event { payload, .. })
            | Self::Host(
                HostRequest::Job { data: payload, .. } | HostRequest::Grant { data: payload, .. },
            )
            | Self::Act(Expected::Deliver { data: payload, .. }) => *payload = new,
            _ => {}
        }
        self
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

/// What happened to a character on the line.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum LineErrorKind {
    /// The parity bit is wrong.
    Parity,
    /// The stop bit is missing.
    Framing,
    /// One of the two, the port cannot tell.
    ParityOrFraming,
    /// Characters were lost in the port.
    Overrun,
    /// The line was held low for longer than a character.
    Break,
}

impl LineErrorKind {
    /// Every kind.
    pub const ALL: &'static [Self] =
        &[Self::Parity, Self::Framing, Self::ParityOrFraming, Self::Overrun, Self::Break];

    /// The name in a trace.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Parity => "parity",
            Self::Framing => "framing",
            Self::ParityOrFraming => "parity-or-framing",
            Self::Overrun => "overrun",
            Self::Break => "break",
        }
    }
}

/// Why the link went down.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
pub enum LinkDownReason {
    /// The device is gone.
    Unplugged,
    /// The other side closed the connection.
    Disconnected,
    /// Reading or writing failed.
    Failed,
}

impl LinkDownReason {
    /// Every reason.
    pub const ALL: &'static [Self] = &[Self::Unplugged, Self::Disconnected, Self::Failed];

    /// The name in a trace.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Unplugged => "unplugged",
            Self::Disconnected => "disconnected",
            Self::Failed => "failed",
        }
    }
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
        /// The name of the reason.
        code: String,
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

/// An action that the plug-in must take.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum Expected {
    /// A delivery has ended; the time is that of its end.
    Deliver {
        /// Never 0.
        id: u32,
        /// All of its bytes, joined.
        data: Payload,
        /// How it ended.
        end: DeliveryEnd,
        /// The protocol's own code.
        status: Option<u16>,
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
        /// The name of the reason.
        code: String,
        /// The protocol's own code; `None`: 0.
        status: Option<u16>,
        /// Bytes that left for it; `None`: not looked at.
        sent: Option<u64>,
    },
    /// A check pass has ended.
    Check {
        /// The job's id.
        id: u32,
        /// What is wrong; `None`: good.
        fault: Option<CheckFault>,
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

/// How a delivery ended.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum DeliveryEnd {
    /// All of it is there.
    Complete,
    /// It failed for the reason of this name.
    Failed(String),
}

/// What a check pass found.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct CheckFault {
    /// The name of the reason.
    pub code: String,
    /// Line of the fault, from 1.
    pub line: Option<u32>,
    /// Column of the fault in bytes, from 1.
    pub column: Option<u32>,
    /// The protocol's own code.
    pub status: Option<u16>,
}
