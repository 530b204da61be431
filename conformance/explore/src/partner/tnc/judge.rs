//! Holds what leaves the plug-in, and what it tells, against what arrived at it.

use super::frame::{ACK, DC1, DC3, EOT, ETX, Ear, Heard, NAK, STX, frame};
use super::{PLUGIN_CHARACTER_TIME, PLUGIN_REPEATS};
use crate::hash::Hash128;
use crate::partner::transmitter::CHARACTER;
use crate::promise::Breach;
use softplug_abi::{Failure, LineErrorKind, Micros};
use std::collections::VecDeque;
use std::hash::Hash;
use std::sync::Arc;

/// What the plug-in may do, by the protocol's page.
#[derive(Clone)]
pub(super) struct Judge {
    /// What the plug-in hears.
    ear: Ear,
    /// DC3 came, and when.
    held_since: Option<Micros>,
    /// ACK and NAK that may still leave, in the order in which they became due.
    owed: VecDeque<u8>,
    /// How often EOT may leave by itself.
    may_end: u8,
    /// Lines of each program whose delivery has begun.
    receptions: VecDeque<Vec<u8>>,
    /// Bad blocks in a row.
    bad_blocks: u8,
    end_mark: EndMark,
    /// Lines of the job.
    lines: Arc<[Vec<u8>]>,
    job: JobState,
    /// The block that may leave next; behind the last one it is the end.
    turn: Option<usize>,
    /// The block that was not answered, and when it has left.
    unanswered: Option<(usize, Micros)>,
    /// How often it has left.
    times: u8,
    leaving: Leaving,
}

/// How far the end of a program has arrived.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
enum EndMark {
    None,
    Etx,
    EtxEot,
}

/// How far the job is.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
enum JobState {
    None,
    /// Nobody has asked for it.
    Waits,
    Asked,
    /// ETX EOT have left.
    Ended,
    Failed,
}

/// What the next character that leaves belongs to.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
enum Leaving {
    Nothing,
    /// A block, and how many of its characters have left.
    Block {
        line: usize,
        left: usize,
    },
    /// The end of the program, of which ETX has left.
    End,
}

impl Judge {
    pub(super) fn new() -> Self {
        Self {
            ear: Ear::new(PLUGIN_CHARACTER_TIME),
            held_since: None,
            owed: VecDeque::new(),
            may_end: 0,
            receptions: VecDeque::new(),
            bad_blocks: 0,
            end_mark: EndMark::None,
            lines: Arc::default(),
            job: JobState::None,
            turn: None,
            unanswered: None,
            times: 0,
            leaving: Leaving::Nothing,
        }
    }

    pub(super) fn hash(&self, now: Micros, state: &mut Hash128) {
        self.ear.hash(now, state);
        // What was told at this instant still counts otherwise than what was told before.
        self.held_since.map(|since| since < now).hash(state);
        (&self.owed, self.may_end, &self.receptions, self.bad_blocks, self.end_mark).hash(state);
        (&self.lines, self.job, self.turn, self.times, self.leaving).hash(state);
        let ahead = |(line, left): (_, Micros)| (line, (left - now).max(Micros(-1)).0);
        self.unanswered.map(ahead).hash(state);
    }

    pub(super) fn begins(&mut self, lines: Arc<[Vec<u8>]>) {
        self.lines = lines;
        self.job = JobState::Waits;
        self.turn = None;
        self.times = 0;
        self.unanswered = None;
    }

    /// Whether a job is under way.
    pub(super) fn has_job(&self) -> bool {
        matches!(self.job, JobState::Waits | JobState::Asked | JobState::Ended)
    }

    /// Lines of the job.
    pub(super) fn lines(&self) -> &[Vec<u8>] {
        &self.lines
    }

    pub(super) fn arrives(&mut self, now: Micros, byte: u8, damage: Option<LineErrorKind>) {
        if self.ear.cut_off_at().is_some_and(|at| at < now) {
            let heard = self.ear.cut_off();
            self.heard(now, heard);
        }
        let heard = self.ear.hear(now, byte, damage);
        if self.ear.is_inside() {
            self.end_mark = EndMark::None;
        }
        if let Some(heard) = heard {
            self.heard(now, heard);
        }
    }

    /// The plug-in knows of a silence up to `now`.
    pub(super) fn timers_ran(&mut self, now: Micros) {
        if self.ear.cut_off_at().is_some_and(|at| at <= now) {
            let heard = self.ear.cut_off();
            self.heard(now, heard);
        }
    }

    fn heard(&mut self, now: Micros, heard: Heard) {
        let is_sending = self.job == JobState::Asked;
        match heard {
            Heard::Header { mode: b'A' } => {
                self.bad_blocks = 0;
                self.owed.push_back(ACK);
                self.receptions.push_back(Vec::new());
            }
            // Any other asks the host, and nobody answers.
            Heard::Header { .. } if self.job == JobState::Waits => {
                self.job = JobState::Asked;
                self.owed.push_back(ACK);
                self.turn = Some(0);
                self.times = 0;
            }
            Heard::Header { .. } => {}
            Heard::Block { line } => match self.receptions.back_mut() {
                Some(lines) => {
                    lines.extend_from_slice(&line);
                    lines.push(b'\n');
                    self.bad_blocks = 0;
                    self.owed.push_back(ACK);
                }
                None => self.may_end += u8::from(!is_sending),
            },
            // They are passed over.
            Heard::BadHeader | Heard::BadBlock if is_sending => {}
            Heard::BadHeader => self.owed.push_back(NAK),
            Heard::BadBlock => {
                // One too many ends the delivery.
                let is_received = !self.receptions.is_empty();
                self.bad_blocks += u8::from(is_received);
                if self.bad_blocks <= PLUGIN_REPEATS {
                    self.owed.push_back(NAK);
                }
            }
            Heard::Sign(sign) => self.sign(now, sign),
        }
    }

