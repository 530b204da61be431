//! Sessions that are about one thing: large, or often.

use super::super::frame::{ACK, DC1, DC3, EOT, ETX, SOH, STX};
use super::super::rules::SMALL;
use super::super::send::Stage;
use super::super::{Fe, State, text};
use super::{after, host};
use crate::dice::Dice;
use crate::model::{Conditions, Given, HostRequest, Proposal};

/// Answers that a control lets us owe it: a real one waits for each.
const MOST_OWED: usize = 10;

/// What a session is about.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(in super::super) enum Plan {
    /// Nothing has been proposed yet.
    Open,
    /// All that a line brings.
    Usual,
    /// One job of so many long lines, at first.
    LargeJob(usize),
    /// One job of so many short lines, at first.
    ManyBlocks(usize),
    /// The job with this id.
    Sends(u32),
    /// So many requests on one link.
    ManyRequests(u32),
    /// So many deliveries on one link.
    ManyDeliveries(u32),
    /// All that a line brings, and a control that holds us for long meanwhile.
    Holds,
}

impl Plan {
    pub(in super::super) fn new(conditions: &Conditions) -> Self {
        match conditions.long.map(|number| number % 4) {
            None if conditions.transmit_room < SMALL => Self::Holds,
            None if conditions.is_usual => Self::Usual,
            None => Self::Open,
            Some(0) => Self::ManyDeliveries(30_000),
            Some(1) => Self::ManyBlocks(20_000),
            Some(2) => Self::ManyRequests(20_000),
            Some(_) => Self::LargeJob(8_000),
        }
    }

    /// Whatever counts in a byte or two comes to its end.
    fn draw(dice: &mut Dice) -> Self {
        match dice.below(120) {
            0..=2 => Self::LargeJob(dice.between(276, 400) as usize),
            3..=5 => Self::ManyBlocks(dice.between(256, 300) as usize),
            6..=8 => Self::ManyRequests(300),
            9..=11 => Self::ManyDeliveries(300),
            12..=17 => Self::Holds,
            _ => Self::Usual,
        }
    }
}

impl Fe {
    /// What the session is about; `None`: nothing in particular, any more, or
    /// something else has to end first.
    pub(super) fn planned(&self, dice: &mut Dice) -> Option<Proposal> {
        if self.plan.get() == Plan::Open {
            self.plan.set(Plan::draw(dice));
        }
        if self.plan.get() == Plan::Usual || self.frame.is_some() {
            return None;
        }
        if self.plan.get() == Plan::Holds {
            return self.holds(dice);
        }
        if self.is_held {
            return Some(after(1_000, self.says(&[DC1])));
        }
        let is_idle = matches!(self.state, State::Idle);
        match self.plan.get() {
            Plan::LargeJob(lines) if is_idle && self.job.is_none() => {
                let program = text::large_program(self.rules.longest(), lines, dice);
                Some(self.begins_with(program))
            }
            Plan::ManyBlocks(count) if is_idle && self.job.is_none() => {
                Some(self.begins_with(b"X\n".repeat(count)))
            }
            Plan::Sends(job) if self.job.as_ref().is_some_and(|own| own.id == job) => {
                self.sends_on(job, dice)
            }
            Plan::ManyRequests(count) if is_idle && self.job.is_none() && self.requests < count => {
                let header = self.heads(b"15", b'E', dice);
                Some(self.paced(&header))
            }
            Plan::ManyRequests(_) if matches!(self.state, State::Asking { .. }) => {
                Some(self.paced(&[EOT]))
            }
            Plan::ManyDeliveries(count) if is_idle && self.deliveries < count => {
                let header = self.heads(b"15", b'A', dice);
                Some(self.paced(&header))
            }
            Plan::ManyDeliveries(_) if matches!(&self.state, State::Receiving(reception) if reception.waiting.is_none()) =>
            {
                let all = [self.whole(STX, b"X"), vec![ETX, EOT]].concat();
                Some(self.paced(if dice.one_in(4) { &[ETX, EOT] } else { &all }))
            }
            _ => {
                self.plan.set(Plan::Usual);
                None
            }
        }
    }

    /// DC3, and bad headers and blocks while our answers wait.
    fn holds(&self, dice: &mut Dice) -> Option<Proposal> {
        let wait = dice.between(1, 100_000);
        let name = self.job.as_ref().and_then(|job| job.name.clone());
        // One that waits for none fills all places that there are for them.
        let most = *dice.pick(&[MOST_OWED, MOST_OWED, self.rules.answers]);
        if self.out.waiting() >= most {
            return Some(after(self.characters(most), self.says(&[DC1])));
        }
        match (self.is_held, dice.below(8)) {
            (true, 1..=2) if self.job.is_none() && matches!(self.state, State::Idle) => {
                Some(self.job(None, dice))
            }
            (true, 1..=4) if matches!(self.state, State::Sending(_)) => {
                Some(after(wait, host(HostRequest::Abort(self.jobs))))
            }
            (false, 0) => Some(after(wait, self.says(&[DC3]))),
            (true, 0) => Some(after(wait, self.says(&[DC1]))),
            (true, 1..=4) => Some(after(wait, self.says(&self.bad(*dice.pick(&[SOH, STX]), dice)))),
            (true, 5) => {
                let name = name.unwrap_or_else(|| text::name(dice));
                let header = self.heads(&name, *dice.pick(b"AEE"), dice);
                Some(after(wait, self.says(&header)))
            }
            (true, 6) => Some(after(wait, host(HostRequest::Abort(self.jobs)))),
            _ => None,
        }
    }

    /// They take their time on the line, so that our answers do not wait for it.
    fn paced(&self, bytes: &[u8]) -> Proposal {
        after(self.characters(bytes.len()).max(1_000), self.says(bytes))
    }

    fn begins_with(&self, data: Vec<u8>) -> Proposal {
        let id = self.jobs + 1;
        self.plan.set(Plan::Sends(id));
        let job = HostRequest::Job { id, kind: "send".to_owned(), fields: Vec::new(), data };
        after(1_000, host(job))
    }

    /// The control asks for the job and acknowledges each block.
    fn sends_on(&self, job: u32, dice: &mut Dice) -> Option<Proposal> {
        let pace = dice.between(1, 2_000);
        Some(match &self.state {
            State::Idle => {
                let header = self.heads(b"15", b'E', dice);
                after(pace, self.says(&header))
            }
            State::Sending(sending) => match sending.stage {
                Stage::Leaving(place) => {
                    let wait = self.characters(self.out.remaining(place) as usize);
                    after(wait + pace, self.says(&[ACK]))
                }
                Stage::Answer { .. } => after(pace, self.says(&[ACK])),
                Stage::Paused => after(pace, host(HostRequest::Resume(job))),
                Stage::Ending(place) => {
                    let wait = self.characters(self.out.remaining(place) as usize);
                    after(wait + pace, Given::Nothing)
                }
            },
            State::Receiving(_) | State::Asking { .. } | State::Granted { .. } => return None,
        })
    }
}
