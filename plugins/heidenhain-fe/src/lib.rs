//! Heidenhain blockwise transfer (FE1 mode): lines in blocks with a check character, each
//! answered by ACK or NAK; the control asks for programs and sends them.
//!
//! The protocol's page is `docs/protocols/heidenhain-fe.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod frame;
mod line;
mod receiver;
mod sender;
mod settings;
mod stage;

pub use settings::{LineEnd, Parity, Settings};

use core::sync::atomic::{AtomicBool, Ordering};
use frame::{ACK, DC1, DC3, EOT, ETX, Frame, Heard, NAK, Reader, SOH, Text};
use line::{Line, Timer, heard, say};
use receiver::Receiver;
use sender::Sender;
use softplug_plugin::{
    Context, Converter, Failure, JobStart, LineErrorKind, LinkDownReason, MarkState, Micros,
    NoteLevel, Opening, StateError, StateReader, StateWriter, Value, ValueWriter, Values, mutant,
};
use stage::Stage;

/// The field of a job, and of a request, with the program's name.
const NAME: u16 = 0;
/// The field of a request with the program's kind.
const KIND: u16 = 1;

/// Only mutants ask for it: the control has held the line at any time since the module was
/// loaded.
static HELD_BEFORE: AtomicBool = AtomicBool::new(false);

/// The converter.
#[derive(Debug)]
pub struct HeidenhainFe {
    settings: Settings,
    stage: Stage,
    reader: Reader,
    line: Line,
    sender: Sender,
    receiver: Receiver,
    /// The request that the host has not answered.
    request: u32,
    /// The name that the control asks for.
    asked: Text,
    /// The header that ended a job is looked at once the job is over.
    has_header: bool,
    named: Option<&'static str>,
}

softplug_plugin::export!(HeidenhainFe);

impl Converter for HeidenhainFe {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;
    const STATE_FORMAT: Option<u16> = Some(1);