    fn sign(&mut self, now: Micros, sign: u8) {
        match sign {
            DC1 => self.held_since = None,
            DC3 => self.held_since = self.held_since.or(Some(now)),
            ETX | EOT if self.receptions.is_empty() => {}
            ETX => self.end_mark = EndMark::Etx,
            EOT if self.end_mark == EndMark::Etx => self.end_mark = EndMark::EtxEot,
            EOT => self.end_mark = EndMark::None,
            ACK | NAK => {
                // One that comes too early is none; at the very end it may be one.
                let Some((line, left)) = self.unanswered.filter(|(_, left)| *left <= now) else {
                    return;
                };
                if left < now {
                    self.unanswered = None;
                }
                self.turn = match sign {
                    ACK => {
                        self.times = 0;
                        Some(line + 1)
                    }
                    _ => (self.times <= PLUGIN_REPEATS).then_some(line),
                };
            }
            _ => {}
        }
    }

    pub(super) fn leaves(&mut self, end: Micros, byte: u8) -> Option<Breach> {
        // The host that forces it ends the hold.
        let held = self.held_since.take_if(|since| *since <= end - CHARACTER);
        let breach = self.continues(end, byte);
        breach.or(held.map(|_| Breach::SentWhileHeld))
    }

    /// A character of what is leaving, or of something new.
    fn continues(&mut self, end: Micros, byte: u8) -> Option<Breach> {
        let what = match self.leaving {
            Leaving::Block { line, left } => {
                let block = frame(STX, &self.lines[line]);
                if block[left] == byte {
                    self.leaving = Leaving::Block { line, left: left + 1 };
                    if left + 1 == block.len() {
                        self.leaving = Leaving::Nothing;
                        self.unanswered = Some((line, end));
                    }
                    return None;
                }
                format!("{byte:02X} where {:02X} had to come in a block", block[left])
            }
            Leaving::End if byte == EOT => {
                self.leaving = Leaving::Nothing;
                self.job = JobState::Ended;
                return None;
            }
            Leaving::End => format!("{byte:02X} behind ETX"),
            Leaving::Nothing => return self.begins_to_leave(byte),
        };
        Some(Breach::WrongOnLine { what })
    }

    /// A character that stands alone, or begins a block or the end.
    fn begins_to_leave(&mut self, byte: u8) -> Option<Breach> {
        match byte {
            ACK | NAK => {
                // What was owed before it was dropped.
                while let Some(owed) = self.owed.pop_front() {
                    if owed == byte {
                        return None;
                    }
                }
            }
            EOT if self.may_end > 0 => {
                self.may_end -= 1;
                return None;
            }
            STX | ETX => {
                let is_end = self.turn == Some(self.lines.len());
                if let Some(line) = self.turn
                    && is_end == (byte == ETX)
                {
                    self.turn = None;
                    if is_end {
                        self.leaving = Leaving::End;
                    } else {
                        self.times += 1;
                        self.leaving = Leaving::Block { line, left: 1 };
                    }
                    return None;
                }
            }
            _ => {}
        }
        Some(Breach::WrongOnLine { what: format!("{byte:02X} where it had no reason to come") })
    }

    /// Answers that waited while the port was gone still leave: the queue keeps them.
    pub(super) fn port_is_back(&mut self) {
        self.ear.forget();
        self.held_since = None;
        self.end_mark = EndMark::None;
    }

    /// The job is done.
    pub(super) fn done(&mut self) -> Option<Breach> {
        self.times = 0;
        let is_ended = std::mem::replace(&mut self.job, JobState::None) == JobState::Ended;
        let what = || "the job is done before ETX EOT have left".to_owned();
        (!is_ended).then(|| Breach::WrongOnLine { what: what() })
    }

    /// The job has failed: nothing more of it leaves.
    pub(super) fn failed(&mut self, failure: Failure) {
        let is_asked = matches!(self.job, JobState::Asked | JobState::Ended);
        self.may_end += u8::from(is_asked && !is_known_to_control(failure));
        self.job = JobState::Failed;
        self.leaving = Leaving::Nothing;
        self.turn = None;
        self.times = 0;
        self.unanswered = None;
    }

    /// A delivery has ended: what is wrong with it, or the lines that arrived for it.
    pub(super) fn delivered(
        &mut self,
        bytes: &[u8],
        failure: Option<Failure>,
    ) -> Result<Vec<u8>, Breach> {
        let invented = || Breach::Invented { delivered: bytes.to_vec() };
        let lines = self.receptions.pop_front().ok_or_else(invented)?;
        self.bad_blocks = 0;
        let end_mark = std::mem::replace(&mut self.end_mark, EndMark::None);
        if lines != bytes {
            return Err(invented());
        }
        if failure.is_none() && end_mark != EndMark::EtxEot {
            return Err(invented());
        }
        self.may_end += u8::from(failure.is_some_and(|failure| !is_known_to_control(failure)));
        Ok(lines)
    }

    /// Lines of a delivery that has not ended.
    pub(super) fn under_way(&self) -> Option<&[u8]> {
        self.receptions.front().map(Vec::as_slice)
    }
}

/// Whether the control caused this failure, so that no EOT tells it; or there is no line for one.
fn is_known_to_control(failure: Failure) -> bool {
    matches!(
        failure,
        Failure::Refused | Failure::NoEndMark | Failure::PartnerReset | Failure::LinkDown
    )
}
