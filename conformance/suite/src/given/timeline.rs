//! What a plug-in is given in one run of a trace, each at its time.

use super::case::Case;
use super::fields::records;
use super::lines::{bad_kind, line_parameters, modem_lines};
use softplug_abi::manifest::{FieldError, Manifest};
use softplug_abi::{Failure, JobId, LineErrorKind, LinkDownReason, Micros, ModemLines};
use softplug_link::Job;
use softplug_trace::{
    self as trace, Drain, HostRequest, LineEvent, Payload, PayloadError, Piece, What, When,
};

/// Inputs in the order in which they come.
#[derive(Clone, Debug, Default)]
pub(crate) struct Timeline {
    pub(crate) given: Vec<Given>,
    pub(crate) end: Micros,
}

/// One input.
#[derive(Clone, Debug)]
pub(crate) struct Given {
    pub(crate) at: Micros,
    pub(crate) what: Input,
}

#[derive(Clone, Debug)]
pub(crate) enum Input {
    /// Characters of one time, which may be cut anywhere.
    Bytes(Vec<u8>),
    /// One character of a burst.
    Character(u8),
    /// A damaged character, an overrun or a break.
    Damaged {
        kind: LineErrorKind,
        byte: Option<u8>,
        span: u32,
    },
    /// Modem lines change: which, and those of them that are on.
    Modem(ModemLines, ModemLines),
    Down(LinkDownReason),
    Up,
    Host(Asked),
}

/// What the host does.
#[derive(Clone, Debug)]
pub(crate) enum Asked {
    Job(Job, Vec<u8>),
    Pause(u32),
    Resume(u32),
    Abort(u32),
    ForceResume,
    Room(u32),
    Drain(Drain),
    Answer(u32, Result<Vec<u8>, Failure>),
    Swap,
    Close,
    Open,
}

impl Input {
    pub(crate) fn is_from_line(&self) -> bool {
        !matches!(self, Self::Host(_))
    }
}

/// Which end of each window an input takes.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Windows {
    Early,
    /// All late.
    Late,
    /// Only the one with this number, from 1, late.
    LateOnly(u32),
}

/// A trace asks for what the plug-in or the replay cannot do.
///
/// ```
/// use softplug_conformance::TimelineError;
///
/// let reason = "the plug-in has no job \"send-eia\"".to_owned();
/// let error = TimelineError { line: 12, reason };
/// assert_eq!(error.to_string(), "line 12: the plug-in has no job \"send-eia\"");
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("line {line}: {reason}")]
pub struct TimelineError {
    /// The line of the trace's file.
    pub line: u32,
    /// Why, for people.
    pub reason: String,
}

