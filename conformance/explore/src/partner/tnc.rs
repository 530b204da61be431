//! A small TNC control: it asks for a program, takes it block by block, and puts one out.

mod frame;
mod judge;

use super::transmitter::{CHARACTER, Transmitter};
use super::{Partner, Sent};
use crate::end::Told;
use crate::hash::Hash128;
use crate::promise::{Breach, Wrong};
use frame::{ACK, EOT, ETX, Ear, Heard, NAK, SOH, STX, frame};
use judge::Judge;
use softplug_abi::{LineErrorKind, Micros};
use std::hash::Hash;
use std::sync::Arc;

/// What it asks for, and under which name it puts out.
const ASKS: &[u8] = b"H1E";
const ANNOUNCES: &[u8] = b"H1A";
/// What it puts out, of which the check looks like DC3.
const PROGRAM: &[&[u8]] = &[b"17"];

/// It puts out so long after the other program came to its end.
const BEFORE_PUTTING_OUT: Micros = Micros(7_000);
/// It waits so long for an answer.
const ANSWER_TIME: Micros = Micros(25_000);
/// So long for a block.
const BLOCK_TIME: Micros = Micros(130_000);
/// And for a character of a block.
const CHARACTER_TIME: Micros = Micros(12_000);
/// How often it says the same, or refuses a block, again.
const REPEATS: u8 = 1;

/// What the plan sets `character_time` of the plug-in to.
const PLUGIN_CHARACTER_TIME: Micros = Micros(10_000);
/// And `repeats`.
const PLUGIN_REPEATS: u8 = 1;

/// A control of which the phases follow each other: first it asks, then it puts out.
#[derive(Clone)]
pub(crate) struct Tnc {
    phase: Phase,
    /// When it stops waiting for what it waits for.
    due: Option<Micros>,
    /// What it hears.
    ear: Ear,
    /// Lines that it took.
    taken: Vec<u8>,
    transmitter: Transmitter,
    /// When all that was sent has left.
    left_at: Micros,
    judge: Judge,
    /// Though nothing went wrong so far, the job is done, and its own program was delivered.
    is_done: bool,
    is_delivered: bool,
}

/// What it is about.
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug)]
enum Phase {
    /// It asks as soon as there is a job.
    Idle,
    /// The header that asks was sent so often again.
    Asks {
        again: u8,
    },
    /// It takes blocks, and has refused so many in a row.
    Takes {
        refused: u8,
    },
    /// It is about to put out.
    Rests,
    /// A header (0) or line was sent so often again.
    PutsOut {
        frame: usize,
        again: u8,
    },
    Finished,
}

impl Tnc {
    pub(crate) fn new() -> Self {
        Self {
            phase: Phase::Idle,
            due: None,
            ear: Ear::new(CHARACTER_TIME),
            taken: Vec::new(),
            transmitter: Transmitter::default(),
            left_at: Micros::ZERO,
            judge: Judge::new(),
            is_done: false,
            is_delivered: false,
        }
    }
}

impl Partner for Tnc {
    fn fork(&self) -> Box<dyn Partner> {
        Box::new(self.clone())
    }

    fn hash(&self, now: Micros, state: &mut Hash128) {
        let ahead = |time: Micros| (time - now).max(Micros::ZERO).0;
        (self.phase, self.due.map(ahead), &self.taken).hash(state);
        ahead(self.left_at).hash(state);
        self.transmitter.hash(now, state);
        (self.is_done, self.is_delivered).hash(state);
        self.ear.hash(now, state);
        self.judge.hash(now, state);
    }

    fn next(&self) -> Option<Micros> {
        self.due.into_iter().chain(self.transmitter.next()).min()
    }

    fn tick(&mut self, now: Micros) -> Sent {
        if self.due.is_some_and(|due| due <= now) {
            self.due = None;
            self.goes_on(now);
        }
        self.transmitter.transmit(now)
    }

