//! What a station does with a block of the partner.

use super::frame::{DLE, Incoming, NAK, Read, STX};
use super::outgoing::Part;
use super::rules::Rule;
use super::state::{Reception, State};
use super::{Character, Fault, Quiet, Station};
use crate::model::Effect;
use softplug_abi::{Failure, Micros};

/// How often a free buffer is looked for.
const LOOK: Micros = Micros::from_millis(50);

impl Station {
    /// The largest block that is taken.
    pub(super) fn limit(&self) -> usize {
        match self.room.opened_with() {
            // Never a buffer, unless room for a whole block comes.
            0 => self.parameters.block_size,
            room => self.parameters.block_size.min(room),
        }
    }

    fn has_buffer(&self) -> bool {
        !self.is_full && self.room.known() >= self.limit()
    }

    fn empty_block(&self) -> Incoming {
        Incoming::new(&self.parameters, self.limit())
    }

    pub(super) fn begin_reception(&mut self, at: Micros) {
        // A partner that begins a block has left ours: a reception ends the wait behind an abort, too.
        self.quiet = Quiet::No;
        self.reception = Some(Reception::new(self.empty_block()));
        self.answer_stx(at);
    }

    fn answer_stx(&mut self, at: Micros) {
        if self.has_buffer() {
            self.grant(at);
            return;
        }
        if !self.parameters.handshake {
            self.refuse_at_the_end(at);
            return;
        }
        let until = at + self.parameters.buffer_wait;
        self.state = State::WaitingForBuffer { until, look: at + LOOK };
        if until == at {
            self.look_for_buffer(at);
        }
    }

    /// Without handshake the block comes all the same.
    fn refuse_at_the_end(&mut self, at: Micros) {
        if let Some(reception) = &mut self.reception {
            reception.damage((Failure::NoBuffer, 0x080A, Rule::NoBuffer));
        }
        self.grant(at);
    }

    fn grant(&mut self, at: Micros) {
        if self.parameters.handshake {
            let gave_way = self.job.as_ref().is_some_and(|job| job.gave_way);
            let rule = if gave_way { Rule::ConflictLow } else { Rule::RxSetUp };
            let mark = self.out.send(&[DLE], Part::Grant, rule);
            self.state = State::Granting { mark };
        } else {
            self.state = State::Receiving { zvz: at + self.parameters.zvz };
        }
    }

    fn look_for_buffer(&mut self, at: Micros) {
        let State::WaitingForBuffer { until, look } = self.state else { return };
        // It is looked for at the end of the wait as well.
        if self.has_buffer() {
            self.grant(at);
        } else if until <= at {
            self.out.send(&[NAK], Part::Answer, Rule::NoBuffer);
            self.end_failed((Failure::NoBuffer, 0x080A, Rule::NoBuffer));
        } else {
            self.state = State::WaitingForBuffer { until, look: look + LOOK };
        }
    }

    /// No DLE any more: it would acknowledge a block that nobody took.
    pub(super) fn without_buffer(&mut self, at: Micros, character: Character) {
        if character == Character::Good(STX) {
            return;
        }
        self.damage((Failure::Protocol, 0x0802, Rule::NotWaiting));
        self.state = State::TurnedAway { silence: at + self.parameters.zvz };
    }

    pub(super) fn before_dle_has_left(&mut self, at: Micros, character: Character) {
        if character == Character::Good(STX) {
            return;
        }
        self.out.take_part_back(Part::Grant);
        self.damage((Failure::Protocol, 0x0802, Rule::NotWaiting));
        self.in_block(at, character);
    }

    /// One of the characters that were given already was damaged: it is in the block, if
    /// there is one.
    pub(super) fn damaged_before(&mut self) {
        if matches!(self.state, State::Granting { .. } | State::Receiving { .. }) {
            self.damage((Failure::LineError, 0x080C, Rule::LineError));
        }
    }

    fn damage(&mut self, fault: Fault) {
        if let Some(reception) = &mut self.reception {
            reception.damage(fault);
        }
    }

    pub(super) fn in_block(&mut self, at: Micros, character: Character) {
        self.state = State::Receiving { zvz: at + self.parameters.zvz };
        let (byte, is_damaged) = match character {
            Character::Good(byte) => (Some(byte), false),
            Character::Damaged(byte) => (byte, true),
        };
        if is_damaged {
            self.damage((Failure::LineError, 0x080C, Rule::LineError));
        }
        let Some(byte) = byte else { return };
        let Some(reception) = &mut self.reception else { return };
        match reception.incoming.read(byte) {
            Read::More => {}
            Read::DleError => self.damage((Failure::Protocol, 0x0805, Rule::DleError)),
            Read::TooLong => {
                self.out.send(&[NAK], Part::Answer, Rule::RxTooLong);
                self.end_failed((Failure::TooLong, 0, Rule::RxTooLong));
            }
            Read::Good if !reception.is_damaged => self.end_good(),
            Read::Good => self.end_bad(None),
            Read::WrongCheck => {
                self.end_bad(Some((Failure::Checksum, 0x0808, Rule::RxBcc)));
            }
        }
    }

