//! The remote buffer with protocol A: the control asks, we answer.
//!
//! The control's manual leaves some of it open. This project's decisions: the first
//! job begins with our SYN, unless the control has said something; after that we
//! only answer; GTD without a job, in a pause or without data is answered by WAT;
//! inputs and outputs are empty (SDI without data, SDO taken); CLB says that what
//! was sent is lost; a job is done when the control speaks after EOD, or is silent
//! for Tp; any other silence of Tp fails the job.

mod message;

use crate::state::State;
use crate::tape::{Encoder, MOST_PER_BYTE};
use crate::{PACKET, Settings, set_timer};
use message::{Command, HEAD, Reader, end_code, head, with_parity};
use softplug_plugin::{
    Context, Failure, JobStart, MarkState, Micros, StateError, StateReader, StateWriter,
};

/// The largest packet, and what the encoder gives beyond it.
const BUFFER: usize = 1_024 + 2 * MOST_PER_BYTE;
/// How often a message is repeated, or asked for again.
const MOST_REPEATS: u8 = 3;
/// Reason in our RTY: the message was damaged.
const DAMAGED: u8 = b'1';
/// Reason in our RTY: there is no such command.
const UNKNOWN: u8 = b'2';

const DAT: Command = *b"DAT";
const EOD: Command = *b"EOD";
const GTD: Command = *b"GTD";
const RDY: Command = *b"RDY";
const RTY: Command = *b"RTY";
const SYN: Command = *b"SYN";
const WAT: Command = *b"WAT";

/// What else the control says, the answer, and what it means for data that was sent.
const ANSWERS: [(Command, Command, Option<Failure>); 8] = [
    (SYN, RDY, Some(Failure::PartnerReset)),
    (*b"SAT", *b"SET", None),
    (*b"RST", *b"ARS", Some(Failure::PartnerReset)),
    (*b"ALM", *b"AAL", Some(Failure::PartnerAlarm)),
    (*b"CLB", *b"SET", Some(Failure::PartnerReset)),
    (*b"RDI", *b"SDI", None),
    (*b"SDI", *b"SET", None),
    (*b"SDO", *b"SET", None),
];

/// What the remote buffer is at.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
enum Stage {
    /// No job.
    #[default]
    Idle,
    /// A job; its data is pulled when the control asks.
    Feeding,
    /// All data was given; the encoder is not through.
    Closing,
    /// The encoder is through; the buffer may hold something.
    Closed,
    /// EOD was sent.
    Ending,
    /// The queue is being dropped; the job then fails for this reason.
    Stopping(Failure),
}

#[derive(Clone, Debug)]
pub(crate) struct RemoteBuffer {
    stage: Stage,
    encoder: Encoder,
    reader: Reader,
    job: u32,
    wanted: u32,
    /// Bytes of DAT and EOD queued for the job, repetitions included.
    queued: u64,
    /// What is dropped from the queue is of the job.
    is_own: bool,
    /// The mark on the latest message is still outstanding: there is one at a time.
    is_marked: bool,
    is_paused: bool,
    /// The control is initialised.
    is_ready: bool,
    /// GTD is not answered yet.
    is_asked: bool,
    /// The latest message, in case it must be repeated.
    last: Command,
    repeats: u8,
    retries: u8,
    until: Option<Micros>,
    /// The data of the latest DAT, and what follows it.
    buffer: [u8; BUFFER],
    filled: usize,
    packet: usize,
}

impl RemoteBuffer {
    pub(crate) fn new(settings: &Settings) -> Self {
        Self {
            stage: Stage::Idle,
            encoder: Encoder::new(settings),
            reader: Reader::default(),
            job: 0,
            wanted: 0,
            queued: 0,
            is_own: false,
            is_marked: false,
            is_paused: false,
            is_ready: false,
            is_asked: false,
            last: WAT,
            repeats: 0,
            retries: 0,
            until: None,
            buffer: [0; BUFFER],
            filled: 0,
            packet: 0,
        }
    }

    /// What people are told, if there is a job.
    pub(crate) fn state(&self) -> Option<State> {
        (self.stage != Stage::Idle).then_some(State::Answering)
    }

    pub(crate) fn set_timers(&self, link: &mut Context<'_>) {
        if let Some(at) = self.until {
            link.set_timer(PACKET, at);
        }
    }

