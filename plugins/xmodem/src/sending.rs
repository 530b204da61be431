//! A job goes: what a receiver says, and what it is answered.

use crate::Timer;
use crate::Xmodem;
use crate::block::{ACK, CAN};
use crate::stage::Stage;
use softplug_plugin::{Context, Failure};

impl Xmodem {
    /// A character from the receiver: a call for the job that waits, or an answer.
    pub(crate) fn answered(&mut self, link: &mut Context<'_>, byte: u8) {
        let is_second_can = core::mem::replace(&mut self.sender.can_heard, byte == CAN);
        if is_second_can && byte == CAN {
            self.stop(link, Failure::Refused);
            return;
        }
        self.settle_anew(link);
        // An answer that comes before the block can have left is none.
        if !self.sender.has_left() || self.sender.is_aborted {
            return;
        }
        match self.stage {
            Stage::Answer if byte == ACK && self.sender.repeats > 0 => {
                self.enter(link, Stage::Settling, self.settings.purge_time);
            }
            Stage::Answer if byte == ACK => self.acknowledged(link),
            Stage::Ending if byte == ACK => {
                self.sender.done(link);
                self.rest(link);
            }
            Stage::Answer | Stage::Ending if self.sender.is_refusal(byte) => {
                self.again(link, Failure::AttemptsUsedUp);
            }
            _ => {}
        }
    }

    /// A damaged character from the receiver: no answer, and no silence.
    pub(crate) fn damaged_answer(&mut self, link: &mut Context<'_>) {
        self.sender.can_heard = false;
        self.settle_anew(link);
    }

    fn settle_anew(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Settling {
            self.enter(link, Stage::Settling, self.settings.purge_time);
        }
    }

    /// The receiver calls for the job that waits.
    pub(crate) fn called(&mut self, link: &mut Context<'_>, byte: u8) {
        if self.sender.is_called(&self.settings, byte) {
            self.receiver.forget();
            self.timers.cancel(link, Timer::Request);
            self.timers.cancel(link, Timer::Transfer);
            self.stage = Stage::Filling;
            self.go_on(link);
        }
    }

    fn acknowledged(&mut self, link: &mut Context<'_>) {
        self.timers.cancel(link, Timer::Transfer);
        self.sender.acknowledged();
        self.stage = Stage::Filling;
        self.go_on(link);
    }

    /// Block or EOT goes once more, if it may.
    fn again(&mut self, link: &mut Context<'_>, failure: Failure) {
        self.timers.cancel(link, Timer::Transfer);
        if self.sender.repeats(self.settings.repeats) {
            self.stage = Stage::Filling;
            self.go_on(link);
        } else {
            self.stop(link, failure);
        }
    }

    /// Sends what comes next, as far as there is all that it needs.
    pub(crate) fn go_on(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Filling && self.answers.owes_nothing() {
            self.stage = self.sender.next(link, &self.settings);
        }
    }

    /// What was given last has left for certain.
    pub(crate) fn has_left(&mut self, link: &mut Context<'_>) {
        if self.sender.is_aborted {
            self.stop(link, Failure::Aborted);
            return;
        }
        match self.stage {
            Stage::Answer => self.enter(link, Stage::Answer, self.settings.answer_time),
            Stage::Ending => self.enter(link, Stage::Ending, self.settings.block_time),
            _ => {}
        }
    }

    /// Time has run out while a job is on the line.
    pub(crate) fn no_answer(&mut self, link: &mut Context<'_>) {
        match self.stage {
            Stage::Settling => self.acknowledged(link),
            Stage::Ending => self.again(link, Failure::NoAnswer),
            _ => self.stop(link, Failure::NoAnswer),
        }
    }

    /// The host aborts the job: a block under way becomes whole, so that CAN is not taken
    /// for a part of it.
    pub(crate) fn abort_job(&mut self, link: &mut Context<'_>) {
        let is_under_way = match self.stage {
            Stage::Filling => self.sender.is_given_in_part(),
            Stage::Answer => !self.sender.has_left(),
            Stage::Settling | Stage::Ending => false,
            _ => {
                self.timers.cancel(link, Timer::Request);
                self.sender.fail(link, Failure::Aborted);
                if self.stage == Stage::Idle {
                    self.rest(link);
                }
                return;
            }
        };
        if is_under_way {
            self.sender.is_aborted = true;
        } else {
            self.stop(link, Failure::Aborted);
        }
    }

    /// Ends the job on the line as soon as it is known how much of it has left.
    pub(crate) fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        link.discard();
        self.answers.forget();
        self.sender.stopping = Some(failure);
        self.rest(link);
        if !matches!(failure, Failure::Refused | Failure::LinkDown) {
            self.say_cancel(link);
        }
    }
}
