//! What a partner and a host could do next.

mod answers;
mod blocks;
mod habits;
mod hosts;
mod upper;

pub(crate) use upper::{Plain, Upper};

use super::Station;
use super::frame::{DLE, ETX, NAK, STX};
use super::state::State;
use crate::dice::Dice;
use crate::model::{Conditions, Given, HostRequest, LineInput, Proposal};
use habits::Habit;
use softplug_abi::{LineErrorKind, Micros};
use std::collections::VecDeque;

/// The partner's plan, and how well it behaves.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Partner {
    plan: VecDeque<Proposal>,
    mood: Option<Mood>,
    /// The session is a long one, with this number.
    long: Option<u64>,
    /// The session is about a preset.
    is_preset: bool,
}

/// A host with less room than this often lets it run out.
const SMALL_ROOM: usize = 256;

#[derive(Copy, Clone, PartialEq, Debug)]
struct Mood {
    /// One thing in so many is wrong.
    faults: u64,
    /// One of so many beginnings in idle is the partner's.
    receptions: u64,
    /// The host keeps what is delivered.
    keeps: bool,
    habit: Habit,
}

impl Mood {
    fn draw(partner: &Partner, station: &Station, upper: &dyn Upper, dice: &mut Dice) -> Self {
        let habit = match partner.long {
            Some(number) => Habit::filling(station, upper, number),
            None if partner.is_preset && dice.one_in(2) => Habit::failing(dice),
            None => Habit::draw(station, upper, dice),
        };
        let faults: &[u64] = if partner.is_preset { &[2, 3, 8] } else { &[1_000, 30, 8, 3, 2] };
        let faults = *dice.pick(faults);
        let is_small = upper.room(station).whole() < SMALL_ROOM;
        Self {
            faults,
            receptions: *dice.pick(&[2, 2, 1, 6]),
            keeps: dice.one_in(if is_small { 2 } else { 4 }) && habit == Habit::Any,
            habit,
        }
    }
}

pub(crate) fn line(wait: i64, input: LineInput) -> Proposal {
    Proposal { wait: Micros(wait), given: Given::Line(input) }
}

pub(crate) fn bytes(wait: i64, bytes: &[u8]) -> Proposal {
    line(wait, LineInput::Bytes(bytes.to_vec()))
}

pub(crate) fn host(wait: i64, request: HostRequest) -> Proposal {
    Proposal { wait: Micros(wait), given: Given::Host(request) }
}

pub(crate) fn nothing(wait: i64) -> Proposal {
    Proposal { wait: Micros(wait), given: Given::Nothing }
}

/// What can be wrong with a character.
const KINDS: [LineErrorKind; 4] = [
    LineErrorKind::Parity,
    LineErrorKind::Framing,
    LineErrorKind::ParityOrFraming,
    LineErrorKind::Overrun,
];

/// A character that was damaged, or with which others were lost.
fn damaged(wait: i64, byte: u8, dice: &mut Dice) -> Proposal {
    let kind = *dice.pick(&KINDS);
    line_error(wait, kind, Some(byte), dice)
}

fn overrun(wait: i64, dice: &mut Dice) -> Proposal {
    line_error(wait, LineErrorKind::Overrun, None, dice)
}

fn line_break(wait: i64, dice: &mut Dice) -> Proposal {
    line_error(wait, LineErrorKind::Break, None, dice)
}

/// Some ports cannot tell its place.
fn line_error(wait: i64, kind: LineErrorKind, byte: Option<u8>, dice: &mut Dice) -> Proposal {
    let span = if dice.one_in(3) { span(dice) } else { 0 };
    line(wait, LineInput::Damaged { kind, byte, span })
}

/// Among how many characters an error lies.
fn span(dice: &mut Dice) -> u32 {
    match dice.below(4) {
        0 => 1,
        1 => dice.between(1, 8) as u32,
        2 => 1 << dice.below(32),
        _ => dice.between(1, 4_096) as u32,
    }
}

/// The port tells behind characters that one of them was damaged, or that some were lost.
fn damaged_before(wait: i64, dice: &mut Dice) -> Proposal {
    let kind = *dice.pick(&KINDS);
    let byte = dice.one_in(2).then(|| dice.byte());
    line(wait, LineInput::Damaged { kind, byte, span: span(dice) })
}