    fn new(settings: Settings) -> Self {
        Self {
            settings,
            stage: Stage::default(),
            reader: Reader::default(),
            line: Line::default(),
            sender: Sender::default(),
            receiver: Receiver::default(),
            request: 0,
            asked: Text::default(),
            has_header: false,
            named: None,
        }
    }

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        if opening.resumed {
            self.line.set_timers(link);
        } else if mutant!("heidenhain-fe.line.close/hold-kept")
            && HELD_BEFORE.load(Ordering::Relaxed)
        {
            self.line.hold(link);
        }
        self.name_state(link);
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        for byte in bytes {
            match heard(&self.settings, *byte) {
                Some(byte) => self.character(link, byte),
                None => self.reader.damage(),
            }
        }
        self.watch(link);
        self.name_state(link);
    }

    fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        _byte: Option<u8>,
        _span: u32,
    ) {
        // The character is not looked at: what is missing at the end shows by the silence.
        link.note(NoteLevel::Warning, u16::from(kind.code()), kind.text());
        self.reader.damage();
        self.watch(link);
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.reader.forget();
        if mutant!("heidenhain-fe.line.down/goes-on") {
            return;
        }
        self.give_up(link, Failure::LinkDown);
        if !self.stage.is_sending() {
            self.sender.fail(link, Failure::LinkDown);
        }
        self.watch(link);
        self.name_state(link);
    }

    fn link_up(&mut self, link: &mut Context<'_>) {
        if !mutant!("heidenhain-fe.line.down/hold-kept") {
            self.line.release(link);
        }
        self.name_state(link);
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        match Timer::from_id(id) {
            Some(Timer::Character) => {
                self.line.ran_out(Timer::Character);
                let frame = self.reader.cut_off();
                self.frame(link, frame);
            }
            Some(Timer::Answer) => {
                self.line.ran_out(Timer::Answer);
                self.stop(link, Failure::NoAnswer);
            }
            Some(Timer::Block) => {
                self.line.ran_out(Timer::Block);
                self.end_reception(link, Some(Failure::NoAnswer));
                if !mutant!("heidenhain-fe.rx.silence/control-not-told") {
                    say(link, &self.settings, EOT);
                }
            }
            Some(Timer::Job) => {
                self.line.ran_out(Timer::Job);
                self.too_late(link);
            }
            None => {}
        }
        self.watch(link);
        self.name_state(link);
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: u32, state: MarkState) {
        if self.sender.left(mark, state) && state == MarkState::SurelyLeft {
            match self.stage {
                Stage::Answer if mutant!("heidenhain-fe.tx.answer-time/never") => {}
                Stage::Answer => {
                    self.line.set_after(link, Timer::Answer, self.settings.answer_time);
                }
                Stage::Ending => {
                    self.stage = Stage::Idle;
                    self.sender.done(link);
                }
                _ => {}
            }
        }
        self.name_state(link);
    }

    fn transmit_room(&mut self, link: &mut Context<'_>) {
        self.go_on(link);
        self.name_state(link);
    }

    fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        let Stage::Stopping(failure) = self.stage else { return };
        self.stage = Stage::Idle;
        self.sender.dropped(bytes);
        self.sender.fail(link, failure);
        let partner_knows =
            matches!(failure, Failure::Refused | Failure::PartnerReset | Failure::LinkDown);
        let is_silent =
            failure == Failure::Aborted && mutant!("heidenhain-fe.tx.abort/control-not-told");
        if !partner_knows && !is_silent {
            say(link, &self.settings, EOT);
        }
        if core::mem::take(&mut self.has_header) {
            self.header(link);
        }
        self.watch(link);
        self.name_state(link);
    }

    fn delivery_room(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Waiting {
            self.accept(link);
            self.watch(link);
            self.name_state(link);
        }
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        if !self.sender.begin(link, &job, NAME) {
            return;
        }
        if self.sender.is_checking() {
            self.sender.ask(link);
        } else if self.stage == Stage::Granted || mutant!("heidenhain-fe.tx.on-request/at-once") {
            self.supply(link);
        } else {
            self.await_control(link);
        }
        self.name_state(link);
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: u32, bytes: &[u8]) {
        if self.sender.is_checking() {
            self.sender.check(link, &self.settings, bytes);
        } else {
            self.sender.data(bytes);
            self.go_on(link);
        }
        self.name_state(link);
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: u32) {
        if self.sender.is_checking() {
            self.sender.checked(link);
        } else {
            self.sender.data_ended();
            self.go_on(link);
        }
        self.name_state(link);
    }

    fn pause(&mut self, link: &mut Context<'_>, _job: u32) {
        self.sender.is_paused = true;
        self.name_state(link);
    }

    fn resume(&mut self, link: &mut Context<'_>, _job: u32) {
        self.sender.is_paused = false;
        self.go_on(link);
        self.name_state(link);
    }

    fn abort(&mut self, link: &mut Context<'_>, job: u32) {
        if job == 0 {
            if self.stage.is_receiving() {
                self.end_reception(link, Some(Failure::Aborted));
                if !mutant!("heidenhain-fe.rx.abort/control-not-told") {
                    say(link, &self.settings, EOT);
                }
            }
        } else if self.stage.is_sending() {
            self.stop(link, Failure::Aborted);
        } else {
            self.line.cancel(link, Timer::Job);
            self.sender.fail(link, Failure::Aborted);
        }
        self.watch(link);
        self.name_state(link);
    }

    fn force_resume(&mut self, link: &mut Context<'_>) {
        self.line.release(link);
        self.name_state(link);
    }

    fn answer(
        &mut self,
        link: &mut Context<'_>,
        request: u32,
        answer: Result<&[u8], Failure>,
        more: bool,
    ) {
        if more || request != self.request || self.stage != Stage::Asking {
            return;
        }
        match answer {
            Ok(_) if self.sender.is_waiting() => self.supply(link),
            Ok(_) => {
                self.stage = Stage::Granted;
                if !mutant!("heidenhain-fe.tx.granted/never-too-late") {
                    self.line.set_after(link, Timer::Job, self.settings.job_time);
                }
            }
            Err(failure) => {
                link.note(NoteLevel::Warning, failure.code(), "the program was refused");
                self.refuse(link);
            }
        }
        self.name_state(link);
    }

    fn save(&self, state: &mut StateWriter<'_>) {
        self.stage.save(state);
        self.reader.save(state);
        self.line.save(state);
        self.sender.save(state);
        self.receiver.save(state);
        state.u32(self.request);
        self.asked.save(state);
        state.bool(self.has_header);
    }

    fn restore(&mut self, _format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
        self.stage = Stage::restore(state)?;
        self.reader = Reader::restore(state)?;
        self.line = Line::restore(state);
        self.sender = Sender::restore(state)?;
        self.receiver = Receiver::restore(state);
        self.request = state.u32();
        self.asked = Text::restore(state)?;
        self.has_header = state.bool();
        Ok(())
    }
}