/// What of a trace's line the plug-in or the replay cannot do.
#[derive(Debug, thiserror::Error)]
pub(crate) enum NotPossible {
    #[error(transparent)]
    Payload(#[from] PayloadError),
    #[error(transparent)]
    Field(#[from] FieldError),
    #[error("the plug-in takes no job of kind \"{0}\"")]
    Job(String),
    #[error("the plug-in makes no request of kind \"{0}\"")]
    Request(String),
    #[error("nothing comes over a port that is down")]
    Silent,
    #[error("a closed link takes no job")]
    JobOfClosed,
    #[error("on a closed link no plug-in takes over from another")]
    SwapOfClosed,
    #[error("room to transmit grows as bytes leave; only room for deliveries can be given")]
    TransmitRoom,
}

impl NotPossible {
    /// With the line of the trace's file that asks for it.
    pub(crate) fn at(self, line: u32) -> TimelineError {
        TimelineError { line, reason: self.to_string() }
    }
}

impl Timeline {
    pub(crate) fn new(
        case: &Case,
        manifest: &Manifest,
        windows: Windows,
    ) -> Result<Self, TimelineError> {
        let line = line_parameters(&case.trace.front.line);
        let reaction = Micros(i64::from(case.trace.front.line.reaction));
        let mut given = Vec::new();
        let mut window = 0;
        let mut condition = Condition { is_open: true, is_up: true };
        for entry in case.trace.inputs() {
            let number = entry.line.0;
            condition.take(&entry.what).map_err(|error| error.at(number))?;
            let bytes = |error: PayloadError| NotPossible::from(error).at(number);
            let at = place(entry.when, windows, &mut window);
            let What::Given(what) = &entry.what else { continue };
            match what {
                trace::Given::Receive(payload) => {
                    let pieces = payload.pieces(&case.files()).map_err(bytes)?;
                    given.extend(pieces.into_iter().map(|piece| {
                        let what = match piece {
                            Piece::Bytes(bytes) => Input::Bytes(bytes),
                            Piece::Bad { kind, byte } => damaged(kind, byte),
                        };
                        Given { at: at + reaction, what }
                    }));
                }
                trace::Given::Burst(payload) => {
                    let pieces = payload.pieces(&case.files()).map_err(bytes)?;
                    let characters = pieces.into_iter().flat_map(|piece| match piece {
                        Piece::Bytes(bytes) => bytes.into_iter().map(Input::Character).collect(),
                        Piece::Bad { kind, byte } => vec![damaged(kind, byte)],
                    });
                    given.extend(characters.enumerate().map(|(n, what)| Given {
                        at: at + line.characters(n as u64) + reaction,
                        what,
                    }));
                }
                trace::Given::Line(event) => given.push(Given { at, what: of_line(event) }),
                trace::Given::Host(request) => {
                    let asked = of_host(case, manifest, request);
                    let asked = asked.map_err(|error| error.at(number))?;
                    given.push(Given { at, what: Input::Host(asked) });
                }
                trace::Given::Exact(_) => {}
            }
        }
        let mut timeline = Self { given, end: micros(case.trace.end()) };
        timeline.sort();
        Ok(timeline)
    }

    /// In the order of time; of one time, the line comes before the host.
    pub(crate) fn sort(&mut self) {
        self.given.sort_by_key(|given| (given.at, !given.what.is_from_line()));
    }
}

/// What of a link decides which inputs there can be.
struct Condition {
    is_open: bool,
    is_up: bool,
}

impl Condition {
    /// # Errors
    /// There is no such input now.
    fn take(&mut self, what: &What) -> Result<(), NotPossible> {
        let What::Given(given) = what else { return Ok(()) };
        match given {
            trace::Given::Host(HostRequest::Close) => self.is_open = false,
            trace::Given::Host(HostRequest::Open) => (self.is_open, self.is_up) = (true, true),
            trace::Given::Line(LineEvent::Down(_)) => self.is_up = false,
            trace::Given::Line(LineEvent::Up) => self.is_up = true,
            trace::Given::Host(HostRequest::Job { .. }) if !self.is_open => {
                return Err(NotPossible::JobOfClosed);
            }
            trace::Given::Host(HostRequest::Swap) if !self.is_open => {
                return Err(NotPossible::SwapOfClosed);
            }
            trace::Given::Receive(_) | trace::Given::Burst(_) if self.is_open && !self.is_up => {
                return Err(NotPossible::Silent);
            }
            _ => {}
        }
        Ok(())
    }
}

/// How many inputs have a window.
pub(crate) fn windows(case: &Case) -> u32 {
    case.trace.inputs().filter(|entry| entry.when.is_window()).count() as u32
}

pub(crate) fn micros(time: softplug_trace::Time) -> Micros {
    Micros(i64::try_from(time.0).unwrap_or(i64::MAX))
}

fn place(when: When, windows: Windows, window: &mut u32) -> Micros {
    if !when.is_window() {
        return micros(when.from);
    }
    *window += 1;
    let late = match windows {
        Windows::Early => false,
        Windows::Late => true,
        Windows::LateOnly(number) => number == *window,
    };
    micros(if late { when.to } else { when.from })
}

fn damaged(kind: softplug_trace::BadKind, byte: u8) -> Input {
    Input::Damaged { kind: bad_kind(kind), byte: Some(byte), span: 0 }
}

fn of_line(event: &LineEvent) -> Input {
    match event {
        LineEvent::Modem(levels) => {
            let (named, on) = modem_lines(levels);
            Input::Modem(named, on)
        }
        LineEvent::Error { kind, byte, span } => {
            Input::Damaged { kind: *kind, byte: *byte, span: *span }
        }
        LineEvent::Down(reason) => Input::Down(*reason),
        LineEvent::Up => Input::Up,
    }
}

fn of_host(case: &Case, manifest: &Manifest, request: &HostRequest) -> Result<Asked, NotPossible> {
    let bytes = |payload: &Payload| payload.bytes(&case.files());
    Ok(match request {
        HostRequest::Job { id, kind, fields, data } => {
            let data = bytes(data)?;
            let place = manifest.job_kind(kind);
            let place = place.ok_or_else(|| NotPossible::Job(kind.clone()))?;
            let job = Job {
                id: JobId(*id),
                kind: place,
                size: Some(data.len() as u64),
                fields: records(&manifest.jobs[usize::from(place)], fields)?,
                check: manifest.needs.check_pass,
            };
            Asked::Job(job, data)
        }
        HostRequest::Pause(id) => Asked::Pause(*id),
        HostRequest::Resume(id) => Asked::Resume(*id),
        HostRequest::Abort(id) => Asked::Abort(*id),
        HostRequest::ForceResume => Asked::ForceResume,
        HostRequest::Room(room) => match (room.transmit, room.delivery) {
            (None, Some(bytes)) => Asked::Room(bytes),
            _ => return Err(NotPossible::TransmitRoom),
        },
        HostRequest::Drain(drain) => Asked::Drain(*drain),
        HostRequest::Grant { id, data } => Asked::Answer(*id, Ok(bytes(data)?)),
        HostRequest::Refuse { id, failure } => Asked::Answer(*id, Err(*failure)),
        HostRequest::Swap => Asked::Swap,
        HostRequest::Close => Asked::Close,
        HostRequest::Open => Asked::Open,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use softplug_trace::Time;

    const HEAD: &str = "id: a.b.c\ntitle: t\nprofile: a\nclauses: a.b\nlevel: must\n\
                        line: 9600 8N1 depth=1 reaction=0\nsince: 1\norigin: hand-written\n---\n";

    #[test]
    fn what_a_link_cannot_be_given_is_refused() {
        let refused = |lines: &str| {
            let trace = format!("{HEAD}{lines}. 9.000000\n");
            let trace = softplug_trace::Trace::parse(&trace).unwrap();
            let mut condition = Condition { is_open: true, is_up: true };
            trace
                .inputs()
                .find_map(|entry| condition.take(&entry.what).err())
                .map(|e| e.to_string())
        };
        let job = refused("? 1.000000 close\n? 2.000000 send 1 \"A\"\n");
        assert_eq!(job.unwrap(), "a closed link takes no job");
        let byte = refused("! 1.000000 down failed\n< 2.000000 \"A\"\n");
        assert_eq!(byte.unwrap(), "nothing comes over a port that is down");
        let swap = refused("? 1.000000 close\n? 2.000000 swap\n");
        assert_eq!(swap.unwrap(), "on a closed link no plug-in takes over from another");
        let good = "! 1.000000 down failed\n! 2.000000 up\n< 3.000000 \"A\"\n? 4.000000 close\n\
                    ? 5.000000 open\n? 6.000000 send 1 \"A\"\n? 7.000000 swap\n";
        assert_eq!(refused(good), None);
    }

    #[test]
    fn each_window_is_tried_at_both_ends() {
        let window = When { from: Time(5), to: Time(9) };
        let places = |windows| {
            let mut number = 0;
            [window, When::at(Time(7)), window].map(|when| place(when, windows, &mut number).0)
        };
        assert_eq!(places(Windows::Early), [5, 7, 5]);
        assert_eq!(places(Windows::Late), [9, 7, 9]);
        assert_eq!(places(Windows::LateOnly(1)), [9, 7, 5]);
        assert_eq!(places(Windows::LateOnly(2)), [5, 7, 9]);
    }
}
