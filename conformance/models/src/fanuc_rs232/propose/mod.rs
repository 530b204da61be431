//! What a control and a host could do next.

mod large;
mod programs;
mod punching;
mod sending;

use super::Fanuc;
use crate::dice::Dice;
use crate::model::{Conditions, Given, HostRequest, LineInput, Model, Proposal};
use crate::propose::{Pace, give, host, line};
use softplug_abi::{Failure, LineErrorKind, LinkDownReason, Micros, ModemLines};

/// What a session is about, drawn at its start.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Course {
    /// All of it, in any order.
    Any,
    /// So many small jobs and captures.
    Many(u32),
    /// A job of about so many bytes, once.
    Job(usize),
    /// A capture of about so many bytes, once.
    Capture(usize),
    /// A capture of so many characters that come one at a time, each at a time of its own.
    Characters(u32),
    /// The panel asks again and again.
    Requests,
}

impl Course {
    pub(super) fn new(conditions: &Conditions) -> Option<Self> {
        if conditions.is_usual {
            return Some(Self::Any);
        }
        Some(match conditions.long? % 4 {
            0 => Self::Many(12_000),
            1 => Self::Capture(1_500_000),
            2 => Self::Job(1_500_000),
            _ => Self::Characters(190_000),
        })
    }

    fn draw(dice: &mut Dice) -> Self {
        match dice.below(240) {
            0..=1 => Self::Job(dice.between(66_000, 140_000) as usize),
            2..=3 => Self::Capture(120_000),
            4..=9 => Self::Many(u32::MAX),
            10..=14 => Self::Requests,
            _ => Self::Any,
        }
    }
}

/// The next step of a random session.
pub(super) fn next(model: &Fanuc, now: Micros, dice: &mut Dice) -> Proposal {
    let guess = Guess { model, now };
    if !model.is_open {
        return host(dice.between(1, 3_000_000), HostRequest::Open);
    }
    if model.is_down {
        return guess.while_down(dice);
    }
    let course = model.course.get().unwrap_or_else(|| Course::draw(dice));
    model.course.set(Some(course));
    match course {
        Course::Many(count) if model.jobs >= count => model.course.set(Some(Course::Any)),
        Course::Many(_) if !dice.one_in(40) => return guess.small(dice),
        Course::Requests if !dice.one_in(40) => {
            if let Some(proposal) = guess.panel(dice) {
                return proposal;
            }
        }
        Course::Job(_) | Course::Capture(_) | Course::Characters(_) => {
            if let Some(proposal) = guess.large(course, dice) {
                return proposal;
            }
            model.course.set(Some(Course::Any));
        }
        Course::Many(_) | Course::Requests | Course::Any => {}
    }
    // A capture that has begun mostly goes on.
    let punches = if model.punch.is_idle() { 25 } else { 65 };
    match dice.below(100) {
        0..=1 => guess.rare(dice),
        2..=5 => guess.room(dice),
        6..=8 => guess.answer(dice),
        9..=10 => guess.nothing(dice),
        _ if dice.below(100) < punches => guess.punching(dice),
        _ => guess.sending(dice),
    }
}

/// What is known of the session.
struct Guess<'a> {
    model: &'a Fanuc,
    now: Micros,
}

impl Guess<'_> {
    /// A damaged character, lost ones or a break.
    fn damaged(&self, byte: u8, dice: &mut Dice) -> Proposal {
        let read = [LineErrorKind::Parity, LineErrorKind::Framing, LineErrorKind::ParityOrFraming];
        let (kind, byte) = if dice.one_in(4) {
            (*dice.pick(&[LineErrorKind::Overrun, LineErrorKind::Break]), None)
        } else {
            (*dice.pick(&read), Some(byte))
        };
        line(self.characters(1), LineInput::Damaged { kind, byte, span: 0 })
    }

    /// The host keeps deliveries, or puts some away.
    fn room(&self, dice: &mut Dice) -> Proposal {
        let room = &self.model.room;
        let wait = self.pause(dice);
        if !room.keeps() {
            let request = if dice.one_in(3) { HostRequest::PutAllAway } else { HostRequest::Keep };
            return host(wait, request);
        }
        let to_mark = self.model.flow.high.saturating_sub(room.known());
        // Less would not be told.
        let step = room.step();
        let request = match dice.below(8) {
            0 => HostRequest::PutAllAway,
            1..=2 => HostRequest::PutAway(room.kept().max(step)),
            3..=5 => HostRequest::PutAway((to_mark + dice.below(3) as u32).max(step)),
            _ => HostRequest::PutAway(step + dice.length(1_000) as u32),
        };
        host(wait, request)
    }

    /// The host answers a request, or does as if there was one.
    fn answer(&self, dice: &mut Dice) -> Proposal {
        let open: Vec<u32> = self.model.requests.open().iter().copied().collect();
        if open.is_empty() {
            return self.punching(dice);
        }
        let id = *dice.pick(&open);
        host(self.pause(dice), HostRequest::Answer(id, Self::granted(dice)))
    }

    /// An answer: some have data, which come in parts if they are many.
    fn granted(dice: &mut Dice) -> Result<Vec<u8>, Failure> {
        if dice.one_in(3) {
            return Err(Failure::NotFound);
        }
        Ok(vec![b'A'; *dice.pick(&[0, 0, 1, 1_000, 4_096, 10_000])])
    }

    /// What may happen at any time, and seldom does.
    fn rare(&self, dice: &mut Dice) -> Proposal {
        let wait = self.within(dice);
        match dice.below(12) {
            0 => host(wait, HostRequest::Close),
            1 => {
                let reasons = [
                    LinkDownReason::Unplugged,
                    LinkDownReason::Disconnected,
                    LinkDownReason::Failed,
                ];
                line(wait, LineInput::Down(*dice.pick(&reasons)))
            }
            2..=4 => line(wait, LineInput::ModemLines(ModemLines::DSR, ModemLines::default())),
            5..=8 => line(wait, LineInput::ModemLines(ModemLines::DSR, ModemLines::DSR)),
            9 => line(wait, LineInput::ModemLines(ModemLines::CTS, ModemLines::default())),
            10 => give(3_600_000_000 * dice.between(1, 9), Given::Nothing),
            _ => give(dice.between(1, 100_000_000), Given::Nothing),
        }
    }

    fn while_down(&self, dice: &mut Dice) -> Proposal {
        match dice.below(5) {
            0 => self.room(dice),
            1 => host(self.pause(dice), HostRequest::Close),
            _ => line(self.pause(dice), LineInput::Up),
        }
    }

    /// Time goes by, often until something is due.
    fn nothing(&self, dice: &mut Dice) -> Proposal {
        let wait = match self.model.next() {
            Some(deadline) if !dice.one_in(3) => (deadline - self.now).0,
            _ => self.pause(dice),
        };
        give(wait, Given::Nothing)
    }

    fn within(&self, dice: &mut Dice) -> i64 {
        self.pace().within(dice)
    }

    fn pause(&self, dice: &mut Dice) -> i64 {
        self.pace().pause(dice)
    }

    fn characters(&self, count: usize) -> i64 {
        self.pace().characters(count)
    }

    fn pace(&self) -> Pace {
        Pace { line: self.model.line, began: self.model.began, now: self.now }
    }
}
