//! A job goes.

use super::block::{ACK, C, CAN, CANS, EOT, NAK, block};
use super::receive::File;
use super::rules::Mode;
use super::{State, Xmodem};
use crate::model::Effect;
use softplug_abi::{Failure, Micros};

/// A job: it waits, or is on the line.
#[derive(Clone, Debug)]
pub(super) struct Job {
    pub(super) id: u32,
    pub(super) data: Vec<u8>,
    pub(super) is_paused: bool,
    /// Until when it must be called for.
    pub(super) until: Option<Micros>,
}

/// What of the job is on the line.
#[derive(Clone, Debug)]
pub(super) struct Sending {
    pub(super) stage: Stage,
    is_crc: bool,
    is_long: bool,
    /// Bytes of the job that were acknowledged.
    done: usize,
    number: u8,
    /// Bytes of the block under way; 0: EOT.
    length: usize,
    pub(super) is_answered: bool,
    repeats: u32,
    /// Characters that were queued for the job.
    queued: u64,
    can_heard: bool,
    is_aborted: bool,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Stage {
    /// Nothing is on its way: the job is paused.
    Paused,
    /// It has left at this place.
    Leaving(u64),
    /// Its answer must come until then.
    Answer(Micros),
    /// It is acknowledged; the line must be clear until then.
    Settling(Micros),
}

impl Sending {
    pub(super) fn is_end(&self) -> bool {
        self.length == 0
    }
}

impl Xmodem {
    /// The receiver calls for the job that waits.
    pub(super) fn is_called(&mut self, byte: u8) {
        let is_crc = byte == C;
        let is_call = match self.rules.mode {
            Mode::Checksum => !is_crc,
            Mode::Crc => is_crc,
            Mode::Auto | Mode::Long => true,
        };
        let Some(job) = self.job.as_mut().filter(|_| is_call) else { return };
        job.until = None;
        self.file = File::default();
        self.state = State::Sending(Sending {
            stage: Stage::Paused,
            is_crc,
            is_long: is_crc && self.rules.mode == Mode::Long,
            done: 0,
            number: 1,
            length: 0,
            is_answered: false,
            repeats: 0,
            queued: 0,
            can_heard: false,
            is_aborted: false,
        });
        self.begins_next("xmodem.tx.on-call");
    }

    /// Chooses what goes next, and lets it go.
    fn begins_next(&mut self, clause: &'static str) {
        let (Some(job), State::Sending(sending)) = (&self.job, &mut self.state) else { return };
        let rest = job.data.len() - sending.done;
        sending.length = match rest {
            0 => 0,
            1..=896 => 128,
            _ if sending.is_long => 1_024,
            _ => 128,
        };
        self.goes(clause);
    }

    /// The block or EOT goes, if the job is not paused.
    pub(super) fn goes(&mut self, clause: &'static str) {
        let (Some(job), State::Sending(sending)) = (&self.job, &mut self.state) else { return };
        if job.is_paused {
            sending.stage = Stage::Paused;
            return;
        }
        let bytes = if sending.is_end() {
            vec![EOT]
        } else {
            let end = job.data.len().min(sending.done + sending.length);
            let mut data = job.data[sending.done..end].to_vec();
            data.resize(sending.length, self.rules.pad);
            block(sending.number, &data, sending.is_crc)
        };
        sending.queued += bytes.len() as u64;
        sending.stage = Stage::Leaving(self.out.send(&bytes, clause));
    }

    /// A character while the job is on the line; `None`: a damaged one.
    pub(super) fn is_answered(&mut self, character: Option<u8>) {
        let State::Sending(sending) = &mut self.state else { return };
        let is_can = character == Some(CAN);
        if is_can && sending.can_heard {
            return self.fails(Failure::Refused, "xmodem.tx.cancelled");
        }
        sending.can_heard = is_can;
        if let Stage::Settling(until) = &mut sending.stage {
            *until = self.now + self.rules.purge_time;
        }
        let Some(byte) = character else { return };
        match &sending.stage {
            Stage::Answer(_) if sending.is_aborted => {}
            Stage::Answer(_) if byte == ACK && sending.is_end() => self.is_done(),
            Stage::Answer(_) if byte == ACK && sending.repeats > 0 => {
                sending.stage = Stage::Settling(self.now + self.rules.purge_time);
            }
            Stage::Answer(_) if byte == ACK => self.is_acknowledged(),
            Stage::Answer(_) => {
                let is_nak = byte == NAK || byte == C && sending.is_crc && !sending.is_answered;
                if is_nak {
                    self.goes_again(Failure::AttemptsUsedUp, "xmodem.tx.repeat");
                }
            }
            Stage::Leaving(_) | Stage::Paused | Stage::Settling(_) => {}
        }
    }