    fn end_good(&mut self) {
        let Some(reception) = self.reception.take() else { return };
        self.out.send(&[DLE], Part::Answer, Rule::Deliver);
        self.deliver(reception.incoming.data, None, 0, Rule::Deliver);
        self.go_idle();
    }

    fn end_bad(&mut self, fault: Option<Fault>) {
        let Some(reception) = &mut self.reception else { return };
        if let Some(fault) = fault {
            reception.damage(fault);
        }
        reception.bad += 1;
        let rule = reception.error.map_or(Rule::RxBcc, |(_, _, rule)| rule);
        let is_last = reception.bad >= self.parameters.transmission_attempts;
        let mark = self.out.send(&[NAK], Part::Answer, rule);
        if is_last {
            self.end_failed((Failure::Internal, 0, Rule::RxAttempts));
        } else if self.parameters.bwz == Micros::ZERO {
            self.end_failed((Failure::Internal, 0, Rule::Bwz));
        } else {
            self.state = State::WaitingForRepetition { mark, bwz: None };
        }
    }

    /// The reception is given up. The first error says why; `fault` if it is that.
    fn end_failed(&mut self, fault: Fault) {
        if let Some(reception) = self.reception.take() {
            self.deliver_failed(reception, fault);
        }
        self.go_idle();
    }

    pub(super) fn deliver_failed(&mut self, reception: Reception, fault: Fault) {
        let (failure, status, _) = reception.error.unwrap_or(fault);
        let rule = if reception.error.is_some() { Rule::FirstError } else { fault.2 };
        let mut data = reception.incoming.data;
        // Without a buffer there are no data, and what finds no room is left out.
        data.truncate(if failure == Failure::NoBuffer { 0 } else { self.room.known() });
        self.deliver(data, Some(failure), status, rule);
    }

    fn deliver(&mut self, bytes: Vec<u8>, failure: Option<Failure>, status: u16, rule: Rule) {
        self.deliveries += 1;
        self.room.deliver(bytes.len());
        let id = self.deliveries;
        self.awaited.push(rule, Effect::Delivered { id, bytes, name: None, failure, status });
    }

    pub(super) fn for_repetition(&mut self, at: Micros, character: Character) {
        if character != Character::Good(STX) {
            return;
        }
        let block = self.empty_block();
        if let Some(reception) = &mut self.reception {
            reception.incoming = block;
            reception.is_damaged = false;
        }
        self.answer_stx(at);
    }

    pub(super) fn mark_has_left(&mut self, at: Micros, left: u64) {
        self.sender_left(at, left);
        match &mut self.state {
            State::Granting { mark } if *mark == left => {
                self.state = State::Receiving { zvz: at + self.parameters.zvz };
            }
            State::WaitingForRepetition { mark, bwz } if *mark == left => {
                *bwz = Some(at + self.parameters.bwz);
            }
            _ => {}
        }
    }

    /// The state's timer has run out.
    pub(super) fn run_out(&mut self, at: Micros) {
        match self.state {
            State::WaitingForBuffer { .. } => self.look_for_buffer(at),
            State::TurnedAway { .. } => {
                self.out.send(&[NAK], Part::Answer, Rule::NoBuffer);
                self.end_failed((Failure::Protocol, 0x0802, Rule::NoBuffer));
            }
            State::Receiving { .. } => self.silence_in_block(),
            State::WaitingForRepetition { .. } => {
                self.end_failed((Failure::Internal, 0, Rule::Bwz));
            }
            State::Garbage { .. } => {
                self.out.send(&[NAK], Part::Answer, Rule::Garbage);
                self.go_idle();
            }
            _ => self.sender_ran_out(),
        }
    }

    fn silence_in_block(&mut self) {
        let is_conflict = self.reception.as_ref().is_some_and(|reception| {
            reception.in_conflict && reception.bad == 0 && reception.incoming.is_lone_dle()
        });
        self.out.send(&[NAK], Part::Answer, Rule::Zvz);
        if is_conflict {
            let fault = (Failure::Conflict, 0x070C, Rule::BothLow);
            if let Some(reception) = &mut self.reception {
                reception.error = None;
            }
            // A job that came behind an abort of this one never gave way: it waits.
            if self.job.as_ref().is_some_and(|job| job.gave_way) {
                self.fail_job(fault);
            }
            self.end_failed(fault);
        } else {
            self.end_failed((Failure::NoAnswer, 0x0806, Rule::Zvz));
        }
    }
}
