//! The procedure: what a station does on an arrival, when something has left,
//! and when a time has run out. Sections are those of the protocol's page.

use softplug_abi::Micros;

use super::frame::{DLE, NAK, STX};
use super::report::Error;
use super::sender::Job;
use super::transmitter::{Item, Role};
use super::{Fault, Occasion, State, Station};

impl Station {
    /// A character came; `None`: it is damaged.
    pub(super) fn take(&mut self, byte: Option<u8>) {
        if byte == Some(NAK) && self.state != State::Receiving {
            self.report.naks_received += 1;
        }
        match self.state {
            State::Idle => self.take_idle(byte),
            State::Garbage | State::Clearing => self.wait(self.options.zvz),
            State::Connecting => self.take_connecting(byte),
            State::Sending => self.take_sending(byte),
            State::AwaitingEnd => match byte {
                Some(DLE) => self.finish(Ok(())),
                _ => self.next_transmission(Error::EndRefused),
            },
            State::Receiving => self.take_receiving(byte),
            State::AwaitingRepeat if byte == Some(STX) => self.answer(),
            // A repeated STX is answered by the DLE that is on its way.
            State::Answering if byte != Some(STX) => self.spoil(byte),
            State::Answering | State::AwaitingBuffer | State::AwaitingRepeat | State::Silent => {}
        }
    }

    /// Section 4: straight to idle from every state.
    pub(super) fn take_break(&mut self) {
        match self.state {
            State::Silent => return,
            State::Idle | State::Garbage => {}
            State::Connecting | State::Sending | State::Clearing | State::AwaitingEnd => {
                self.transmitter.stop();
                self.finish(Err(Error::Break));
            }
            State::AwaitingBuffer | State::Answering | State::Receiving | State::AwaitingRepeat => {
                self.transmitter.stop();
                self.give_up_reception(Error::Break);
            }
        }
        self.idle();
    }

    /// A character of this role has left.
    pub(super) fn left(&mut self, role: Role) {
        match role {
            Role::Start => {
                self.start_left = self.now;
                self.report.stx += 1;
                let is_last = !self.transmitter.holds(Role::Start);
                if self.state == State::Connecting && is_last {
                    self.wait(self.options.qvz);
                }
            }
            Role::Answer if self.state == State::Answering => {
                self.answer_left = self.now;
                self.begin_frame();
            }
            Role::Acknowledgement(place) => {
                self.report.acknowledged.push((self.now, place));
            }
            Role::Nak => {
                self.report.naks += 1;
                if self.state == State::AwaitingRepeat {
                    self.wait(self.options.bwz);
                }
            }
            Role::BlockEnd if self.state == State::Sending => {
                self.state = State::AwaitingEnd;
                self.wait(self.options.qvz);
            }
            Role::Answer | Role::Block | Role::BlockEnd | Role::Stray => {}
        }
    }

    /// The state's time has run out.
    pub(super) fn time_out(&mut self) {
        match self.state {
            State::Garbage => {
                if self.options.nak_on_garbage {
                    self.say(NAK, Role::Nak);
                }
                self.idle();
            }
            State::Connecting => self.next_setup(Error::SetUpNoAnswer),
            State::Clearing => {
                self.say(NAK, Role::Nak);
                self.next_transmission(Error::Disturbed);
            }
            State::AwaitingEnd => self.next_transmission(Error::EndNoAnswer),
            State::AwaitingBuffer => {
                self.say(NAK, Role::Nak);
                self.give_up_reception(Error::NoBuffer);
                self.idle();
            }
            State::Receiving => self.interrupted(),
            State::AwaitingRepeat => {
                self.give_up_reception(Error::BlockWait);
                self.idle();
            }
            State::Silent => self.idle(),
            State::Idle | State::Sending | State::Answering => {}
        }
    }

    /// Nothing is under way: the next block, if there is one.
    pub(super) fn rest(&mut self) {
        if self.state != State::Idle {
            return;
        }
        if self.job.is_none()
            && let Some(data) = self.jobs.pop_front()
        {
            self.job = Some(Job::new(data, self.now));
        }
        if let Some(job) = &mut self.job {
            job.again();
            self.start();
        }
    }

    pub(super) fn idle(&mut self) {
        self.state = State::Idle;
        self.deadline = None;
        if self.job.is_none() && self.reception.is_none() {
            match self.fault(Occasion::Rest) {
                Some(Fault::Garbage(bytes)) => {
                    for byte in bytes {
                        self.say(byte, Role::Stray);
                    }
                }
                Some(Fault::Break) => {
                    let span = self.options.line.characters(2) + Micros(1_000);
                    self.transmitter.push(Item::Break(span));
                }
                _ => {}
            }
        }
        self.rest();
    }

    pub(super) fn fault(&mut self, occasion: Occasion) -> Option<Fault> {
        let fault = self.schedule.at(occasion)?;
        self.report.faults.push((self.now, fault.clone()));
        Some(fault)
    }

    pub(super) fn error(&mut self, error: Error) {
        self.report.errors.push((self.now, error));
    }

    pub(super) fn wait(&mut self, span: Micros) {
        self.deadline = Some(self.now + span);
    }

    /// Whether time has gone on since; without a rate all may be of one time.
    pub(super) fn is_after(&self, instant: Micros) -> bool {
        self.options.line.baud == 0 || self.now > instant
    }

    pub(super) fn react(&mut self) {
        if self.options.reaction > Micros::ZERO {
            self.transmitter.push(Item::Pause(self.options.reaction));
        }
    }

    pub(super) fn say(&mut self, byte: u8, role: Role) {
        self.transmitter.push(Item::Character(byte, role));
    }
}