    pub(crate) fn job_begin(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        job: &JobStart<'_>,
    ) {
        if let Err(failure) = self.encoder.begin(&job.fields) {
            link.job_failed(job.job, failure, 0, 0);
            return;
        }
        self.stage = Stage::Feeding;
        self.job = job.job;
        self.wanted = 0;
        self.queued = 0;
        self.filled = 0;
        self.packet = 0;
        if !self.is_ready {
            self.say(link, settings, SYN);
        }
    }

    pub(crate) fn job_data(&mut self, link: &mut Context<'_>, settings: &Settings, bytes: &[u8]) {
        self.wanted = self.wanted.saturating_sub(bytes.len() as u32);
        if self.stage != Stage::Feeding {
            return;
        }
        for byte in bytes {
            if let Err(failure) = self.encode(|encoder, sink| encoder.push(settings, *byte, sink)) {
                return self.fail(link, failure);
            }
        }
        self.fill(link, settings);
    }

    pub(crate) fn job_end(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if self.stage == Stage::Feeding {
            self.stage = Stage::Closing;
            self.fill(link, settings);
        }
    }

    /// Answers GTD as soon as a packet is full or the data is at its end.
    fn fill(&mut self, link: &mut Context<'_>, settings: &Settings) {
        if !self.is_asked {
            return;
        }
        let most = settings.packet_size as usize;
        while self.filled < most && self.stage != Stage::Closed {
            let encoded = if self.encoder.is_waiting() {
                self.encode(|encoder, sink| encoder.next(settings, sink))
            } else if self.stage == Stage::Closing {
                let finished = self.encode(|encoder, sink| encoder.finish(settings, sink));
                if !self.encoder.is_waiting() {
                    self.stage = Stage::Closed;
                }
                finished
            } else if self.encoder.is_ended() {
                self.stage = Stage::Closing;
                Ok(())
            } else {
                return self.ask(link, settings, most - self.filled);
            };
            if let Err(failure) = encoded {
                return self.fail(link, failure);
            }
        }
        self.give(link, settings);
    }

    /// Asks for as much data as fits, whatever it grows to; while it is waited for
    /// the control must hear something.
    fn ask(&mut self, link: &mut Context<'_>, settings: &Settings, free: usize) {
        if self.until.is_none() {
            let at = link.now() + Micros::from_millis(settings.poll_time / 2);
            set_timer(link, PACKET, &mut self.until, Some(at));
        }
        if self.wanted == 0 {
            let growth =
                if self.encoder.will_wait() { free as u32 } else { self.encoder.growth(settings) };
            self.wanted = (free as u32 / growth.max(1)).max(1);
            link.want(self.job, self.wanted);
        }
    }

    /// Lets the encoder write behind what is in the buffer.
    fn encode(
        &mut self,
        step: impl FnOnce(&mut Encoder, &mut dyn FnMut(u8)) -> Result<(), Failure>,
    ) -> Result<(), Failure> {
        let (buffer, filled) = (&mut self.buffer, &mut self.filled);
        step(&mut self.encoder, &mut |byte| {
            if let Some(place) = buffer.get_mut(*filled) {
                *place = byte;
                *filled += 1;
            }
        })
    }

    /// Gives the control what there is.
    fn give(&mut self, link: &mut Context<'_>, settings: &Settings) {
        self.is_asked = false;
        let room = (link.transmit_room() as usize).saturating_sub(HEAD + 1);
        self.packet = self.filled.min(settings.packet_size as usize).min(room);
        let answer = if self.packet > 0 {
            DAT
        } else if self.stage == Stage::Closed && self.filled == 0 {
            self.stage = Stage::Ending;
            EOD
        } else {
            WAT
        };
        self.say(link, settings, answer);
    }

    /// Says what may have to be repeated.
    fn say(&mut self, link: &mut Context<'_>, settings: &Settings, command: Command) {
        self.last = command;
        let packet = if command == DAT { self.packet } else { 0 };
        let buffer = self.buffer;
        let data = buffer.get(..packet).unwrap_or_default();
        self.message_out(link, settings, command, data);
    }

