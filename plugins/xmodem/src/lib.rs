//! XMODEM: files in numbered blocks with checksum or CRC, each answered by ACK or NAK. The
//! receiver begins, with its call.
//!
//! The protocol's page is `docs/protocols/xmodem.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod block;
mod line;
mod receiver;
mod receiving;
mod sender;
mod sending;
mod settings;
mod stage;

pub use settings::{Mode, Padding, Settings};

use block::{CALL, CAN, LONG, NAK};
use line::{Line, Timer};
use receiver::Receiver;
use sender::Sender;
use softplug_plugin::{
    Context, Converter, Failure, JobStart, LineErrorKind, LinkDownReason, MarkState, Micros,
    NoteLevel, Opening, StateError, StateReader, StateWriter, Unread,
};
use stage::Stage;

/// What tells the partner that it is over: two would do.
const CANCEL: &[u8] = &[CAN; 8];
/// What one character can bring of actions: a block that is delivered with the padding of the
/// one before, or a block that is sent; their records; an end of a transfer and a name.
const OUTPUT_RESERVE: usize = 3 * LONG;

/// The converter.
#[derive(Debug)]
pub struct Xmodem {
    settings: Settings,
    stage: Stage,
    line: Line,
    sender: Sender,
    receiver: Receiver,
    /// The host takes deliveries: it has told of room for them.
    takes: bool,
    /// A character of the line has fewer than eight bits.
    is_narrow: bool,
    /// The port is gone.
    is_down: bool,
    named: Option<&'static str>,
    unread: Unread,
}

softplug_plugin::export!(Xmodem);

impl Converter for Xmodem {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;
    const STATE_FORMAT: Option<u16> = Some(1);

    fn new(settings: Settings) -> Self {
        Self {
            settings,
            stage: Stage::default(),
            line: Line::default(),
            sender: Sender::new(0),
            receiver: Receiver::new(),
            takes: true,
            is_narrow: false,
            is_down: false,
            named: None,
            unread: Unread::new(),
        }
    }

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        self.is_narrow = opening.line.data_bits < 8;
        if opening.resumed {
            self.takes |= opening.delivery_room > 0;
            self.line.set_timers(link);
            // Rooms are told anew: what has grown meanwhile is not told again.
            self.has_transmit_room(link);
            self.has_delivery_room(link);
        } else {
            self.takes = opening.delivery_room > 0;
            if self.is_narrow {
                link.note(NoteLevel::Warning, 0, "XMODEM needs a line with eight data bits");
            }
            self.begin_calling(link);
        }
        self.name_state(link);
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
        self.name_state(link);
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
        self.name_state(link);
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
        self.line.forget_owed();
        self.stage = Stage::Idle;
        self.line.cancel(link, Timer::Transfer);
        self.line.cancel(link, Timer::Request);
        self.name_state(link);
    }

    fn link_up(&mut self, link: &mut Context<'_>) {
        self.is_down = false;
        self.begin_calling(link);
        self.name_state(link);
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        match Timer::from_id(id) {
            Some(Timer::Transfer) => {
                self.line.ran_out(Timer::Transfer);
                if self.stage.is_sending() {
                    self.no_answer(link);
                } else {
                    self.silence(link);
                }
            }
            Some(Timer::Request) => {
                self.line.ran_out(Timer::Request);
                self.sender.fail(link, Failure::NoAnswer);
                if self.stage == Stage::Idle {
                    self.rest(link);
                }
            }
            None => {}
        }
        self.name_state(link);
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: u32, state: MarkState) {
        if self.sender.left(mark, state)
            && state == MarkState::SurelyLeft
            && self.stage.is_sending()
        {
            self.has_left(link);
        }
        self.name_state(link);
    }

    fn transmit_room(&mut self, link: &mut Context<'_>) {
        self.has_transmit_room(link);
        self.name_state(link);
    }

    fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        self.line.pay(link);
        let Some(failure) = self.sender.stopping else { return };
        self.sender.dropped(bytes);
        self.sender.fail(link, failure);
        self.name_state(link);
    }

    fn delivery_room(&mut self, link: &mut Context<'_>) {
        let is_first = !core::mem::replace(&mut self.takes, true);
        self.has_delivery_room(link);
        if is_first && self.stage == Stage::Idle && !self.line.is_set(Timer::Transfer) {
            self.begin_calling(link);
        }
        self.name_state(link);
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        if self.is_narrow {
            link.job_failed(job.job, Failure::NotSupported, 0, 0);
        } else if self.sender.begin(link, &job) {
            // Who calls cannot be called.
            if self.stage == Stage::Calling {
                self.stage = Stage::Idle;
                self.line.cancel(link, Timer::Transfer);
            }
            if self.settings.request_time > 0 {
                self.line.set_after(link, Timer::Request, self.settings.request_time);
            }
        }
        self.name_state(link);
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: u32, bytes: &[u8]) {
        self.sender.data(bytes);
        self.go_on(link);
        self.name_state(link);
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: u32) {
        self.sender.data_ended();
        self.go_on(link);
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
            self.cancel_reception(link);
        } else {
            self.abort_job(link);
        }
        self.name_state(link);
    }

    fn save(&self, state: &mut StateWriter<'_>) {
        self.stage.save(state);
        self.line.save(state);
        self.sender.save(state);
        self.receiver.save(state);
        state.bool(self.takes);
        state.bool(self.is_down);
    }

    fn restore(&mut self, format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
        if format != 1 {
            return Err(StateError::DAMAGED);
        }
        self.stage = Stage::restore(state)?;
        self.line = Line::restore(state)?;
        self.sender = Sender::restore(state)?;
        self.receiver = Receiver::restore(state)?;
        self.takes = state.bool();
        self.is_down = state.bool();
        Ok(())
    }
}

impl Xmodem {
    fn has_transmit_room(&mut self, link: &mut Context<'_>) {
        self.line.pay(link);
        self.go_on(link);
    }

    fn has_delivery_room(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::NoRoom {
            self.put_away(link);
        }
    }

    fn name_state(&mut self, link: &mut Context<'_>) {
        let state = match self.stage {
            Stage::Filling if self.sender.is_paused => "paused",
            stage if stage.is_sending() => "sending",
            Stage::NoRoom => "receiving, no room",
            Stage::Calling => "calling",
            stage if stage.is_receiving() => "receiving",
            _ if self.sender.is_waiting() => "waiting for the receiver",
            _ => "idle",
        };
        if self.named != Some(state) {
            self.named = Some(state);
            link.state(state);
        }
    }
}
