//! The procedure: what a station does on an arrival, when something has left,
//! and when a time has run out. Sections are those of the protocol's page.

use softplug_abi::Micros;

use super::frame::{DLE, ETX, Frame, NAK, Progress, STX, encode};
use super::report::{Error, Received, Sent};
use super::transmitter::{Item, Role};
use super::{Fault, Occasion, Priority, Station};

/// Where a station stands.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum State {
    Idle,
    /// Stray characters came: ZVZ of silence, then NAK.
    Garbage,
    /// STX is on its way or has left: DLE within QVZ.
    Connecting,
    /// The block is leaving.
    Sending,
    /// The block was stopped by a stray character: ZVZ of silence, NAK, STX.
    Clearing,
    /// The block has left: DLE within QVZ.
    AwaitingEnd,
    /// STX came and there is no buffer.
    AwaitingBuffer,
    /// DLE for an STX has not left yet.
    Answering,
    /// The next character of the block within ZVZ.
    Receiving,
    /// A bad block was answered by NAK: STX within BWZ.
    AwaitingRepeat,
    /// Deaf and dumb on purpose.
    Silent,
}

/// A block of our own.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) data: Vec<u8>,
    pub(super) begun: Micros,
    /// Tries since the last conflict: STXs for this try of the block, and blocks.
    setups: u32,
    transmissions: u32,
    /// All of them.
    stx: u32,
    blocks: u32,
    /// The STX was answered by STX, to which high priority pays no heed.
    saw_stx: bool,
    /// It gives way to the other side at present.
    withdrawn: bool,
    /// How often it gave way and no block came.
    in_vain: u32,
}

/// A block of the other side's.
#[derive(Debug)]
pub(super) struct Reception {
    frame: Frame,
    /// Bad tries so far, and what was wrong with the first.
    bad: u32,
    first: Option<Error>,
    /// What is put in after so many more characters.
    interjection: Option<(u32, Item)>,
}

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

    // Section 3: the sender.

    fn start(&mut self) {
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

    fn report_stx(&mut self) {
        if let Some(job) = &mut self.job {
            job.stx += 1;
        }
    }

    fn take_connecting(&mut self, byte: Option<u8>) {
        let has_left = !self.transmitter.holds(Role::Start) && self.is_after(self.start_left);
        match byte {
            // What ends before or with the STX cannot be an answer to it.
            Some(DLE) if has_left => self.send_block(),
            Some(STX) if self.options.priority != Priority::None => self.collide(),
            _ => self.next_setup(Error::SetUpRefused),
        }
    }

    /// Section 5: our STX was answered by an STX.
    fn collide(&mut self) {
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

    fn send_block(&mut self) {
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
                if let Some(place) = place {
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

    fn take_sending(&mut self, byte: Option<u8>) {
        self.transmitter.stop();
        if byte == Some(NAK) {
            self.next_transmission(Error::Stopped);
        } else {
            self.state = State::Clearing;
            self.wait(self.options.zvz);
        }
    }

    fn next_setup(&mut self, error: Error) {
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

    fn next_transmission(&mut self, error: Error) {
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

    fn finish(&mut self, result: Result<(), Error>) {
        if let Some(job) = self.job.take() {
            let Job { data, begun, stx, blocks, .. } = job;
            let ended = self.now;
            self.report.sent.push(Sent { data, begun, ended, stx, blocks, result });
        }
        self.idle();
    }

    // Section 4: the receiver.

    fn take_idle(&mut self, byte: Option<u8>) {
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
    fn answer(&mut self) {
        let before = (self.state, self.deadline.take());
        let bad = self.reception.as_ref().map_or((0, None), |one| (one.bad, one.first));
        let fault = self.fault(Occasion::Answer);
        match fault {
            Some(Fault::NoAnswer) => {
                (self.state, self.deadline) = before;
                return;
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
                (self.state, self.deadline) = before;
                return;
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

    fn begin_frame(&mut self) {
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
    fn spoil(&mut self, byte: Option<u8>) {
        let error = if byte.is_none() { Error::Line } else { Error::IdleGarbage };
        if let Some(reception) = &mut self.reception {
            reception.frame.note(error);
        }
    }

    fn take_receiving(&mut self, byte: Option<u8>) {
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

    fn interject(&mut self) {
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

    fn acknowledge(&mut self, data: Vec<u8>) {
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

    fn refuse(&mut self, error: Error) {
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
    fn interrupted(&mut self) {
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

    fn give_up_reception(&mut self, error: Error) {
        let first = self.reception.take().and_then(|reception| reception.first);
        self.error(first.unwrap_or(error));
    }

    // What both share.

    fn idle(&mut self) {
        self.state = State::Idle;
        self.deadline = None;
        if self.job.is_none() && self.reception.is_none() {
            match self.fault(Occasion::Rest) {
                Some(Fault::Garbage(bytes)) => {
                    bytes.into_iter().for_each(|byte| self.say(byte, Role::Stray));
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

    fn fault(&mut self, occasion: Occasion) -> Option<Fault> {
        let fault = self.schedule.at(occasion)?;
        self.report.faults.push((self.now, fault.clone()));
        Some(fault)
    }

    fn error(&mut self, error: Error) {
        self.report.errors.push((self.now, error));
    }

    fn wait(&mut self, span: Micros) {
        self.deadline = Some(self.now + span);
    }

    /// Whether time has gone on since; without a rate all may be of one time.
    fn is_after(&self, instant: Micros) -> bool {
        self.options.line.baud == 0 || self.now > instant
    }

    fn react(&mut self) {
        if self.options.reaction > Micros::ZERO {
            self.transmitter.push(Item::Pause(self.options.reaction));
        }
    }

    fn say(&mut self, byte: u8, role: Role) {
        self.transmitter.push(Item::Character(byte, role));
    }
}

impl Job {
    fn new(data: Vec<u8>, begun: Micros) -> Self {
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
    fn again(&mut self) {
        self.setups = 1;
        self.transmissions = 1;
        self.withdrawn = false;
    }
}
