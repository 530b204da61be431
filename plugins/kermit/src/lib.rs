//! Kermit: named files in numbered packets, each answered by ACK or NAK, of printable characters
//! alone, so that they pass lines with seven bits too.
//!
//! The protocol's page is `docs/protocols/kermit.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod answers;
mod asking;
mod coding;
mod packet;
mod receiver;
mod receiving;
mod sender;
mod sending;
mod settings;
mod stage;
mod terms;

pub use settings::{EighthBit, Mode, Settings};

use packet::{Heard, Reader};
use receiver::{Receiver, TITLE};
use sender::Sender;
use softplug_plugin::parts::{Answers, Block, StateName, TimerName, Timers};
use softplug_plugin::{
    Context, Converter, Failure, JobId, JobStart, LineErrorKind, LinkDownReason, MarkId, MarkState,
    Micros, NoteLevel, Opening, RequestId, State, Unread, parts, state_format, timers,
};
use stage::Stage;
use terms::Terms;

/// What one character can bring of actions: data that is delivered, a packet that is sent, their
/// records, an end of a transfer, a note and a name.
const OUTPUT_RESERVE: usize = 2_560;
/// Packets that are answered in one event; the others of it wait for another round.
const PACKETS_AT_A_TIME: u32 = 16;

/// Characters of answers that may wait for room.
const OWED: usize = 160;

timers! {
    /// What time is kept for.
    pub(crate) enum Timer {
        /// The transfer: the next packet, character or answer.
        Transfer,
        /// The answer to the first packet of a job, or the job that was granted.
        Begin,
    }
}

/// The converter.
#[derive(Debug, State)]
pub struct Kermit {
    #[state(skip)]
    settings: Settings,
    stage: Stage,
    reader: Reader,
    terms: Terms,
    timers: Timers<Timer, 2>,
    answers: Answers<OWED>,
    sender: Sender,
    receiver: Receiver,
    /// The latest request, and whether the host has not answered it.
    request: RequestId,
    is_asking: bool,
    /// What it asks for.
    asked_for: Block<TITLE>,
    /// The host takes deliveries: it has told of room for them.
    takes: bool,
    /// A character of the line has fewer than eight bits.
    #[state(skip)]
    is_narrow: bool,
    #[state(skip)]
    name: StateName,
    #[state(skip)]
    unread: Unread,
}

softplug_plugin::export!(Kermit);

impl Converter for Kermit {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;

    fn new(settings: Settings) -> Self {
        Self {
            settings,
            stage: Stage::default(),
            reader: Reader::new(),
            terms: Terms::usual(),
            timers: Timers::new(),
            answers: Answers::new(),
            sender: Sender::new(MarkId::NONE),
            receiver: Receiver::new(),
            request: RequestId::NONE,
            is_asking: false,
            asked_for: Block::new(),
            takes: true,
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
        }
    }

    fn closed(&mut self, link: &mut Context<'_>) {
        self.receiver.end_whole(link);
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let mut rest = bytes;
        let (mut is_part, mut packets) = (false, 0);
        while let Some((byte, after)) = rest.split_first()
            && link.output_room() >= OUTPUT_RESERVE
            && !self.is_delivering(link)
            && packets < PACKETS_AT_A_TIME
        {
            let was_inside = self.reader.is_inside();
            is_part = self.character(link, *byte);
            packets += u32::from(was_inside && !is_part);
            rest = after;
            if is_part {
                rest = self.reader.pass_over(rest);
            }
        }
        if is_part {
            self.watch_inside(link);
        }
        self.unread.keep(link, rest);
    }

