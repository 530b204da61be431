//! DF1 of Allen-Bradley, full duplex: messages in frames with a check, each answered by DLE ACK or
//! DLE NAK, both ways at once. An example of a protocol that is made of the SDK's parts.
//!
//! The facts are those of Allen-Bradley's publication 1770-6.5.16, chapters 2 and 4: the symbols (2-6, 2-8), BCC and
//! CRC, repeats after DLE NAK, DLE ENQ after silence, the last answer once more after DLE ENQ, embedded
//! answers, and messages that come twice. What it leaves open, or what is otherwise here, is a decision:
//!
//! - A job is one message of the application layer, from DST to the last byte of data: 6 to 250 bytes.
//! - DLE NAK is sent as 10 0F, as the publication has it; 10 15, which later manuals print, is taken for it too.
//! - A message for which the host has no room is answered by DLE NAK at once: the partner repeats it.
//! - A job that is aborted in the middle of its frame leaves a frame without an end, which the next one replaces.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod frame;

use frame::{ACK, DLE, ENQ, Frame, Heard, MOST, NAK, Reader};
use softplug_plugin::parts::{Answers, BlockSender, StateName, TimerName, Timers};
use softplug_plugin::{
    Context, Converter, DeliveryId, Failure, JobId, JobStart, LineErrorKind, LinkDownReason,
    MarkId, MarkState, Micros, NoteLevel, State, Unread, choice, manifest, parts, settings,
    state_format, timers,
};

/// The least bytes of a message: DST, SRC, CMD, STS and TNS.
const LEAST: usize = 6;
/// What one character can bring of actions: a message that is delivered, its records and answer.
const OUTPUT_RESERVE: usize = 512;

choice! {
    /// The check behind a message.
    pub enum Check { Bcc = "bcc", Crc = "crc" }
}

settings! {
    /// The settings.
    pub struct Settings {
        check: Check = "bcc", "The check behind a message: the sum's complement, or CRC-16.";
        ack_time: i64 = 1000 in 20..=600000 "ms", "Time for the answer to a message that has left.";
        naks: i64 = 3 in 0..=255 "", "How often a message that was refused is sent again.";
        enquiries: i64 = 3 in 0..=255 "", "How often an answer that does not come is asked for.";
        duplicates: bool = true, "A message that has come before is acknowledged and not delivered again.";
    }
}

timers! {
    enum Timer {
        /// The answer to a message.
        Answer,
    }
}

/// What a job is at.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
enum Stage {
    /// Its data comes.
    #[default]
    Filling,
    /// Its frame is given to the link.
    Sending,
    /// The frame has been given; its answer is awaited.
    Answer,
}

/// The converter.
#[derive(Debug, State)]
pub struct Df1 {
    #[state(skip)]
    settings: Settings,
    timers: Timers<Timer, 1>,
    answers: Answers<32>,
    stage: Stage,
    /// The message of the job; one byte more shows that it is too long.
    sender: BlockSender<{ MOST + 1 }>,
    frame: Frame,
    enquiries: u32,
    reader: Reader,
    /// What was answered last: ACK or NAK.
    last: u8,
    /// SRC, CMD and TNS of the message that was delivered last, if there was one.
    taken: [u8; 4],
    has_taken: bool,
    delivery: DeliveryId,
    #[state(skip)]
    name: StateName,
    #[state(skip)]
    unread: Unread,
}

softplug_plugin::export!(Df1);

impl Converter for Df1 {
    type Settings = Settings;
    const MANIFEST: &'static str = manifest! {
        head: r#""abi": "1.1", "name": "df1", "version": "1.0.0", "licence": "MIT OR Apache-2.0",
            "protocol": "Allen-Bradley DF1", "description": "Messages in frames, full duplex.""#,
        settings: Settings,
        tail: concat!(
            r#""jobs": [{"name": "send", "text": "Sends a message."}], "line": "19200 8N1", "#,
            r#""needs": {"line_errors": "used"}, "state": {"saves": 1, "accepts": [1]}"#,
        ),
    };

    fn new(settings: Settings) -> Self {
        Self {
            settings,
            timers: Timers::new(),
            answers: Answers::new(),
            stage: Stage::Filling,
            sender: BlockSender::new(),
            frame: Frame::new(),
            enquiries: 0,
            reader: Reader::new(),
            last: NAK,
            taken: [0; 4],
            has_taken: false,
            delivery: DeliveryId::NONE,
            name: StateName::new(),
            unread: Unread::new(),
        }
    }

    parts!(timers, answers, sender);

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let rest = link.each_byte(bytes, OUTPUT_RESERVE, |link, byte| self.hear(link, byte));
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
        self.reader.damage();
        self.last = NAK;
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.timers.cancel(link, Timer::Answer);
        self.answers.forget();
        self.reader = Reader::new();
        if self.sender.is_active() {
            self.sender.stop(link, Failure::LinkDown);
        } else {
            link.discard();
        }
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        if Timer::from_id(id) != Some(Timer::Answer) || self.stage != Stage::Answer {
            return;
        }
        self.enquiries += 1;
        if i64::from(self.enquiries) > self.settings.enquiries {
            self.sender.fail(link, Failure::NoAnswer);
        } else {
            self.say(link, ENQ);
            self.timers.set_after(link, Timer::Answer, self.settings.ack_time);
        }
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        let has_left = state == MarkState::SurelyLeft && self.sender.is_latest(mark);
        if has_left && self.stage == Stage::Answer && self.sender.is_active() {
            self.timers.set_after(link, Timer::Answer, self.settings.ack_time);
        }
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        if self.sender.begin(link, job.job) {
            self.stage = Stage::Filling;
            self.enquiries = 0;
        }
    }

    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        // 0 is the delivery under way; here each begins and ends in one event.
        if job != JobId::NONE {
            self.timers.cancel(link, Timer::Answer);
            self.sender.cut(link, Failure::Aborted);
        }
    }

    fn after(&mut self, link: &mut Context<'_>) {
        self.go_on(link);
        let name = match self.stage {
            _ if !self.sender.is_active() => "idle",
            Stage::Answer => "waiting for the answer",
            _ if self.sender.is_paused() => "paused",
            _ => "sending",
        };
        self.name.tell(link, name);
    }

    state_format!(1);
}