    /// Sends a message. Without room it is lost as on the line: the control asks
    /// again.
    fn message_out(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        command: Command,
        data: &[u8],
    ) {
        set_timer(link, PACKET, &mut self.until, None);
        let length = HEAD + data.len() + 1;
        if length > link.transmit_room() as usize {
            return;
        }
        link.transmit(&head(settings, command, data));
        if !data.is_empty() {
            link.transmit(data);
        }
        let mark = u32::from(!self.is_marked);
        self.is_marked = true;
        link.transmit_marked(mark, &[with_parity(settings, end_code(settings))]);
        if is_own(command) {
            self.queued += length as u64;
        }
    }

    /// Our answer has left: the control's turn.
    pub(crate) fn mark(&mut self, link: &mut Context<'_>, settings: &Settings, state: MarkState) {
        if state == MarkState::MaybeLeft {
            return;
        }
        self.is_marked = false;
        let is_busy = !matches!(self.stage, Stage::Idle | Stage::Stopping(_));
        if is_busy && !self.is_asked && (self.queued > 0 || !self.is_ready) {
            self.await_control(link, settings);
        }
    }

    fn await_control(&mut self, link: &mut Context<'_>, settings: &Settings) {
        let at = link.now() + Micros::from_millis(settings.poll_time);
        set_timer(link, PACKET, &mut self.until, Some(at));
    }

    /// The control was silent, or the host has no data for it.
    pub(crate) fn timer(&mut self, link: &mut Context<'_>, settings: &Settings) {
        self.until = None;
        if self.is_asked {
            self.give(link, settings);
        } else if self.stage == Stage::Ending {
            self.done(link);
        } else {
            self.is_ready = false;
            self.fail(link, Failure::NoAnswer);
        }
    }

    pub(crate) fn byte(&mut self, link: &mut Context<'_>, settings: &Settings, byte: u8) {
        // It is not silent.
        if self.until.is_some() && !self.is_asked {
            self.await_control(link, settings);
        }
        let Some(message) = self.reader.read(settings, byte) else { return };
        set_timer(link, PACKET, &mut self.until, None);
        match message {
            Ok(RTY) => {
                self.repeats += 1;
                if self.repeats > MOST_REPEATS {
                    self.repeats = 0;
                    self.fail(link, Failure::AttemptsUsedUp);
                } else {
                    self.say(link, settings, self.last);
                }
            }
            Ok(command) => {
                self.repeats = 0;
                self.message(link, settings, command);
            }
            Err(()) => self.retry(link, settings, DAMAGED),
        }
    }

    /// Asks for the message again. Ours that may have to be repeated stays the same.
    fn retry(&mut self, link: &mut Context<'_>, settings: &Settings, reason: u8) {
        self.retries += 1;
        if self.retries > MOST_REPEATS {
            self.retries = 0;
            self.fail(link, Failure::Checksum);
        } else {
            self.message_out(link, settings, RTY, &[reason]);
        }
    }

    /// A sound message. Our latest one has come through.
    fn message(&mut self, link: &mut Context<'_>, settings: &Settings, command: Command) {
        self.confirm();
        let is_known = command == GTD || command == RDY;
        let answer = ANSWERS.iter().find(|(own, ..)| *own == command);
        if !is_known && answer.is_none() {
            return self.retry(link, settings, UNKNOWN);
        }
        self.retries = 0;
        self.is_ready = true;
        if command == GTD {
            if self.stage == Stage::Ending {
                self.done(link);
            }
            let has_data = matches!(self.stage, Stage::Feeding | Stage::Closing | Stage::Closed);
            if has_data && !self.is_paused {
                self.is_asked = true;
                self.fill(link, settings);
            } else {
                self.say(link, settings, WAT);
            }
            return;
        }
        let Some((_, answer, failure)) = answer else { return };
        match failure {
            Some(failure) if self.queued > 0 => self.lost(link, *failure),
            _ if self.stage == Stage::Ending => self.done(link),
            _ => {}
        }
        self.say(link, settings, *answer);
    }

    /// What was sent is not needed again.
    fn confirm(&mut self) {
        let rest = self.filled.saturating_sub(self.packet);
        for at in 0..rest {
            let byte = self.buffer.get(at + self.packet).copied().unwrap_or_default();
            if let Some(place) = self.buffer.get_mut(at) {
                *place = byte;
            }
        }
        self.filled = rest;
        self.packet = 0;
    }

