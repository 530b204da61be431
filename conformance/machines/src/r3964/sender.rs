//! Section 3 of the protocol's page: the sender; and 5, the conflict.

use softplug_abi::Micros;

use super::frame::{DLE, ETX, NAK, STX, encode};
use super::report::{Error, Sent};
use super::transmitter::{Item, Role};
use super::{Fault, Occasion, Priority, State, Station};

/// A block of our own.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) data: Vec<u8>,
    pub(super) begun: Micros,
    /// Tries since the last conflict: STXs for this try of the block, and blocks.
    pub(super) setups: u32,
    pub(super) transmissions: u32,
    /// All of them.
    pub(super) stx: u32,
    pub(super) blocks: u32,
    /// The STX was answered by STX, to which high priority pays no heed.
    pub(super) saw_stx: bool,
    /// It gives way to the other side at present.
    pub(super) withdrawn: bool,
    /// How often it gave way and no block came.
    pub(super) in_vain: u32,
}

impl Station {
    pub(super) fn start(&mut self) {
        if let Some(fault) = self.fault(Occasion::Start)
            && let Fault::LateStart(span) = fault
        {
            self.transmitter.push(Item::Pause(span));
        }
        self.deadline = None;
        self.report_stx();
        self.say(STX, Role::Start);
        if self.options.handshake {
            self.state = State::Connecting;
        } else {
            self.send_block();
        }
    }

    pub(super) fn report_stx(&mut self) {
        if let Some(job) = &mut self.job {
            job.stx += 1;
        }
    }

    pub(super) fn take_connecting(&mut self, byte: Option<u8>) {
        let has_left = !self.transmitter.holds(Role::Start) && self.is_after(self.start_left);
        match byte {
            // What ends before or with the STX cannot be an answer to it.
            Some(DLE) if has_left => self.send_block(),
            Some(STX) if self.options.priority != Priority::None => self.collide(),
            _ => self.next_setup(Error::SetUpRefused),
        }
    }

    /// Section 5: our STX was answered by an STX.
    pub(super) fn collide(&mut self) {
        self.report.conflicts += 1;
        let Some(job) = &mut self.job else { return };
        if self.options.priority == Priority::High {
            job.saw_stx = true;
            return;
        }
        job.withdrawn = true;
        self.transmitter.stop();
        self.answer();
    }

    pub(super) fn send_block(&mut self) {
        self.state = State::Sending;
        self.deadline = None;
        self.report.blocks_begun += 1;
        let fault = self.fault(Occasion::Block);
        let Some(job) = &mut self.job else { return };
        job.blocks += 1;
        job.saw_stx = false;
        let mut block = encode(&job.data, &self.options);
        let end = block.len() - if self.options.bcc { 3 } else { 2 };
        let mut gap = None;
        match fault {
            Some(Fault::WrongCheck) => {
                if let Some(last) = block.last_mut() {
                    *last ^= 0x41;
                }
            }
            Some(Fault::LoneDle(after)) => {
                // Where it can be read as nothing else.
                let is_alone = |place: &usize| {
                    let before = block[..*place].iter().rev().take_while(|byte| **byte == DLE);
                    before.count() % 2 == 0 && ![DLE, ETX].contains(&block[*place])
                };
                let place = (after as usize..end).find(is_alone);
                if let Some(place) = place.filter(|_| self.options.doubling) {
                    block.insert(place, DLE);
                    if self.options.bcc
                        && let Some(check) = block.last_mut()
                    {
                        *check ^= DLE;
                    }
                }
            }
            Some(Fault::Cut(after)) => block.truncate((after as usize).clamp(1, block.len())),
            Some(Fault::Gap(after, span)) => gap = Some((after as usize, span)),
            _ => {}
        }
        let last = block.len() - 1;
        for (place, byte) in block.into_iter().enumerate() {
            if let Some((_, span)) = gap.filter(|(after, _)| *after == place) {
                self.transmitter.push(Item::Pause(span));
            }
            let role = if place == last { Role::BlockEnd } else { Role::Block };
            self.transmitter.push(Item::Character(byte, role));
        }
    }

    pub(super) fn take_sending(&mut self, byte: Option<u8>) {
        self.transmitter.stop();
        if byte == Some(NAK) {
            self.next_transmission(Error::Stopped);
        } else {
            self.state = State::Clearing;
            self.wait(self.options.zvz);
        }
    }

    pub(super) fn next_setup(&mut self, error: Error) {
        self.error(error);
        let Some(job) = &mut self.job else { return };
        job.setups += 1;
        if job.setups <= self.options.setup_attempts {
            self.start();
            return;
        }
        let saw_stx = job.saw_stx;
        self.say(NAK, Role::Nak);
        let both_high = saw_stx && error == Error::SetUpNoAnswer;
        self.finish(Err(if both_high { Error::BothHigh } else { error }));
    }

    pub(super) fn next_transmission(&mut self, error: Error) {
        self.error(error);
        let Some(job) = &mut self.job else { return };
        job.setups = 1;
        job.transmissions += 1;
        if job.transmissions <= self.options.transmission_attempts {
            self.start();
            return;
        }
        // Clearing has said NAK already.
        if self.state != State::Clearing {
            self.say(NAK, Role::Nak);
        }
        self.finish(Err(error));
    }

    pub(super) fn finish(&mut self, result: Result<(), Error>) {
        if let Some(job) = self.job.take() {
            let Job { data, begun, stx, blocks, .. } = job;
            let ended = self.now;
            self.report.sent.push(Sent { data, begun, ended, stx, blocks, result });
        }
        self.idle();
    }
}

impl Job {
    pub(super) fn new(data: Vec<u8>, begun: Micros) -> Self {
        Self {
            data,
            begun,
            setups: 1,
            transmissions: 1,
            stx: 0,
            blocks: 0,
            saw_stx: false,
            withdrawn: false,
            in_vain: 0,
        }
    }

    /// It begins, or begins anew after a conflict: the attempts start at 1.
    pub(super) fn again(&mut self) {
        self.setups = 1;
        self.transmissions = 1;
        self.withdrawn = false;
    }
}