impl Df1 {
    fn hear(&mut self, link: &mut Context<'_>, byte: u8) {
        match self.reader.take(byte, self.settings.check) {
            Heard::Nothing => {}
            Heard::Ack => self.acknowledged(link),
            Heard::Nak => self.refused(link),
            Heard::Enquiry => self.say(link, self.last),
            Heard::Message { is_good } => self.message(link, is_good),
            // An answer that is asked for now must not be that to an earlier message.
            Heard::Stray => self.last = NAK,
        }
    }

    /// Gathers the message, and gives its frame to the link.
    fn go_on(&mut self, link: &mut Context<'_>) {
        if !self.sender.is_active() {
            return;
        }
        if self.stage == Stage::Filling {
            let data = *self.sender.data();
            if data.room() == 0 {
                return self.sender.fail(link, Failure::TooLong);
            }
            if !self.sender.has_ended() {
                return self.sender.want(link, data.room());
            }
            if data.len() < LEAST {
                return self.sender.fail(link, Failure::BadJob);
            }
            self.frame.make(data.as_slice(), self.settings.check);
            self.stage = Stage::Sending;
        }
        // Nothing stands between an answer that waits and the line.
        let can_go = !self.sender.is_paused() && self.answers.owes_nothing();
        if self.stage == Stage::Sending && can_go {
            let frame = &self.frame;
            let (byte, symbol) = (|at| frame.byte(at), |at| frame.symbol(at));
            if self.sender.give_symbols(link, frame.length(), byte, symbol) {
                self.stage = Stage::Answer;
            }
        }
    }

    /// Whether an answer is to the message of the job: one before it can have left is not.
    fn is_answered(&self) -> bool {
        self.sender.is_active() && self.stage == Stage::Answer && self.sender.has_left()
    }

    fn acknowledged(&mut self, link: &mut Context<'_>) {
        if self.is_answered() {
            self.timers.cancel(link, Timer::Answer);
            self.sender.done(link);
        }
    }

    fn refused(&mut self, link: &mut Context<'_>) {
        if !self.is_answered() {
            return;
        }
        self.timers.cancel(link, Timer::Answer);
        if self.sender.repeats(self.settings.naks) {
            self.enquiries = 0;
            self.stage = Stage::Sending;
        } else {
            self.sender.fail(link, Failure::AttemptsUsedUp);
        }
    }

    /// A message has come as a whole: it is delivered, if it is good, new and there is room, and answered.
    fn message(&mut self, link: &mut Context<'_>, is_good: bool) {
        let text = self.reader.text();
        let [_, src, cmd, _, low, high, ..] = *text else {
            self.last = NAK;
            return self.say(link, NAK);
        };
        let head = [src, cmd, low, high];
        let is_again = self.settings.duplicates && self.has_taken && head == self.taken;
        let has_room = text.len() <= link.delivery_room() as usize;
        self.last = if is_good && (is_again || has_room) { ACK } else { NAK };
        if self.last == ACK && !is_again {
            (self.taken, self.has_taken) = (head, true);
            self.delivery = self.delivery.next();
            link.delivery_begin(self.delivery, JobId::NONE);
            link.deliver(self.delivery, text);
            link.delivery_end(self.delivery, None, 0);
        }
        self.say(link, self.last);
    }

    /// A symbol of two characters, between two symbols of a frame that is on its way. One that finds no room
    /// even here is asked for again.
    fn say(&mut self, link: &mut Context<'_>, symbol: u8) {
        self.answers.say(link, &[DLE, symbol]);
    }
}