/// A short time, as an answer takes.
pub(crate) fn soon(dice: &mut Dice) -> i64 {
    match dice.below(8) {
        0 => 1,
        1..=4 => dice.between(1, 5_000),
        5 | 6 => dice.between(1, 60_000),
        _ => dice.between(1, 400_000),
    }
}

/// Data of a block: any bytes, controls, texts, all values.
pub(crate) fn data(length: usize, dice: &mut Dice) -> Vec<u8> {
    let controls = [STX, ETX, DLE, NAK];
    let kind = dice.below(8);
    let first = dice.byte();
    let one = |at: usize, dice: &mut Dice| match kind {
        0 => DLE,
        1 | 2 => *dice.pick(&controls),
        3 => *dice.pick(b"0123456789 ABC.\r\n"),
        4 => first.wrapping_add(at as u8),
        5 if dice.one_in(4) => DLE,
        _ => dice.byte(),
    };
    (0..length).map(|at| one(at, dice)).collect()
}

/// A length around a limit, or any.
pub(crate) fn length(limit: usize, longest: usize, dice: &mut Dice) -> usize {
    match dice.below(12) {
        0 => limit,
        1 => limit + 1,
        2 => limit.saturating_sub(1),
        3 => (2 * limit + 1).saturating_sub(dice.below(3) as usize),
        4 => dice.length(longest),
        _ => dice.length(limit),
    }
    .min(longest)
}

impl Partner {
    pub(crate) fn new(conditions: &Conditions) -> Self {
        let Conditions { long, is_preset, .. } = *conditions;
        Self { long, is_preset, ..Self::default() }
    }

    /// Whether that with which a long session is filled goes on.
    pub(crate) fn is_filling(&self) -> bool {
        self.mood.is_none_or(|mood| mood.habit != Habit::Any)
    }

    /// The first step of a session.
    fn wakes(&mut self, station: &Station, upper: &dyn Upper, dice: &mut Dice) -> Mood {
        let mood = Mood::draw(self, station, upper, dice);
        self.mood = Some(mood);
        if mood.keeps && upper.room(station).whole() < SMALL_ROOM {
            self.plan.push_back(host(1, HostRequest::Keep));
        }
        mood
    }

    pub(crate) fn propose(
        &mut self,
        station: &Station,
        upper: &dyn Upper,
        now: Micros,
        dice: &mut Dice,
    ) -> Proposal {
        let mut proposal = self.thinks_of(station, upper, now, dice);
        if let Given::Line(LineInput::Bytes(bytes)) = &mut proposal.given {
            // What the line does not carry cannot come.
            for byte in bytes {
                *byte = station.carried(*byte);
            }
        }
        proposal
    }

    fn thinks_of(
        &mut self,
        station: &Station,
        upper: &dyn Upper,
        now: Micros,
        dice: &mut Dice,
    ) -> Proposal {
        let mood = match self.mood {
            Some(mood) => mood,
            None => self.wakes(station, upper, dice),
        };
        // What happened meanwhile may change the plan.
        if dice.one_in(60) {
            self.plan.clear();
        }
        if self.plan.is_empty() {
            let mut next = Next { station, upper, now, dice, mood, plan: &mut self.plan };
            next.draw();
            self.mood = Some(next.mood);
        }
        self.plan.pop_front().unwrap_or(nothing(1_000))
    }
}

/// What could come next, drawn into a plan.
struct Next<'a> {
    station: &'a Station,
    upper: &'a dyn Upper,
    now: Micros,
    dice: &'a mut Dice,
    mood: Mood,
    plan: &'a mut VecDeque<Proposal>,
}

