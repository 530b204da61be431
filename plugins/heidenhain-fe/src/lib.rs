//! Heidenhain blockwise transfer (FE1 mode): lines in blocks with a check character, each
//! answered by ACK or NAK; the control asks for programs and sends them.
//!
//! The protocol's page is `docs/protocols/heidenhain-fe.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod dialogue;
mod frame;
mod line;
mod receiver;
mod sender;
mod settings;
mod stage;

pub use settings::{LineEnd, Parity, Settings};

use frame::{EOT, Reader, Text};
use line::heard;
use receiver::Receiver;
use sender::Sender;
use softplug_plugin::parts::{Answers, StateName, TimerName, Timers};
use softplug_plugin::{
    Context, Converter, Failure, JobId, JobStart, LineErrorKind, LinkDownReason, MarkId, MarkState,
    Micros, NoteLevel, Opening, RequestId, State, Unread, Value, Values, parts, state_format,
    timers,
};
use stage::Stage;

/// The field of a job, and of a request, with the program's name.
const NAME: u16 = 0;
/// What one character can bring of actions, and what follows the last one of an event: the end
/// of a reception and of a job, a note, and a request with its name or a line that is delivered.
const OUTPUT_RESERVE: usize = 1_024;

timers! {
    /// What time is kept for.
    pub(crate) enum Timer {
        /// Silence inside a frame.
        Character,
        /// The answer to a block.
        Answer,
        /// The next block.
        Block,
        /// The job for a request, or the request for a job.
        Job,
    }
}

/// The converter.
#[derive(Debug, State)]
pub struct HeidenhainFe {
    #[state(skip)]
    settings: Settings,
    stage: Stage,
    reader: Reader,
    /// The control holds the line.
    is_held: bool,
    timers: Timers<Timer, 4>,
    answers: Answers<16>,
    sender: Sender,
    receiver: Receiver,
    /// The request that the host has not answered.
    request: RequestId,
    /// The host takes deliveries: it has told of room for them.
    takes: bool,
    /// The name that the control asks for.
    asked: Text,
    #[state(skip)]
    name: StateName,
    #[state(skip)]
    unread: Unread,
}

softplug_plugin::export!(HeidenhainFe);

impl Converter for HeidenhainFe {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;

    fn new(settings: Settings) -> Self {
        Self {
            settings,
            stage: Stage::default(),
            reader: Reader::default(),
            is_held: false,
            timers: Timers::new(),
            answers: Answers::new(),
            sender: Sender::default(),
            receiver: Receiver::default(),
            request: RequestId::NONE,
            takes: true,
            asked: Text::default(),
            name: StateName::new(),
            unread: Unread::new(),
        }
    }

    parts!(timers, answers, sender.job);

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        if opening.resumed {
            self.takes |= opening.delivery_room > 0;
            // Rooms are told anew: what has grown meanwhile is not told again.
            self.go_on(link);
            self.has_delivery_room(link);
        } else {
            self.takes = opening.delivery_room > 0;
        }
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let mut rest = bytes;
        while let Some((byte, after)) = rest.split_first()
            && link.output_room() >= OUTPUT_RESERVE
        {
            match heard(&self.settings, *byte) {
                Some(byte) => self.character(link, byte),
                None => self.reader.damage(),
            }
            rest = after;
        }
        self.unread.keep(link, rest);
        self.watch(link);
    }

    fn more(&mut self, link: &mut Context<'_>) {
        let unread = self.unread;
        self.received(link, unread.bytes());
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
        self.give_up(link, Failure::LinkDown);
        // How much of a job on the line has left is told at once.
        if self.sender.job.is_active() {
            self.sender.job.fail(link, Failure::LinkDown);
        }
        self.end_watch(link);
    }

    fn link_up(&mut self, link: &mut Context<'_>) {
        self.release(link);
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        match Timer::from_id(id) {
            Some(Timer::Character) => {
                let frame = self.reader.cut_off();
                self.frame(link, frame);
                self.watch(link);
            }
            Some(Timer::Answer) => {
                self.stop(link, Failure::NoAnswer);
            }
            Some(Timer::Block) => {
                self.end_reception(link, Some(Failure::NoAnswer));
                self.say(link, EOT);
            }
            Some(Timer::Job) => {
                self.too_late(link);
            }
            None => {}
        }
        self.end_watch(link);
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        if self.sender.job.is_latest(mark) && state == MarkState::SurelyLeft {
            match self.stage {
                Stage::Answer => {
                    self.timers.set_after(link, Timer::Answer, self.settings.answer_time);
                }
                Stage::Ending => {
                    self.stage = Stage::Idle;
                    self.sender.job.done(link);
                }
                _ => {}
            }
        }
        self.go_on(link);
    }

    fn transmit_room(&mut self, link: &mut Context<'_>) {
        self.go_on(link);
    }

    fn delivery_room(&mut self, link: &mut Context<'_>) {
        self.takes = true;
        self.has_delivery_room(link);
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        if !self.sender.begin(link, &job, NAME) {
            return;
        }
        if self.sender.is_checking() {
            self.sender.want(link);
        } else if self.stage == Stage::Granted {
            self.supply(link);
        } else {
            self.await_control(link);
        }
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: JobId, _bytes: &[u8]) {
        if self.sender.is_checking() {
            self.sender.check(link, &self.settings);
        } else {
            self.go_on(link);
        }
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: JobId) {
        if self.sender.is_checking() {
            self.sender.checked(link);
        } else {
            self.go_on(link);
        }
    }

    fn resume(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.go_on(link);
    }

    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        if job == JobId::NONE {
            if self.stage.is_receiving() {
                self.end_reception(link, Some(Failure::Aborted));
                self.say(link, EOT);
            }
        } else if self.stage.is_sending() {
            self.stop(link, Failure::Aborted);
        } else {
            // A grant waits on for another job.
            if self.stage != Stage::Granted {
                self.timers.cancel(link, Timer::Job);
            }
            self.sender.job.fail(link, Failure::Aborted);
        }
        self.end_watch(link);
    }

    fn force_resume(&mut self, link: &mut Context<'_>) {
        self.release(link);
    }

    fn answer(
        &mut self,
        link: &mut Context<'_>,
        request: RequestId,
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
                self.timers.set_after(link, Timer::Job, self.settings.job_time);
            }
            Err(failure) => {
                link.note(NoteLevel::Warning, failure.code(), "the program was refused");
                self.refuse(link);
            }
        }
    }

    fn after(&mut self, link: &mut Context<'_>) {
        let name = match self.stage {
            Stage::Filling | Stage::Answer | Stage::Ending if self.is_held => "held",
            Stage::Filling if self.sender.job.is_paused() => "paused",
            Stage::Filling | Stage::Answer | Stage::Ending => "sending",
            Stage::Receiving => "receiving",
            Stage::Waiting => "receiving, no room",
            Stage::Asking => "asking for a program",
            Stage::Granted => "waiting for the program",
            Stage::Idle if self.sender.is_checking() => "checking",
            Stage::Idle if self.sender.is_waiting() => "waiting for the control",
            Stage::Idle => "idle",
        };
        self.name.tell(link, name);
    }

    state_format!(5);
}

/// The name in a job's fields.
fn name_of<'a>(fields: &Values<'a>, index: u16) -> Option<&'a str> {
    match fields.find(index) {
        Some(Value::Text(name)) => Some(name),
        _ => None,
    }
}