impl HeidenhainFe {
    fn character(&mut self, link: &mut Context<'_>, byte: u8) {
        let heard = self.reader.take(byte, self.settings.dc1, self.settings.bcc_space);
        match heard {
            Heard::Inside if byte == DC3 && mutant!("heidenhain-fe.line.hold/in-text") => {
                self.line.hold(link);
            }
            Heard::Inside | Heard::Alone(_) if self.reader.is_inside() => {}
            Heard::Whole(frame) => self.frame(link, frame),
            Heard::Alone(DC3) if mutant!("heidenhain-fe.line.hold/ignored") => {}
            Heard::Alone(DC3) => {
                if mutant!("heidenhain-fe.line.close/hold-kept") {
                    HELD_BEFORE.store(true, Ordering::Relaxed);
                }
                self.line.hold(link);
            }
            Heard::Alone(DC1) => self.line.release(link),
            Heard::Alone(ACK) => self.acknowledged(link),
            Heard::Alone(NAK) => self.refused(link),
            Heard::Alone(ETX) => self.receiver.at_end(),
            Heard::Alone(EOT) => self.ended(link),
            Heard::Alone(_) if mutant!("heidenhain-fe.line.noise/ends-it") => {
                self.ended(link);
            }
            Heard::Alone(_) | Heard::Inside => {}
        }
    }

    /// A header or block has come, or what is left of one.
    fn frame(&mut self, link: &mut Context<'_>, frame: Frame) {
        self.line.cancel(link, Timer::Character);
        if frame.begin == SOH {
            if !frame.is_good {
                // Of a transfer that is under way, a header is no part.
                let is_silent = mutant!("heidenhain-fe.rx.bad-header/not-answered");
                if !self.stage.is_sending() && !is_silent {
                    say(link, &self.settings, NAK);
                }
            } else if self.stage.is_sending() {
                if mutant!("heidenhain-fe.tx.header-between/ignored") {
                    return;
                }
                self.has_header = true;
                self.stop(link, Failure::PartnerReset);
            } else {
                self.header(link);
            }
        } else if self.stage != Stage::Receiving {
            // Nobody waits for a block: a control that sends one is told that it is over.
            let is_silent = mutant!("heidenhain-fe.rx.stray-block/not-answered");
            if frame.is_good && !self.stage.is_sending() && !is_silent {
                say(link, &self.settings, EOT);
            }
        } else if frame.is_good {
            self.accept(link);
        } else if self.receiver.refuses(self.settings.repeats) {
            say(link, &self.settings, NAK);
        } else {
            self.end_reception(link, Some(Failure::Checksum));
            say(link, &self.settings, EOT);
        }
    }