impl Next<'_> {
    fn draw(&mut self) {
        if self.has_habit() {
            return;
        }
        if self.mood.habit == Habit::Any && self.dice.one_in(40) {
            return self.host_meddles();
        }
        if let Some(proposals) = self.upper.meanwhile(self.now, self.dice) {
            return self.plan.extend(proposals);
        }
        match self.station.state {
            State::Idle => self.in_idle(),
            State::WaitingForDle { qvz, .. } => self.answer_to_stx(qvz),
            State::Sending { .. } => self.while_the_block_leaves(),
            State::Disturbed { silence }
            | State::TurnedAway { silence }
            | State::Garbage { silence } => {
                self.while_silence_is_awaited(silence);
            }
            State::WaitingForAcknowledgement { qvz } => self.acknowledgement(qvz),
            State::WaitingForBuffer { until, .. } => self.without_buffer(until),
            State::Granting { .. } => self.set_up_again(),
            State::Receiving { zvz } => self.in_block(zvz),
            State::WaitingForRepetition { bwz, .. } => self.repetition(bwz),
        }
    }

    fn is_faulty(&mut self) -> bool {
        self.mood.habit == Habit::Any && self.dice.one_in(self.mood.faults)
    }

    fn push(&mut self, proposal: Proposal) {
        self.plan.push_back(proposal);
    }

    /// µs of a character.
    fn character(&self) -> i64 {
        self.station.parameters.line.characters(1).0
    }

    /// µs until all that we send has left.
    fn until_quiet(&self) -> i64 {
        (self.station.out.ends(self.now).1 - self.now).0.max(0)
    }

    fn after_our_characters(&mut self) -> i64 {
        self.until_quiet() + soon(self.dice)
    }

    /// Around a deadline: before, at, behind.
    fn around(&mut self, deadline: Micros) -> i64 {
        ((deadline - self.now).0 + self.dice.between(-1, 1)).max(1)
    }

    fn in_idle(&mut self) {
        let wait = match self.dice.below(10) {
            0 => 1,
            1 => self.dice.between(1, 10_000_000_000),
            2 => self.until_quiet() + 1,
            _ => self.dice.between(1, 300_000),
        };
        let is_paused = self.station.job.is_some();
        if self.mood.keeps && self.dice.one_in(8) {
            return self.host_drains(wait);
        }
        if self.is_faulty() {
            return self.idle_garbage(wait);
        }
        if !self.station.parameters.handshake && self.dice.one_in(60) {
            return self.many_blocks(wait, false);
        }
        if let Some(proposals) = self.upper.in_idle(self.now, wait, self.dice) {
            return self.plan.extend(proposals);
        }
        if is_paused && !self.dice.one_in(3) {
            let id = self.station.jobs;
            let request =
                if self.dice.one_in(6) { HostRequest::Abort(id) } else { HostRequest::Resume(id) };
            return self.push(host(wait, request));
        }
        if !is_paused && !self.dice.one_in(self.mood.receptions) {
            return self.job(wait);
        }
        self.push(bytes(wait, &[STX]));
    }

    fn idle_garbage(&mut self, wait: i64) {
        match self.dice.below(9) {
            0 => self.push(bytes(wait, &[NAK])),
            1 => {
                let proposal = overrun(wait, self.dice);
                self.push(proposal);
            }
            2 => {
                let proposal = line_break(wait, self.dice);
                self.push(proposal);
            }
            3 => {
                let byte = *self.dice.pick(&[STX, DLE, NAK, b'A']);
                let proposal = damaged(wait, byte, self.dice);
                self.push(proposal);
            }
            4 => self.push(bytes(wait, &[DLE])),
            5 => {
                // A partner that does not wait.
                let mut all = vec![STX];
                all.extend(self.partners_block());
                self.cut(wait, &all);
            }
            6 if !self.station.parameters.handshake => self.many_blocks(wait, false),
            6 => self.push(bytes(wait, &[STX, STX])),
            7 => {
                let count = 1 + self.dice.length(20);
                let garbage: Vec<u8> = (0..count).map(|_| self.dice.byte()).collect();
                self.push(bytes(wait, &garbage));
            }
            _ => {
                let byte = self.dice.byte();
                self.push(bytes(wait, &[byte]));
                let soon = soon(self.dice);
                self.push(bytes(soon, &[STX]));
            }
        }
    }

    fn while_silence_is_awaited(&mut self, silence: Micros) {
        let wait = self.around(silence);
        if !self.is_faulty() {
            return self.push(nothing(wait + 10));
        }
        let early = self.dice.between(1, (silence - self.now).0.max(1));
        let byte = *self.dice.pick(&[STX, DLE, NAK, ETX, b'A']);
        match self.dice.below(6) {
            0 | 1 => self.push(bytes(wait, &[byte])),
            2 | 3 => self.push(bytes(early, &[byte])),
            4 => {
                let proposal = damaged(early, byte, self.dice);
                self.push(proposal);
            }
            _ => {
                let proposal = overrun(early, self.dice);
                self.push(proposal);
            }
        }
    }
}
