//! What a control and a host could do next.

mod control;
mod hosts;
mod programs;

use super::RemoteBuffer;
use super::parity::sent;
use crate::dice::Dice;
use crate::model::{Given, HostRequest, LineInput, Proposal};
use crate::propose::{give, host, line};
use softplug_abi::{LinkDownReason, Micros, ModemLines};
use std::collections::VecDeque;

/// The other side of the line, and the host.
#[derive(Clone, Debug, Default)]
pub(super) struct Partner {
    /// Pieces of a message that still have to come.
    pieces: VecDeque<Proposal>,
    /// So many jobs are given one after the other, and all goes well.
    jobs: u32,
}

impl Partner {
    pub(super) fn new(long: Option<u64>) -> Self {
        Self { jobs: if long.is_some() { 8_000 } else { 0 }, ..Self::default() }
    }

    /// Whether there are jobs still to be given behind this one.
    pub(super) fn is_filling(&self, job: u32) -> bool {
        job < self.jobs
    }

    /// The next step of a random session.
    pub(super) fn propose(
        &mut self,
        model: &RemoteBuffer,
        now: Micros,
        dice: &mut Dice,
    ) -> Proposal {
        let guess = Guess { model, now };
        if !model.is_open || model.is_down {
            self.pieces.clear();
        }
        if !model.is_open {
            return host(dice.between(1, 3_000_000), HostRequest::Open);
        }
        if model.is_down {
            return match dice.below(5) {
                0 => host(guess.pause(dice), HostRequest::Close),
                _ => line(guess.pause(dice), LineInput::Up),
            };
        }
        if let Some(piece) = self.pieces.pop_front() {
            return piece;
        }
        if self.is_filling(model.jobs) && !dice.one_in(400) {
            return guess.good(dice);
        }
        match dice.below(100) {
            0 => guess.rare(dice),
            1..=4 => guess.modem_lines(dice),
            5..=12 => guess.host(dice),
            _ => guess.control(&mut self.pieces, dice),
        }
    }
}

/// What is known of the session.
struct Guess<'a> {
    model: &'a RemoteBuffer,
    now: Micros,
}

impl Guess<'_> {
    /// What may happen at any time, and seldom does.
    fn rare(&self, dice: &mut Dice) -> Proposal {
        let wait = self.pause(dice);
        match dice.below(6) {
            0 => host(wait, HostRequest::Close),
            1 => line(wait, LineInput::Down(LinkDownReason::Disconnected)),
            2 => give(3_600_000_000 * dice.between(1, 9), Given::Nothing),
            _ => give(dice.between(1, 100_000_000), Given::Nothing),
        }
    }

    fn modem_lines(&self, dice: &mut Dice) -> Proposal {
        let changed = *dice.pick(&[
            ModemLines::DSR,
            ModemLines::DSR,
            ModemLines::CTS,
            ModemLines::DCD,
            ModemLines::CTS.union(ModemLines::DSR),
        ]);
        // It is mostly on.
        let is_on = !self.model.dsr || dice.one_in(3);
        let on = if is_on { changed } else { ModemLines(0) };
        line(self.within(dice), LineInput::ModemLines(changed, on))
    }

    /// As long as our messages still have to leave.
    fn until_left(&self) -> i64 {
        self.model.line.characters(self.model.wire.count() as u64).0
    }

    /// A time near the ends of characters that leave, or a short one.
    fn within(&self, dice: &mut Dice) -> i64 {
        match dice.below(4) {
            0 => self.model.line.characters(1).0 + dice.between(-1, 1),
            1 => dice.between(1, self.until_left().max(1)),
            _ => dice.between(1, 20_000),
        }
    }

    /// Some time behind our last message: mostly less than `poll_time`.
    fn pause(&self, dice: &mut Dice) -> i64 {
        let poll = self.model.rules.poll_time.0;
        let behind = match (dice.below(20), self.model.deadline()) {
            // Timers just before, at and just after.
            (0, Some(deadline)) => return (deadline - self.now).0 + dice.between(-1, 1),
            (0 | 1, _) => poll + dice.between(-1, 1),
            (2, _) => dice.between(1, 2 * poll),
            (3..=5, _) => dice.between(1, poll - 1),
            _ => dice.between(1, poll.min(400_000) / 2),
        };
        self.until_left() + behind
    }

    /// As it comes over the line.
    fn on_the_line(&self, message: &[u8]) -> Vec<u8> {
        message.iter().map(|character| sent(&self.model.rules, *character)).collect()
    }
}
