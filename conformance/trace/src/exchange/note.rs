//! What was left out on the way from one format to another.

use std::collections::BTreeMap;
use std::fmt;

/// Something that one side has and the other cannot hold.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Note {
    /// What.
    pub what: Left,
    /// How many of it.
    pub count: usize,
    /// Where the first was: a line of a text, a packet of a capture, from 1; 0: no
    /// place.
    pub first: u32,
}

/// What cannot be held.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub enum Left {
    /// Id, clauses, configuration and so on.
    FrontMatter,
    /// `?` lines.
    Requests,
    /// `=` lines.
    Actions,
    /// Events of a flight recording.
    ExactEvents,
    /// `.` lines.
    Quiet,
    /// Windows of time.
    Windows,
    /// Alternatives but the first.
    Alternatives,
    /// `down` and `up`.
    Links,
    /// Modem lines.
    ModemLines,
    /// Modem lines of which the state is not known.
    UnknownModemLines,
    /// That a character is damaged, or characters were lost.
    LineErrors,
    /// That a damage may also be of another kind.
    EitherError,
    /// That the place of an error is not known, or the byte that an overrun has.
    ErrorPlace,
    /// Breaks, either way.
    Breaks,
    /// How long a break that was sent is.
    BreakLength,
    /// Breaks that were sent, of unknown length.
    SentBreaks,
    /// Packets that are not of a serial line.
    OtherPackets,
    /// Packets without a time.
    TimelessPackets,
    /// Packets of which the capture holds only a part.
    CutPackets,
    /// Events of types that the format does not define.
    UnknownEvents,
    /// Bytes of events that carry none.
    StrayBytes,
    /// Places where the capture itself says that it lost data.
    LostByCapture,
    /// Rows of other analysers, or without data.
    OtherRows,
}

impl Left {
    /// The name for machines.
    pub const fn name(self) -> &'static str {
        match self {
            Self::FrontMatter => "front-matter",
            Self::Requests => "requests",
            Self::Actions => "actions",
            Self::ExactEvents => "exact-events",
            Self::Quiet => "quiet",
            Self::Windows => "windows",
            Self::Alternatives => "alternatives",
            Self::Links => "links",
            Self::ModemLines => "modem-lines",
            Self::UnknownModemLines => "unknown-modem-lines",
            Self::LineErrors => "line-errors",
            Self::EitherError => "either-error",
            Self::ErrorPlace => "error-place",
            Self::Breaks => "breaks",
            Self::BreakLength => "break-length",
            Self::SentBreaks => "sent-breaks",
            Self::OtherPackets => "other-packets",
            Self::TimelessPackets => "timeless-packets",
            Self::CutPackets => "cut-packets",
            Self::UnknownEvents => "unknown-events",
            Self::StrayBytes => "stray-bytes",
            Self::LostByCapture => "lost-by-capture",
            Self::OtherRows => "other-rows",
        }
    }

    const fn text(self) -> &'static str {
        match self {
            Self::FrontMatter => "the front matter stays in the trace",
            Self::Requests => "requests of the host (`?`) stay in the trace",
            Self::Actions => "expected actions (`=`) stay in the trace",
            Self::ExactEvents => "events of a flight recording (`@`) stay in the trace",
            Self::Quiet => "`.` lines stay in the trace",
            Self::Windows => "of each window only its start was written",
            Self::Alternatives => "of each block of alternatives only the first was written",
            Self::Links => "`down` and `up` were left out",
            Self::ModemLines => "modem lines were left out",
            Self::UnknownModemLines => {
                "modem lines of unknown state were written as off, or as the opposite of their first change"
            }
            Self::LineErrors => {
                "line errors were left out; of damaged characters only the byte was written"
            }
            Self::EitherError => "parity-or-framing errors were written as framing errors",
            Self::ErrorPlace => "line errors were written without the span or byte that they have",
            Self::Breaks => "breaks were left out",
            Self::BreakLength => "breaks that are sent were written without their length",
            Self::SentBreaks => {
                "breaks that were sent were left out: the file does not tell their length"
            }
            Self::OtherPackets => "packets that are not of a serial line were left out",
            Self::TimelessPackets => "packets without a time were left out",
            Self::CutPackets => {
                "packets of which the capture holds only a part: their last bytes are missing"
            }
            Self::UnknownEvents => "events of unknown types were left out",
            Self::StrayBytes => "bytes of events that carry none were left out",
            Self::LostByCapture => "the capture says that it lost data",
            Self::OtherRows => "rows of other analysers, or without data, were left out",
        }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.what.text())?;
        match (self.count, self.first) {
            (1, 0) => Ok(()),
            (1, first) => write!(f, " (at {first})"),
            (count, 0) => write!(f, " ({count} times)"),
            (count, first) => write!(f, " ({count} times, first at {first})"),
        }
    }
}

/// Notes as they come up.
#[derive(Default)]
pub(super) struct Notes(BTreeMap<Left, (usize, u32)>);

impl Notes {
    /// One more of it, here.
    pub(super) fn add(&mut self, what: Left, place: u32) {
        self.0.entry(what).or_insert((0, place)).0 += 1;
    }

    /// What an exporter finds that its format has no place for.
    pub(super) fn unheld(&mut self, what: &crate::What, place: u32) {
        use crate::{Expected, Given, LineEvent, What};
        let left = match what {
            What::Given(Given::Receive(_) | Given::Burst(_))
            | What::Expected(Expected::Send(_)) => return,
            What::Expected(Expected::SetLines(_))
            | What::Given(Given::Line(LineEvent::Modem(_))) => Left::ModemLines,
            What::Expected(Expected::SendBreak(_))
            | What::Given(Given::Line(LineEvent::Error {
                kind: softplug_abi::LineErrorKind::Break,
                ..
            })) => Left::Breaks,
            What::Given(Given::Line(LineEvent::Error { .. })) => Left::LineErrors,
            What::Given(Given::Line(LineEvent::Down(_) | LineEvent::Up)) => Left::Links,
            What::Given(Given::Host(_)) => Left::Requests,
            What::Given(Given::Exact(_)) => Left::ExactEvents,
            What::Expected(_) => Left::Actions,
            What::Quiet => Left::Quiet,
        };
        self.add(left, place);
    }

    pub(super) fn finish(self) -> Vec<Note> {
        let note = |(what, (count, first))| Note { what, count, first };
        self.0.into_iter().map(note).collect()
    }
}