    fn receive(&mut self, now: Micros, byte: u8, damage: Option<LineErrorKind>) -> Sent {
        if matches!(self.phase, Phase::Idle | Phase::Rests | Phase::Finished) {
            return self.transmitter.transmit(now);
        }
        if self.ear.cut_off_at().is_some_and(|at| at < now) {
            self.ear.forget();
        }
        if let Some(heard) = self.ear.hear(now, byte, damage) {
            self.heard(now, heard);
        }
        if let Phase::Takes { .. } = self.phase
            && let Some(at) = self.ear.cut_off_at()
        {
            self.due = Some(at);
        }
        self.transmitter.transmit(now)
    }

    fn begins(&mut self, data: &Arc<[u8]>) {
        self.judge.begins(lines_of(data).into());
        if self.phase == Phase::Idle {
            self.due = Some(Micros::ZERO);
        }
    }

    fn leaves(&mut self, end: Micros, byte: u8) -> Option<Breach> {
        self.judge.leaves(end, byte)
    }

    fn arrives(&mut self, now: Micros, byte: u8, damage: Option<LineErrorKind>) {
        self.judge.arrives(now, byte, damage);
    }

    fn timers_ran(&mut self, now: Micros) {
        self.judge.timers_ran(now);
    }

    fn port_is_back(&mut self) {
        self.judge.port_is_back();
    }

    fn told(&mut self, told: &Told, wrong: &Wrong) -> Option<Breach> {
        let is_usual = *wrong == Wrong::default();
        match told {
            Told::Delivered { bytes, failure } => {
                let arrived = match self.judge.delivered(bytes, *failure) {
                    Ok(arrived) => arrived,
                    Err(breach) => return Some(breach),
                };
                match failure {
                    None => {
                        self.is_delivered = is_usual;
                        let sent: Vec<Vec<u8>> = PROGRAM.iter().map(|line| line.to_vec()).collect();
                        differs(&sent, &arrived)
                    }
                    Some(failure) => {
                        is_usual.then_some(Breach::FailedForNothing { failure: *failure })
                    }
                }
            }
            Told::Done => {
                self.is_done = is_usual;
                let taken = std::mem::take(&mut self.taken);
                self.judge.done().or_else(|| differs(self.judge.lines(), &taken))
            }
            Told::Failed(failure) => {
                self.judge.failed(*failure);
                self.taken.clear();
                is_usual.then_some(Breach::FailedForNothing { failure: *failure })
            }
            Told::Requested(_) => None,
        }
    }

    fn at_rest(&self, wrong: &Wrong) -> Option<Breach> {
        if let Some(lines) = self.judge.under_way() {
            return Some(Breach::Lost { bytes: lines.to_vec() });
        }
        let is_usual = *wrong == Wrong::default();
        (is_usual && !(self.is_done && self.is_delivered)).then_some(Breach::NotDelivered)
    }
}

impl Tnc {
    fn heard(&mut self, now: Micros, heard: Heard) {
        // An answer that comes before all has left is none.
        let is_answer = now >= self.left_at;
        match (self.phase, heard) {
            (Phase::Asks { .. }, Heard::Sign(ACK)) if is_answer => {
                self.phase = Phase::Takes { refused: 0 };
                self.due = Some(now + BLOCK_TIME);
            }
            (Phase::Asks { .. } | Phase::PutsOut { .. }, Heard::Sign(NAK)) if is_answer => {
                self.says_again(now);
            }
            (Phase::Asks { .. } | Phase::Takes { .. }, Heard::Sign(EOT)) => self.rests(now),
            (Phase::Takes { .. }, Heard::Block { line }) => {
                if self.judge.has_job() {
                    self.taken.extend_from_slice(&line);
                    self.taken.push(b'\n');
                }
                self.phase = Phase::Takes { refused: 0 };
                self.answers(now, ACK);
            }
            (Phase::Takes { .. }, Heard::BadBlock | Heard::BadHeader | Heard::Header { .. }) => {
                self.refuses(now);
            }
            (Phase::PutsOut { frame, .. }, Heard::Sign(ACK)) if is_answer => {
                self.puts_out(now, frame + 1, 0);
            }
            (Phase::PutsOut { .. }, Heard::Sign(EOT)) => self.finishes(),
            _ => {}
        }
    }