    fn more(&mut self, link: &mut Context<'_>) {
        self.has_delivery_room(link);
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
        if self.stage != Stage::NoRoom {
            self.reader.spoil();
            self.watch_inside(link);
        }
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.reader.forget();
        self.withdraw(link);
        if self.stage.is_sending() {
            self.stop(link, Failure::LinkDown);
        } else {
            link.discard();
            self.sender.fail(link, Failure::LinkDown);
        }
        self.end_reception(link, Some(Failure::LinkDown));
        self.timers.cancel(link, Timer::Begin);
        self.answers.forget();
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        match Timer::from_id(id) {
            Some(Timer::Transfer) => {
                self.silence(link);
            }
            Some(Timer::Begin) => {
                self.too_late(link);
            }
            None => {}
        }
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        if self.sender.left(mark, state)
            && state == MarkState::SurelyLeft
            && self.stage == Stage::Answer
        {
            self.watch(link);
            self.watch_inside(link);
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
        self.takes = true;
        self.has_delivery_room(link);
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        if self.sender.begin(link, &job) {
            self.start_waiting(link);
        }
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: JobId, bytes: &[u8]) {
        self.sender.data(bytes, &self.settings);
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

    fn answer(
        &mut self,
        link: &mut Context<'_>,
        request: RequestId,
        answer: Result<&[u8], Failure>,
        more: bool,
    ) {
        if request == self.request && self.is_asking && !more {
            self.answer_to(link, answer.err());
        }
    }

    fn after(&mut self, link: &mut Context<'_>) {
        let name = match self.stage {
            Stage::Filling if self.sender.is_paused => "paused",
            stage if stage.is_sending() && self.sender.kind == b'S' => "waiting for the receiver",
            stage if stage.is_sending() => "sending",
            Stage::NoRoom => "receiving, no room",
            stage if stage.is_receiving() => "receiving",
            _ if self.is_asking => "asking for a program",
            _ => "idle",
        };
        self.name.tell(link, name);
    }

    state_format!(2);
}

impl Kermit {
    /// Returns whether there is more to come of the packet that it belongs to.
    fn character(&mut self, link: &mut Context<'_>, byte: u8) -> bool {
        // What waits for room is kept in the reader.
        if self.stage == Stage::NoRoom {
            return false;
        }
        let check = self.terms.check;
        let ended = self.receiver.ended.0.map_or(check, |(_, terms)| terms.check);
        let heard = self.reader.take(byte, |kind| match kind {
            b'S' | b'I' | b'R' | b'G' | b'C' | b'K' => 1,
            b'B' => ended,
            _ => check,
        });
        match heard {
            Heard::Outside => {}
            Heard::Part => return true,
            Heard::Good if self.stage.is_sending() => self.answered(link),
            Heard::Good => self.hear(link),
            Heard::Bad => self.damaged(link),
        }
        false
    }

    /// What was heard is no good packet.
    fn damaged(&mut self, link: &mut Context<'_>) {
        match self.stage {
            Stage::AwaitFile | Stage::AwaitData => self.refuse(link, Failure::Checksum),
            Stage::Answer if self.sender.has_left() => self.again(link, Failure::AttemptsUsedUp),
            _ => {}
        }
    }

    /// Time has run out.
    fn silence(&mut self, link: &mut Context<'_>) {
        if self.reader.is_inside() {
            self.reader.forget();
            self.damaged(link);
            return;
        }
        match self.stage {
            Stage::AwaitFile | Stage::AwaitData => self.refuse(link, Failure::NoAnswer),
            Stage::Answer => self.again(link, Failure::NoAnswer),
            _ => {}
        }
    }

    /// Silence counts from here, outside a packet.
    fn watch(&mut self, link: &mut Context<'_>) {
        match self.stage {
            Stage::AwaitFile | Stage::AwaitData => {
                self.timers.set_after(link, Timer::Transfer, self.settings.packet_time);
            }
            Stage::Answer if self.sender.has_left() => {
                self.timers.set_after(link, Timer::Transfer, self.settings.answer_time);
            }
            _ => self.timers.cancel(link, Timer::Transfer),
        }
    }

    /// And from here inside one.
    fn watch_inside(&mut self, link: &mut Context<'_>) {
        let is_timed = match self.stage {
            Stage::AwaitFile | Stage::AwaitData => true,
            Stage::Answer => self.sender.has_left(),
            _ => false,
        };
        if is_timed && self.reader.is_inside() {
            self.timers.set_after(link, Timer::Transfer, self.settings.character_time);
        }
    }

    /// Whether data is on its way to the host, for which it has room.
    fn is_delivering(&self, link: &Context<'_>) -> bool {
        self.stage == Stage::NoRoom && link.delivery_room() > 0
    }

    fn has_delivery_room(&mut self, link: &mut Context<'_>) {
        if self.stage == Stage::NoRoom {
            self.put_away(link);
        }
    }
}