    /// A good header: what came before it is over.
    fn header(&mut self, link: &mut Context<'_>) {
        let is_failure = !mutant!("heidenhain-fe.rx.new-header/ends-well");
        self.end_reception(link, is_failure.then_some(Failure::PartnerReset));
        self.withdraw(link);
        if mutant!("heidenhain-fe.rx.several/refused") && self.receiver.has_had() {
            say(link, &self.settings, NAK);
            return;
        }
        let text = self.reader.text();
        let (Some((kind, rest)), Some(mode)) = (text.split_first(), text.last()) else {
            say(link, &self.settings, NAK);
            return;
        };
        let name = rest.get(..rest.len().saturating_sub(1)).unwrap_or_default();
        match mode {
            b'A' if !rest.is_empty() => {
                self.receiver.begin(link, name);
                self.stage = Stage::Receiving;
                if !mutant!("heidenhain-fe.rx.header/not-answered") {
                    say(link, &self.settings, ACK);
                }
            }
            b'E' if !rest.is_empty() => {
                self.asked.clear();
                for byte in name {
                    self.asked.push(*byte);
                }
                if self.sender.is_waiting() {
                    self.supply(link);
                } else {
                    self.request(link, *kind);
                }
            }
            _ => say(link, &self.settings, NAK),
        }
    }

    fn request(&mut self, link: &mut Context<'_>, kind: u8) {
        let mut buffer = [0; 300];
        let mut fields = ValueWriter::new(&mut buffer);
        // Both fit: a header has at most 242 characters.
        if !mutant!("heidenhain-fe.tx.ask-host/name-missing") {
            let _ = fields.push_ascii(NAME, self.asked.as_slice());
        }
        let _ = fields.push_ascii(KIND, &[kind]);
        self.request = self.request.wrapping_add(1).max(1);
        link.request(self.request, 0, Values::new(fields.written()));
        self.stage = Stage::Asking;
    }

    /// The job that is there goes to the control, if it is what it asked for.
    fn supply(&mut self, link: &mut Context<'_>) {
        if !self.sender.fits(self.asked.as_slice()) {
            link.note(NoteLevel::Warning, 0, "the control asks for another program");
            self.refuse(link);
            return;
        }
        self.line.cancel(link, Timer::Job);
        say(link, &self.settings, ACK);
        self.stage = Stage::Filling;
        self.go_on(link);
    }

    /// The control does not get what it asked for.
    fn refuse(&mut self, link: &mut Context<'_>) {
        self.await_control(link);
        self.stage = Stage::Idle;
        if !mutant!("heidenhain-fe.tx.refused/control-not-told") {
            say(link, &self.settings, EOT);
        }
    }

    /// A job waits until the control asks for it, if there is one.
    fn await_control(&mut self, link: &mut Context<'_>) {
        let is_timed =
            self.settings.request_time > 0 && !mutant!("heidenhain-fe.tx.request-time/never");
        if self.sender.is_waiting() && is_timed {
            self.line.set_after(link, Timer::Job, self.settings.request_time);
        } else {
            self.line.cancel(link, Timer::Job);
        }
    }

    /// A job that nobody asked for, or a program that was granted and did not come.
    fn too_late(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Granted {
            link.note(NoteLevel::Warning, 0, "the program that was granted did not come");
            self.refuse(link);
        } else {
            self.sender.fail(link, Failure::NoAnswer);
        }
    }

    fn withdraw(&mut self, link: &mut Context<'_>) {
        match self.stage {
            Stage::Asking if mutant!("heidenhain-fe.tx.withdrawn/kept") => {}
            Stage::Asking => link.withdraw(self.request),
            Stage::Granted => self.line.cancel(link, Timer::Job),
            _ => return,
        }
        self.stage = Stage::Idle;
    }

    /// Sends the next block, or the end, as far as there is all that it needs.
    fn go_on(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::Filling {
            self.stage = self.sender.next(link, &self.settings);
        }
    }

    fn acknowledged(&mut self, link: &mut Context<'_>) {
        // An answer that comes before the block can have left is none.
        if self.stage == Stage::Answer && self.sender.has_left() {
            self.line.cancel(link, Timer::Answer);
            self.sender.acknowledged();
            self.stage = Stage::Filling;
            self.go_on(link);
        }
    }

    fn refused(&mut self, link: &mut Context<'_>) {
        if self.stage != Stage::Answer || !self.sender.has_left() {
            return;
        }
        self.line.cancel(link, Timer::Answer);
        if mutant!("heidenhain-fe.tx.repeat/next-block") {
            self.sender.acknowledged();
            self.stage = Stage::Filling;
            self.go_on(link);
            return;
        }
        if self.sender.repeats(self.settings.repeats) {
            self.stage = Stage::Filling;
            self.go_on(link);
        } else {
            self.stop(link, Failure::AttemptsUsedUp);
        }
    }

