//! What a control and a host could do next.

mod frame;
mod idle;
mod plan;
mod receiving;
mod sending;

use super::frame::{ACK, DC1, DC3, EOT, SOH, STX, framed};
use super::rules::even;
use super::{Fe, State, text};
use crate::dice::Dice;
use crate::model::{Given, HostRequest, LineInput, Proposal};
pub(super) use plan::Plan;
use softplug_abi::{LineErrorKind, LinkDownReason, Micros};

pub(super) fn propose(fe: &Fe, now: Micros, dice: &mut Dice) -> Proposal {
    if !fe.is_open {
        return after(dice.between(1, 3_000_000), host(HostRequest::Open));
    }
    if fe.is_down {
        return after(dice.between(1, 3_000_000), line(LineInput::Up));
    }
    if let Some(proposal) = fe.planned(dice) {
        return proposal;
    }
    if dice.one_in(30) {
        return fe.rare(now, dice);
    }
    if let Some(frame) = &fe.frame {
        return fe.in_frame(frame, dice);
    }
    if fe.is_held && fe.plan.get() != Plan::Holds && !dice.one_in(3) {
        return fe.let_go(dice);
    }
    match &fe.state {
        State::Idle if fe.job.is_some() => fe.job_waits(now, dice),
        State::Idle => fe.idle(dice),
        State::Receiving(reception) if reception.waiting.is_some() => fe.no_room(dice),
        State::Receiving(reception) => fe.receiving(now, reception, dice),
        State::Asking { request, name } => fe.asking(*request, name, dice),
        State::Granted { name, until } => fe.granted(now, name, *until, dice),
        State::Sending(sending) => fe.sending(now, sending, dice),
    }
}

fn after(wait: i64, given: Given) -> Proposal {
    Proposal { wait: Micros(wait.max(1)), given }
}

fn host(request: HostRequest) -> Given {
    Given::Host(request)
}

fn line(input: LineInput) -> Given {
    Given::Line(input)
}

/// A time that people or machines take.
fn pause(dice: &mut Dice) -> i64 {
    match dice.below(8) {
        0 => dice.between(1, 1_000),
        1 => dice.between(1, 900_000),
        2 => dice.between(1, 4_000_000),
        _ => dice.between(1, 60_000),
    }
}

/// A tick before, at, or after it; or, if it is past, soon.
fn about(deadline: Micros, now: Micros, dice: &mut Dice) -> i64 {
    (deadline - now).0 + dice.between(-1, 1)
}

impl Fe {
    /// Characters of the control, as they are on the line.
    fn says(&self, characters: &[u8]) -> Given {
        let made =
            |character: &u8| if self.rules.makes_parity { even(*character) } else { *character };
        line(LineInput::Bytes(characters.iter().map(made).collect()))
    }

    fn whole(&self, begin: u8, text: &[u8]) -> Vec<u8> {
        framed(begin, text, self.rules.dc1, self.rules.bcc_space)
    }

    fn heads(&self, name: &[u8], mode: u8, dice: &mut Dice) -> Vec<u8> {
        let text = [&[text::kind(dice)], name, &[mode]].concat();
        let bcc_space = self.rules.bcc_space && dice.one_in(2);
        framed(SOH, &text, self.rules.dc1, bcc_space)
    }

    /// The time of so many characters.
    fn characters(&self, count: usize) -> i64 {
        self.rules.line.characters(count as u64).0
    }

    /// One event with all of it after the time it takes, or a part of it: the rest
    /// follows in other steps.
    fn spoken(&self, mut all: Vec<u8>, dice: &mut Dice) -> Proposal {
        if dice.one_in(4) {
            all.truncate(dice.between(1, all.len() as i64) as usize);
        }
        let wait = pause(dice) + self.characters(all.len());
        after(wait, self.says(&all))
    }

    /// What a host does now and then, and what happens to any line.
    fn rare(&self, now: Micros, dice: &mut Dice) -> Proposal {
        let wait = pause(dice);
        let job = self.jobs;
        match dice.below(16) {
            0 => after(wait, self.says(&[DC3])),
            1 => after(wait, self.says(&[DC3, DC3, DC1])),
            2 => after(
                wait,
                line(LineInput::Damaged { kind: LineErrorKind::Parity, byte: Some(ACK), span: 0 }),
            ),
            3 => after(
                wait,
                line(LineInput::Damaged { kind: LineErrorKind::Overrun, byte: None, span: 0 }),
            ),
            4 => after(wait, host(HostRequest::Keep)),
            5 => after(wait, host(HostRequest::PutAway(dice.below(600) as u32))),
            6 => after(wait, host(HostRequest::PutAllAway)),
            7 => after(wait, host(HostRequest::Pause(job))),
            8 => after(wait, host(HostRequest::Resume(job))),
            9 => after(wait, host(HostRequest::Abort(*dice.pick(&[job, 0])))),
            10 => self.job(None, dice),
            11 => after(dice.between(1, 20_000_000_000), Given::Nothing),
            12 => after(wait, line(LineInput::Down(LinkDownReason::Unplugged))),
            13 => after(wait, host(HostRequest::Answer(self.requests, Ok(b"x".to_vec())))),
            14 => after(wait, self.says(&[dice.byte() & 0x7F])),
            _ => self.deadline().map_or(after(wait, Given::Nothing), |deadline| {
                after(
                    about(deadline, now, dice),
                    self.says(&[*dice.pick(&[0, ACK, EOT, SOH, STX])]),
                )
            }),
        }
    }

    fn let_go(&self, dice: &mut Dice) -> Proposal {
        let wait = pause(dice);
        match dice.below(4) {
            0 => after(wait, host(HostRequest::ForceResume)),
            _ => after(wait, self.says(&[DC1])),
        }
    }
}
