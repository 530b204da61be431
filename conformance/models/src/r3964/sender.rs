//! What a station does with a job.

use super::frame::{DLE, NAK, STX, block};
use super::outgoing::Part;
use super::parameters::Priority;
use super::rules::Rule;
use super::state::{Job, State};
use super::{Character, Fault, Quiet, Station};
use crate::model::Effect;
use softplug_abi::{Failure, Micros};

impl Station {
    pub(super) fn take_job(&mut self, id: u32, kind: &str, data: &[u8]) {
        self.jobs = self.jobs.max(id);
        if self.job.is_some() {
            // The link itself has one job at a time.
            let failure = Failure::Busy;
            let effect = Effect::Failed { job: id, failure, status: 0, sent: 0 };
            self.awaited.push(Rule::Waits, effect);
            return;
        }
        if kind != "send" {
            // Kinds of the layer, which is off.
            let failure = Failure::NotSupported;
            let effect = Effect::Failed { job: id, failure, status: 0, sent: 0 };
            self.awaited.push(Rule::Kinds, effect);
            return;
        }
        self.out.count_anew();
        let size = self.parameters.block_size;
        let mut blocks: Vec<Vec<u8>> = data.chunks(size).map(<[u8]>::to_vec).collect();
        if blocks.is_empty() {
            blocks.push(Vec::new());
        }
        let is_too_long = blocks.len() > 1;
        self.job = Some(Job {
            id,
            blocks,
            is_split: false,
            why: Rule::SetUp,
            is_looked_through: false,
            gave_way: false,
            is_paused: false,
            setups: 0,
            failures: 0,
        });
        if is_too_long && !self.parameters.split {
            self.fail_job((Failure::TooLong, 0x0517, Rule::TooLongJob));
        } else {
            self.begin_job();
        }
    }

    /// Without doubling data that hold DLE ETX cannot be sent.
    pub(crate) fn holds_end(&self, data: &[u8]) -> bool {
        !self.parameters.doubling && data.windows(2).any(|pair| pair == [DLE, super::frame::ETX])
    }

    /// A character of the line may have fewer bits than a byte.
    pub(crate) fn holds_wider(&self, data: &[u8]) -> bool {
        let bits = u32::from(self.parameters.line.data_bits);
        data.iter().any(|byte| u8::BITS - byte.leading_zeros() > bits)
    }

    /// What comes of a byte on such a line.
    pub(crate) fn carried(&self, byte: u8) -> u8 {
        byte & u8::MAX >> u8::BITS.saturating_sub(self.parameters.line.data_bits.into())
    }

    /// What a block of these data cannot be sent for.
    fn unfit(&self, data: &[u8]) -> Option<Rule> {
        match (self.holds_end(data), self.holds_wider(data)) {
            (true, _) => Some(Rule::NoDoubling),
            (false, true) => Some(Rule::SevenBits),
            (false, false) => None,
        }
    }

    /// Begins the next block of the job, if there is one that may.
    pub(super) fn begin_job(&mut self) {
        // Once, as soon as the data are there.
        let next = self.job.as_ref().filter(|job| !job.is_looked_through);
        let next = next.and_then(|job| job.blocks.first());
        if let Some(rule) = next.and_then(|data| self.unfit(data)) {
            return self.fail_job((Failure::UnsupportedCharacter, 0, rule));
        }
        let Some(job) = &mut self.job else { return };
        job.is_looked_through = true;
        if self.state != State::Idle || self.quiet != Quiet::No || (job.is_paused && !job.gave_way)
        {
            return;
        }
        job.why = match (job.gave_way, job.is_split) {
            (true, _) => Rule::ConflictLow,
            (false, true) => Rule::Split,
            (false, false) => Rule::SetUp,
        };
        self.begun_again |= std::mem::take(&mut job.gave_way);
        (job.setups, job.failures) = (0, 0);
        self.set_up();
    }

    /// One more STX.
    fn set_up(&mut self) {
        let Some(job) = &mut self.job else { return };
        job.setups += 1;
        let rule = job.why;
        if self.parameters.handshake {
            let mark = self.out.send(&[STX], Part::Job, rule);
            self.state = State::WaitingForDle { mark, qvz: None, stx_seen: false };
        } else {
            self.out.send(&[STX], Part::Job, Rule::NoHandshake);
            self.send_block();
        }
    }

    fn send_block(&mut self) {
        let Some(data) = self.job.as_ref().and_then(|job| job.blocks.first()) else { return };
        let bytes = block(&self.parameters, data);
        let end = bytes.len() - usize::from(self.parameters.bcc);
        let mark = self.out.send(&bytes[..end], Part::Job, Rule::Frame);
        let mark = if self.parameters.bcc {
            self.out.send(&bytes[end..], Part::Job, Rule::Bcc)
        } else {
            mark
        };
        self.state = State::Sending { mark };
    }

    pub(super) fn instead_of_dle(&mut self, at: Micros, character: Character) {
        let State::WaitingForDle { mark, qvz, .. } = self.state else { return };
        let priority = self.parameters.priority;
        match (character, priority, qvz) {
            (Character::Good(STX), Priority::Low, _) => self.give_way(at),
            (Character::Good(STX), Priority::High, _) => {
                self.state = State::WaitingForDle { mark, qvz, stx_seen: true };
            }
            // What comes before STX can have left is no answer to it.
            (_, _, None) => {}
            (Character::Good(DLE), _, Some(_)) => self.send_block(),
            (Character::Good(STX), ..) => {
                self.set_up_failed((Failure::Refused, 0x0702, Rule::ConflictNone));
            }
            _ => self.set_up_failed((Failure::Refused, 0x0702, Rule::SetUpRefused)),
        }
    }

