//! Section 4 of the protocol's page: the receiver.

use softplug_abi::Micros;

use super::frame::{DLE, Frame, NAK, Progress, STX};
use super::report::{Error, Received};
use super::transmitter::{Item, Role};
use super::{Fault, Occasion, State, Station};

/// A block of the other side's.
#[derive(Debug)]
pub(super) struct Reception {
    pub(super) frame: Frame,
    /// Bad tries so far, and what was wrong with the first.
    pub(super) bad: u32,
    pub(super) first: Option<Error>,
    /// What is put in after so many more characters.
    pub(super) interjection: Option<(u32, Item)>,
}

impl Station {
    pub(super) fn take_idle(&mut self, byte: Option<u8>) {
        match byte {
            Some(STX) => self.answer(),
            Some(NAK) => {}
            _ => {
                self.error(if byte.is_none() { Error::Line } else { Error::IdleGarbage });
                self.state = State::Garbage;
                self.wait(self.options.zvz);
            }
        }
    }

    /// An STX came and is to be answered.
    pub(super) fn answer(&mut self) {
        let before = (self.state, self.deadline.take());
        let bad = self.reception.as_ref().map_or((0, None), |one| (one.bad, one.first));
        let fault = self.fault(Occasion::Answer);
        match fault {
            Some(Fault::NoAnswer) => {
                return self.resume(before);
            }
            Some(Fault::NakAnswer) => {
                self.react();
                self.say(NAK, Role::Nak);
                self.give_up_reception(Error::NoBuffer);
                return self.idle();
            }
            Some(Fault::OtherAnswer(byte)) => {
                self.react();
                self.say(byte, Role::Stray);
                return self.resume(before);
            }
            Some(Fault::Conflict) => {
                self.reception = None;
                self.state = State::Idle;
                if self.job.is_none() && self.jobs.is_empty() {
                    self.jobs.push_back(Vec::new());
                }
                return self.rest();
            }
            Some(Fault::NoBuffer) => {
                self.state = State::AwaitingBuffer;
                return self.wait(self.options.buffer_wait);
            }
            Some(Fault::Silence(span)) => {
                self.reception = None;
                self.state = State::Silent;
                return self.wait(span);
            }
            Some(Fault::LateAnswer(span)) => self.transmitter.push(Item::Pause(span)),
            _ => {}
        }
        self.reception =
            Some(Reception { frame: Frame::new(), bad: bad.0, first: bad.1, interjection: None });
        if self.options.handshake {
            self.state = State::Answering;
            self.react();
            self.say(DLE, Role::Answer);
        } else {
            self.begin_frame();
        }
    }

    /// As if the STX had not come. One of our own that was taken back for it is
    /// as good as unanswered.
    fn resume(&mut self, (state, deadline): (State, Option<Micros>)) {
        self.state = state;
        self.deadline = deadline;
        if state == State::Connecting && deadline.is_none() {
            self.wait(self.options.qvz);
        }
    }

    pub(super) fn begin_frame(&mut self) {
        self.state = State::Receiving;
        self.wait(self.options.zvz);
        let interjection = match self.fault(Occasion::Reception) {
            Some(Fault::NakInBlock(after)) => Some((after, Item::Character(NAK, Role::Nak))),
            Some(Fault::OtherInBlock(after, byte)) => {
                Some((after, Item::Character(byte, Role::Stray)))
            }
            Some(Fault::BreakInBlock(after)) => {
                Some((after, Item::Break(self.options.line.characters(2) + Micros(1_000))))
            }
            _ => None,
        };
        if let Some(reception) = &mut self.reception {
            reception.interjection = interjection;
        }
    }

    /// Characters came although the sender was to wait for DLE.
    pub(super) fn spoil(&mut self, byte: Option<u8>) {
        let error = if byte.is_none() { Error::Line } else { Error::IdleGarbage };
        if let Some(reception) = &mut self.reception {
            reception.frame.note(error);
        }
    }

    pub(super) fn take_receiving(&mut self, byte: Option<u8>) {
        self.wait(self.options.zvz);
        if byte == Some(STX) && self.options.handshake && !self.is_after(self.answer_left) {
            // A repeated STX that crossed the answer to the first.
            return;
        }
        let Some(reception) = &mut self.reception else { return };
        let progress = match byte {
            Some(byte) => reception.frame.take(byte, &self.options),
            None => reception.frame.damaged(&self.options),
        };
        match progress {
            Progress::More => self.interject(),
            Progress::TooLong => {
                self.say(NAK, Role::Nak);
                self.give_up_reception(Error::TooLong);
                self.idle();
            }
            Progress::End(Ok(data)) => self.acknowledge(data),
            Progress::End(Err(error)) => self.refuse(error),
        }
    }

    pub(super) fn interject(&mut self) {
        let Some((after, item)) = self.reception.as_mut().and_then(|one| one.interjection.as_mut())
        else {
            return;
        };
        *after = after.saturating_sub(1);
        if *after > 0 {
            return;
        }
        let item = *item;
        if let Some(reception) = &mut self.reception {
            reception.interjection = None;
        }
        self.transmitter.push(item);
        if !matches!(item, Item::Character(_, Role::Stray)) {
            self.reception = None;
            self.idle();
        }
    }

    pub(super) fn acknowledge(&mut self, data: Vec<u8>) {
        let place = self.report.received.len();
        let fault = self.fault(Occasion::Acknowledgement);
        match fault {
            Some(Fault::NakAcknowledgement) => return self.refuse(Error::Check),
            Some(Fault::OtherAcknowledgement(byte)) => {
                self.react();
                self.say(byte, Role::Stray);
                self.reception = None;
                return self.idle();
            }
            _ => {}
        }
        self.report.received.push(Received { at: self.now, data });
        if let Some(job) = &mut self.job {
            job.in_vain = 0;
        }
        if let Some(Fault::LateAcknowledgement(span)) = fault {
            self.transmitter.push(Item::Pause(span));
        }
        if fault != Some(Fault::NoAcknowledgement) {
            self.react();
            self.say(DLE, Role::Acknowledgement(place));
        }
        self.reception = None;
        self.idle();
    }

    pub(super) fn refuse(&mut self, error: Error) {
        self.error(error);
        self.react();
        self.say(NAK, Role::Nak);
        let Some(reception) = &mut self.reception else { return };
        reception.bad += 1;
        reception.first.get_or_insert(error);
        let used_up = reception.bad >= self.options.transmission_attempts;
        if used_up || self.options.bwz == Micros::ZERO {
            self.reception = None;
            self.idle();
        } else {
            self.state = State::AwaitingRepeat;
            self.deadline = None;
        }
    }

    /// ZVZ ran out within a block.
    pub(super) fn interrupted(&mut self) {
        let Some(reception) = self.reception.take() else { return };
        let withdrawn = self.job.as_ref().is_some_and(|job| job.withdrawn);
        self.say(NAK, Role::Nak);
        let in_vain = self.job.as_mut().filter(|job| job.withdrawn).map_or(0, |job| {
            job.in_vain += 1;
            job.in_vain
        });
        let is_both_low = withdrawn && reception.frame.is_only_dle();
        // Whatever it is that comes instead of a block, it must end.
        if is_both_low || in_vain > self.options.setup_attempts {
            self.error(Error::BothLow);
            self.finish(Err(Error::BothLow));
        } else {
            self.error(reception.frame.first_error().unwrap_or(Error::CharacterDelay));
            self.idle();
        }
    }

    pub(super) fn give_up_reception(&mut self, error: Error) {
        let first = self.reception.take().and_then(|reception| reception.first);
        self.error(first.unwrap_or(error));
    }
}
