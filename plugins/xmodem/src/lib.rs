//! XMODEM: files in numbered blocks with checksum or CRC, each answered by ACK or NAK. The
//! receiver begins, with its call.
//!
//! The protocol's page is `docs/protocols/xmodem.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod block;
mod receiver;
mod receiving;
mod sender;
mod sending;
mod settings;
mod stage;

pub use settings::{Mode, Padding, Settings};

use block::{CALL, CAN, LONG, NAK};
use receiver::Receiver;
use sender::Sender;
use softplug_plugin::parts::{Answers, StateName, TimerName, Timers};
use softplug_plugin::{
    Context, Converter, Failure, JobId, JobStart, LineErrorKind, LinkDownReason, MarkId, MarkState,
    Micros, NoteLevel, Opening, State, Unread, parts, state_format, timers,
};
use stage::Stage;

/// What tells the partner that it is over: two would do.
const CANCEL: &[u8] = &[CAN; 8];
/// What one character can bring of actions: a block that is delivered with the padding of the
/// one before, or a block that is sent; their records; an end of a transfer and a name.
const OUTPUT_RESERVE: usize = 3 * LONG;

timers! {
    /// What time is kept for.
    pub(crate) enum Timer {
        /// The transfer: the next call, block, character or answer, or a clear line.
        Transfer,
        /// The call for a job.
        Request,
    }
}

/// The converter.
#[derive(Debug, State)]
pub struct Xmodem {
    #[state(skip)]
    settings: Settings,
    stage: Stage,
    timers: Timers<Timer, 2>,
    answers: Answers<16>,
    sender: Sender,
    receiver: Receiver,
    /// The host takes deliveries: it has told of room for them.
    takes: bool,
    /// The port is gone.
    is_down: bool,
    /// A character of the line has fewer than eight bits.
    #[state(skip)]
    is_narrow: bool,
    #[state(skip)]
    name: StateName,
    #[state(skip)]
    unread: Unread,
}

softplug_plugin::export!(Xmodem);

impl Converter for Xmodem {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;

    fn new(settings: Settings) -> Self {
        Self {
            settings,
            stage: Stage::default(),
            timers: Timers::new(),
            answers: Answers::new(),
            sender: Sender::new(MarkId::NONE),
            receiver: Receiver::new(),
            takes: true,
            is_down: false,
            is_narrow: false,
            name: StateName::new(),
            unread: Unread::new(),
        }
    }

    parts!(timers, answers);

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        self.is_narrow = opening.line.data_bits < 8;
        if opening.resumed {
            self.takes |= opening.delivery_room > 0;
            // Rooms are told anew: what has grown meanwhile is not told again.
            self.go_on(link);
            self.has_delivery_room(link);
        } else {
            self.takes = opening.delivery_room > 0;
            if self.is_narrow {
                link.note(NoteLevel::Warning, 0, "XMODEM needs a line with eight data bits");
            }
            self.begin_calling(link);
        }
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let mut rest = bytes;
        while let Some((byte, after)) = rest.split_first()
            && link.output_room() >= OUTPUT_RESERVE
        {
            if self.stage.is_sending() {
                self.answered(link, *byte);
            } else if self.stage == Stage::Idle
                && self.sender.is_waiting()
                && matches!(*byte, CALL | NAK)
            {
                self.called(link, *byte);
            } else {
                self.hear(link, *byte);
            }
            rest = after;
        }
        self.unread.keep(link, rest);
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
        link.note(NoteLevel::Warning, u16::from(kind.code()), kind.text());
        if self.stage.is_sending() {
            self.damaged_answer(link);
        } else {
            self.noise(link);
        }
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        if self.stage.is_sending() {
            self.stop(link, Failure::LinkDown);
        } else {
            link.discard();
            self.receiver.end(link, Some(Failure::LinkDown));
            self.sender.fail(link, Failure::LinkDown);
        }
        self.is_down = true;
        self.answers.forget();
        self.stage = Stage::Idle;
        self.timers.cancel(link, Timer::Transfer);
        self.timers.cancel(link, Timer::Request);
    }

    fn link_up(&mut self, link: &mut Context<'_>) {
        self.is_down = false;
        self.begin_calling(link);
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        match Timer::from_id(id) {
            Some(Timer::Transfer) => {
                if self.stage.is_sending() {
                    self.no_answer(link);
                } else {
                    self.silence(link);
                }
            }
            Some(Timer::Request) => {
                self.sender.fail(link, Failure::NoAnswer);
                if self.stage == Stage::Idle {
                    self.rest(link);
                }
            }
            None => {}
        }
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        if self.sender.left(mark, state)
            && state == MarkState::SurelyLeft
            && self.stage.is_sending()
        {
            self.has_left(link);
        }
    }

    fn transmit_room(&mut self, link: &mut Context<'_>) {
        self.go_on(link);
    }

    fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        let Some(failure) = self.sender.stopping else { return };
        self.sender.dropped(bytes);
        self.sender.fail(link, failure);
    }

    fn delivery_room(&mut self, link: &mut Context<'_>) {
        let is_first = !core::mem::replace(&mut self.takes, true);
        self.has_delivery_room(link);
        if is_first && self.stage == Stage::Idle && !self.timers.is_set(Timer::Transfer) {
            self.begin_calling(link);
        }
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        if self.is_narrow {
            link.job_failed(job.job, Failure::NotSupported, 0, 0);
        } else if self.sender.begin(link, &job) {
            // Who calls cannot be called.
            if self.stage == Stage::Calling {
                self.stage = Stage::Idle;
                self.timers.cancel(link, Timer::Transfer);
            }
            if self.settings.request_time > 0 {
                self.timers.set_after(link, Timer::Request, self.settings.request_time);
            }
        }
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: JobId, bytes: &[u8]) {
        self.sender.data(bytes);
        self.go_on(link);
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.sender.data_ended();
        self.go_on(link);
    }

    fn pause(&mut self, _link: &mut Context<'_>, _job: JobId) {
        self.sender.is_paused = true;
    }

    fn resume(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.sender.is_paused = false;
        self.go_on(link);
    }

    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        if job == JobId::NONE {
            self.cancel_reception(link);
        } else {
            self.abort_job(link);
        }
    }

    fn after(&mut self, link: &mut Context<'_>) {
        let name = match self.stage {
            Stage::Filling if self.sender.is_paused => "paused",
            stage if stage.is_sending() => "sending",
            Stage::NoRoom => "receiving, no room",
            Stage::Calling => "calling",
            stage if stage.is_receiving() => "receiving",
            _ if self.sender.is_waiting() => "waiting for the receiver",
            _ => "idle",
        };
        self.name.tell(link, name);
    }

    state_format!(1);
}

impl Xmodem {
    fn has_delivery_room(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::NoRoom {
            self.put_away(link);
        }
    }

    /// One character after the other: what finds no room, not even to wait, is left out.
    fn say_cancel(&mut self, link: &mut Context<'_>) {
        for byte in CANCEL {
            self.answers.say(link, &[*byte]);
        }
    }
}