    /// Low priority receives first.
    fn give_way(&mut self, at: Micros) {
        if let Some(job) = &mut self.job {
            job.gave_way = true;
        }
        self.begin_reception(at);
        if let Some(reception) = &mut self.reception {
            reception.in_conflict = true;
        }
    }

    fn set_up_failed(&mut self, fault: Fault) {
        let Some(job) = &mut self.job else { return };
        if job.setups < self.parameters.setup_attempts {
            job.why = if fault.1 == 0x0702 { Rule::SetUpRefused } else { Rule::Qvz };
            self.set_up();
        } else {
            self.give_up(fault);
        }
    }

    /// One NAK, and the job has failed.
    fn give_up(&mut self, fault: Fault) {
        self.out.send(&[NAK], Part::Answer, fault.2);
        self.fail_job(fault);
        self.go_idle();
    }

    pub(super) fn while_sending(&mut self, at: Micros, character: Character) {
        self.out.take_part_back(Part::Job);
        if character == Character::Good(NAK) {
            let fault = (Failure::Refused, 0x0705, Rule::StopOnNak);
            self.transmission_failed(fault, None);
        } else {
            self.state = State::Disturbed { silence: at + self.parameters.zvz };
        }
    }

    pub(super) fn behind_the_block(&mut self, character: Character) {
        if character == Character::Good(DLE) {
            self.acknowledged();
        } else {
            let fault = (Failure::Refused, 0x0706, Rule::Repeat);
            self.transmission_failed(fault, None);
        }
    }

    fn acknowledged(&mut self) {
        let sent = self.out.taken();
        let Some(job) = &mut self.job else { return };
        job.blocks.remove(0);
        job.is_looked_through = false;
        job.is_split = true;
        if job.blocks.is_empty() {
            let effect = Effect::Done { job: job.id, sent };
            self.awaited.push(Rule::Acknowledged, effect);
            self.job = None;
        }
        // The next block begins when its data are there.
        self.state = State::Idle;
    }

    /// The block has to be repeated. A `nak` may have to tell the partner first.
    fn transmission_failed(&mut self, fault: Fault, nak: Option<Rule>) {
        let Some(job) = &mut self.job else { return };
        job.failures += 1;
        job.setups = 0;
        job.why = Rule::Repeat;
        if job.failures < self.parameters.transmission_attempts {
            if let Some(rule) = nak {
                self.out.send(&[NAK], Part::Answer, rule);
            }
            self.set_up();
        } else if self.parameters.transmission_attempts == 1 {
            self.give_up((fault.0, fault.1, Rule::OneAttempt));
        } else {
            let rule = Rule::TransmissionAttempts;
            self.give_up((Failure::AttemptsUsedUp, 0x070A, rule));
        }
    }

    pub(super) fn sender_ran_out(&mut self) {
        match self.state {
            State::WaitingForDle { stx_seen: true, .. } => {
                self.set_up_failed((Failure::Conflict, 0x070B, Rule::BothHigh));
            }
            State::WaitingForDle { .. } => {
                self.set_up_failed((Failure::NoAnswer, 0x0703, Rule::SetUpAttempts));
            }
            State::WaitingForAcknowledgement { .. } => {
                self.transmission_failed((Failure::NoAnswer, 0x0707, Rule::Qvz), None);
            }
            State::Disturbed { .. } => {
                let fault = (Failure::Protocol, 0x0704, Rule::StopOnOther);
                self.transmission_failed(fault, Some(Rule::StopOnOther));
            }
            _ => {}
        }
    }

    pub(super) fn sender_left(&mut self, at: Micros, left: u64) {
        match &mut self.state {
            State::WaitingForDle { mark, qvz, .. } if *mark == left => {
                *qvz = Some(at + self.parameters.qvz);
            }
            State::Sending { mark } if *mark == left => {
                let qvz = at + self.parameters.qvz;
                self.state = State::WaitingForAcknowledgement { qvz };
            }
            _ => {}
        }
        if self.quiet == Quiet::Nak(left) {
            self.quiet = Quiet::Until(at + self.parameters.zvz);
        }
    }

    pub(super) fn fail_job(&mut self, (failure, status, rule): Fault) {
        let Some(job) = self.job.take() else { return };
        self.out.take_part_back(Part::Job);
        let effect = Effect::Failed { job: job.id, failure, status, sent: self.out.taken() };
        self.awaited.push(rule, effect);
    }

    pub(super) fn pause(&mut self, id: u32) {
        if let Some(job) = self.job.as_mut().filter(|job| job.id == id) {
            job.is_paused = true;
        }
    }

    pub(super) fn resume(&mut self, id: u32) {
        if let Some(job) = self.job.as_mut().filter(|job| job.id == id) {
            job.is_paused = false;
            self.begin_job();
        }
    }

    pub(super) fn abort(&mut self, id: u32) {
        self.abort_behind(id, false);
    }

    /// `has_sent`: blocks of the job have gone before this one.
    pub(super) fn abort_behind(&mut self, id: u32, has_sent: bool) {
        let Some(job) = self.job.as_ref().filter(|job| job.id == id) else { return };
        let gave_way = job.gave_way;
        self.out.take_part_back(Part::Job);
        // In a reception between two blocks no NAK disturbs the partner: the page is silent.
        let is_told = self.state.is_of_sender() || self.state == State::Idle;
        if is_told && !gave_way && (has_sent || self.out.taken() > 0) {
            let mark = self.out.send(&[NAK], Part::Answer, Rule::Abort);
            if self.state.is_of_sender() && !self.parameters.handshake {
                self.quiet = Quiet::Nak(mark);
            }
        }
        if self.state.is_of_sender() {
            self.state = State::Idle;
        }
        self.fail_job((Failure::Aborted, 0, Rule::Abort));
    }
}