    /// EOT: the control ends what is under way.
    fn ended(&mut self, link: &mut Context<'_>) {
        match self.stage {
            Stage::Filling | Stage::Answer if mutant!("heidenhain-fe.tx.partner-ends/ignored") => {}
            Stage::Filling | Stage::Answer => self.stop(link, Failure::Refused),
            Stage::Receiving | Stage::Waiting => {
                let is_whole = self.receiver.is_whole();
                self.end_reception(link, (!is_whole).then_some(Failure::NoEndMark));
            }
            Stage::Asking | Stage::Granted => self.withdraw(link),
            Stage::Idle | Stage::Ending | Stage::Stopping(_) => {}
        }
    }

    /// Ends the job on the line as soon as it is known how much of it has left.
    fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        if matches!(self.stage, Stage::Filling | Stage::Answer | Stage::Ending) {
            self.line.cancel(link, Timer::Answer);
            link.discard();
            self.stage = Stage::Stopping(failure);
        }
    }

    /// Whatever is under way with the control ends.
    fn give_up(&mut self, link: &mut Context<'_>, failure: Failure) {
        self.end_reception(link, Some(failure));
        self.withdraw(link);
        self.stop(link, failure);
        if !self.stage.is_sending() {
            self.line.cancel(link, Timer::Job);
        }
    }

    /// A good block is put away and acknowledged, or waits until there is room.
    fn accept(&mut self, link: &mut Context<'_>) {
        let is_taken = self.receiver.take(link, &self.settings, self.reader.text());
        if is_taken || mutant!("heidenhain-fe.rx.room/answered-and-lost") {
            self.stage = Stage::Receiving;
            if !mutant!("heidenhain-fe.rx.block/not-answered") {
                say(link, &self.settings, ACK);
            }
        } else {
            self.stage = Stage::Waiting;
        }
    }

    fn end_reception(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        if self.stage.is_receiving() {
            self.receiver.end(link, failure);
            self.stage = Stage::Idle;
        }
    }

    /// Silence in a frame, and between two blocks.
    fn watch(&mut self, link: &mut Context<'_>) {
        if self.reader.is_inside() {
            self.line.cancel(link, Timer::Block);
            if !mutant!("heidenhain-fe.line.cut-off/never") {
                self.line.set_after(link, Timer::Character, self.settings.character_time);
            }
            return;
        }
        self.line.cancel(link, Timer::Character);
        let is_timed = self.settings.block_time > 0 && !mutant!("heidenhain-fe.rx.silence/never");
        if self.stage == Stage::Receiving && is_timed {
            self.line.set_after(link, Timer::Block, self.settings.block_time);
        } else {
            self.line.cancel(link, Timer::Block);
        }
    }

    fn name_state(&mut self, link: &mut Context<'_>) {
        let state = match self.stage {
            Stage::Stopping(_) => "stopping",
            Stage::Filling | Stage::Answer | Stage::Ending if self.line.is_held() => "held",
            Stage::Filling if self.sender.is_paused => "paused",
            Stage::Filling | Stage::Answer | Stage::Ending => "sending",
            Stage::Receiving => "receiving",
            Stage::Waiting => "receiving, no room",
            Stage::Asking => "asking for a program",
            Stage::Granted => "waiting for the program",
            Stage::Idle if self.sender.is_checking() => "checking",
            Stage::Idle if self.sender.is_waiting() => "waiting for the control",
            Stage::Idle => "idle",
        };
        if self.named != Some(state) {
            self.named = Some(state);
            link.state(state);
        }
    }
}

/// The name in a job's fields.
fn name_of<'a>(fields: &Values<'a>, index: u16) -> Option<&'a str> {
    match fields.find(index) {
        Some(Value::Text(name)) => Some(name),
        _ => None,
    }
}