    /// What it waited for did not come.
    fn goes_on(&mut self, now: Micros) {
        match self.phase {
            Phase::Idle => self.asks(now, 0),
            Phase::Takes { .. } if self.ear.is_inside() => {
                self.ear.forget();
                self.refuses(now);
            }
            Phase::Takes { .. } => {
                self.sends(now, &[EOT]);
                self.rests(now);
            }
            Phase::Rests => self.puts_out(now, 0, 0),
            Phase::Asks { .. } | Phase::PutsOut { .. } => self.says_again(now),
            Phase::Finished => {}
        }
    }

    fn asks(&mut self, now: Micros, again: u8) {
        self.phase = Phase::Asks { again };
        self.sends(now, &frame(SOH, ASKS));
        self.due = Some(self.left_at + ANSWER_TIME);
    }

    fn puts_out(&mut self, now: Micros, at: usize, again: u8) {
        self.phase = Phase::PutsOut { frame: at, again };
        match at.checked_sub(1).map(|line| PROGRAM.get(line)) {
            None => self.sends(now, &frame(SOH, ANNOUNCES)),
            Some(Some(line)) => self.sends(now, &frame(STX, line)),
            Some(None) => {
                self.sends(now, &[ETX, EOT]);
                self.finishes();
                return;
            }
        }
        self.due = Some(self.left_at + ANSWER_TIME);
    }

    /// Says the same again, or gives up.
    fn says_again(&mut self, now: Micros) {
        match self.phase {
            Phase::Asks { again } if again < REPEATS => self.asks(now, again + 1),
            Phase::PutsOut { frame, again } if again < REPEATS => {
                self.puts_out(now, frame, again + 1);
            }
            Phase::Asks { .. } => {
                self.sends(now, &[EOT]);
                self.rests(now);
            }
            _ => {
                self.sends(now, &[EOT]);
                self.finishes();
            }
        }
    }

    /// Refuses a block, or gives up.
    fn refuses(&mut self, now: Micros) {
        let Phase::Takes { refused } = self.phase else { return };
        if refused < REPEATS {
            self.phase = Phase::Takes { refused: refused + 1 };
            self.answers(now, NAK);
        } else {
            self.sends(now, &[EOT]);
            self.rests(now);
        }
    }

    fn answers(&mut self, now: Micros, answer: u8) {
        self.sends(now, &[answer]);
        self.due = Some(self.left_at + BLOCK_TIME);
    }

    fn rests(&mut self, now: Micros) {
        self.ear.forget();
        self.phase = Phase::Rests;
        self.due = Some(now.max(self.left_at) + BEFORE_PUTTING_OUT);
    }

    fn finishes(&mut self) {
        self.ear.forget();
        self.phase = Phase::Finished;
        self.due = None;
    }

    fn sends(&mut self, now: Micros, bytes: &[u8]) {
        let begin = now.max(self.left_at);
        self.left_at = Micros(begin.0 + CHARACTER.0 * bytes.len() as i64);
        self.transmitter.send(bytes);
    }
}

/// Lines without their ends; what stands behind the last end is a line too.
fn lines_of(data: &[u8]) -> Vec<Vec<u8>> {
    let mut lines: Vec<Vec<u8>> = data.split(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
    lines.pop_if(|last| last.is_empty());
    lines
}

/// How lines that were taken differ from those that were sent.
fn differs(sent: &[Vec<u8>], taken: &[u8]) -> Option<Breach> {
    let mut next = 0;
    let (mut is_short, mut is_doubled) = (false, false);
    for line in lines_of(taken) {
        if let Some(skipped) = sent[next..].iter().position(|other| *other == line) {
            is_short |= skipped > 0;
            next += skipped + 1;
        } else if next > 0 && sent[next - 1] == line {
            is_doubled = true;
        } else {
            return Some(Breach::Altered { delivered: taken.to_vec() });
        }
    }
    if is_short || next < sent.len() {
        return Some(Breach::NotDelivered);
    }
    is_doubled.then_some(Breach::Doubled)
}