    fn is_acknowledged(&mut self) {
        let (Some(job), State::Sending(sending)) = (&self.job, &mut self.state) else { return };
        // It was sent three times or more.
        if sending.length == 1_024 && sending.repeats >= 2 {
            sending.is_long = false;
        }
        sending.done = job.data.len().min(sending.done + sending.length);
        sending.number = sending.number.wrapping_add(1);
        sending.is_answered = true;
        sending.repeats = 0;
        self.begins_next("xmodem.tx.next");
    }

    fn goes_again(&mut self, failure: Failure, clause: &'static str) {
        let State::Sending(sending) = &mut self.state else { return };
        sending.repeats += 1;
        if sending.repeats > self.rules.repeats {
            self.fails(failure, clause);
        } else {
            self.goes(clause);
        }
    }

    fn is_done(&mut self) {
        let State::Sending(sending) = &self.state else { return };
        let sent = sending.queued;
        if let Some(job) = self.job.take() {
            self.expected.expect("xmodem.tx.end", Effect::Done { job: job.id, sent });
        }
        self.rests(false);
    }

    /// The job on the line fails; CAN follows where the receiver does not know.
    pub(super) fn fails(&mut self, failure: Failure, clause: &'static str) {
        let State::Sending(sending) = &self.state else { return };
        let sent = sending.queued.saturating_sub(self.out.discard());
        if let Some(job) = self.job.take() {
            self.expected.expect(clause, Effect::Failed { job: job.id, failure, status: 0, sent });
        }
        self.rests(false);
        if !matches!(failure, Failure::Refused | Failure::LinkDown | Failure::Interrupted) {
            self.out.send(&CANS, clause);
        }
    }

    /// A job that waits fails.
    pub(super) fn drops_job(&mut self, failure: Failure, clause: &'static str) {
        let Some(job) = self.job.take() else { return };
        self.expected.expect(clause, Effect::Failed { job: job.id, failure, status: 0, sent: 0 });
        if matches!(self.state, State::Idle { .. }) {
            let lingers = matches!(self.state, State::Idle { lingers: true, .. });
            self.rests(lingers);
        }
    }

    /// A character of ours has left.
    pub(super) fn progress(&mut self) {
        let State::Sending(sending) = &mut self.state else { return };
        let Stage::Leaving(place) = sending.stage else { return };
        if !self.out.has_left(place) {
            return;
        }
        let time = if sending.is_end() { self.rules.block_time } else { self.rules.answer_time };
        sending.stage = Stage::Answer(self.now + time);
        if sending.is_aborted {
            self.fails(Failure::Aborted, "xmodem.tx.abort");
        }
    }

    /// A time of the job on the line has run out.
    pub(super) fn waits_no_more(&mut self) {
        let State::Sending(sending) = &self.state else { return };
        match sending.stage {
            Stage::Settling(_) => self.is_acknowledged(),
            Stage::Answer(_) if sending.is_end() => {
                self.goes_again(Failure::NoAnswer, "xmodem.tx.end-again");
            }
            _ => self.fails(Failure::NoAnswer, "xmodem.tx.answer-time"),
        }
    }

    pub(super) fn aborts_job(&mut self) {
        match &mut self.state {
            State::Sending(sending) => match sending.stage {
                // It becomes whole first; one character is whole.
                Stage::Leaving(_) if !sending.is_end() => sending.is_aborted = true,
                _ => self.fails(Failure::Aborted, "xmodem.tx.abort"),
            },
            _ => self.drops_job(Failure::Aborted, "xmodem.tx.abort"),
        }
    }
}