    pub(crate) fn damaged(
        &mut self,
        link: &mut Context<'_>,
        settings: &Settings,
        byte: Option<u8>,
    ) {
        self.reader.damaged();
        if let Some(byte) = byte {
            self.byte(link, settings, byte);
        }
    }

    /// The port is gone: what comes back is initialised anew.
    pub(crate) fn link_down(&mut self, link: &mut Context<'_>) {
        self.is_ready = false;
        self.reader = Reader::default();
        self.fail(link, Failure::LinkDown);
    }

    /// The control is gone; a job that it has not begun to read stays.
    pub(crate) fn lost(&mut self, link: &mut Context<'_>, failure: Failure) {
        if self.queued > 0 {
            self.fail(link, failure);
        }
    }

    pub(crate) fn set_paused(&mut self, is_paused: bool) {
        self.is_paused = is_paused;
    }

    fn done(&mut self, link: &mut Context<'_>) {
        link.job_done(self.job, self.queued);
        self.finish();
    }

    /// Stops at once. The job fails when it is known how much was sent.
    pub(crate) fn fail(&mut self, link: &mut Context<'_>, failure: Failure) {
        if matches!(self.stage, Stage::Idle | Stage::Stopping(_)) {
            return;
        }
        self.stage = Stage::Stopping(failure);
        self.is_own = is_own(self.last);
        self.is_asked = false;
        set_timer(link, PACKET, &mut self.until, None);
        link.discard();
    }

    pub(crate) fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        let Stage::Stopping(failure) = self.stage else { return };
        let dropped = if self.is_own { u64::from(bytes) } else { 0 };
        link.job_failed(self.job, failure, 0, self.queued.saturating_sub(dropped));
        self.finish();
    }

    fn finish(&mut self) {
        self.stage = Stage::Idle;
        self.is_paused = false;
        self.queued = 0;
        self.filled = 0;
        self.packet = 0;
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        let (stage, failure) = match self.stage {
            Stage::Idle => (0, None),
            Stage::Feeding => (1, None),
            Stage::Closing => (2, None),
            Stage::Closed => (3, None),
            Stage::Ending => (4, None),
            Stage::Stopping(failure) => (5, Some(failure)),
        };
        state.u8(stage);
        state.failure(failure);
        self.encoder.save(state);
        self.reader.save(state);
        state.u32(self.job);
        state.u32(self.wanted);
        state.u64(self.queued);
        for flag in [self.is_own, self.is_marked, self.is_paused, self.is_ready, self.is_asked] {
            state.bool(flag);
        }
        state.bytes(&self.last);
        state.u8(self.repeats);
        state.u8(self.retries);
        state.deadline(self.until);
        state.u16(self.filled as u16);
        state.u16(self.packet as u16);
        state.bytes(self.buffer.get(..self.filled).unwrap_or_default());
    }

    pub(crate) fn restore(
        &mut self,
        settings: &Settings,
        state: &mut StateReader<'_>,
    ) -> Result<(), StateError> {
        self.stage = match (state.u8(), state.failure()) {
            (0, None) => Stage::Idle,
            (1, None) => Stage::Feeding,
            (2, None) => Stage::Closing,
            (3, None) => Stage::Closed,
            (4, None) => Stage::Ending,
            (5, Some(failure)) => Stage::Stopping(failure),
            _ => return Err(StateError),
        };
        self.encoder.restore(settings, state)?;
        self.reader = Reader::restore(state);
        self.job = state.u32();
        self.wanted = state.u32();
        self.queued = state.u64();
        for flag in [
            &mut self.is_own,
            &mut self.is_marked,
            &mut self.is_paused,
            &mut self.is_ready,
            &mut self.is_asked,
        ] {
            *flag = state.bool();
        }
        self.last = state.bytes(3).first_chunk().copied().unwrap_or_default();
        self.repeats = state.u8();
        self.retries = state.u8();
        self.until = state.deadline();
        self.filled = usize::from(state.u16());
        self.packet = usize::from(state.u16());
        let place = self.buffer.get_mut(..self.filled).ok_or(StateError)?;
        for (own, byte) in place.iter_mut().zip(state.bytes(self.filled)) {
            *own = *byte;
        }
        Ok(())
    }
}

/// Whether a message counts as sent for the job.
fn is_own(command: Command) -> bool {
    matches!(command, DAT | EOD)
}
