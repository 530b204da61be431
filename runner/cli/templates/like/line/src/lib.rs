//! my-protocol: lines of text, each answered with ACK or NAK, both ways.
//!
//! A plug-in is a state machine: the host calls a method for each event, and the method answers with actions
//! on `link`. What the protocol demands stands in `requirements`, and the cases in `traces` show it.
#![cfg_attr(target_arch = "wasm32", no_std)]

use softplug_plugin::parts::{Answers, Block, BlockSender, Timers};
use softplug_plugin::{
    Context, Converter, DeliveryId, Failure, JobId, JobStart, LineErrorKind, LinkDownReason,
    MarkId, MarkState, Micros, State, Unread, manifest, parts, settings, state_format, timers,
};

/// Answer: the line was taken.
pub const ACK: u8 = 0x06;
/// Answer: the line is to be sent again.
pub const NAK: u8 = 0x15;
const LF: u8 = b'\n';
/// The longest line in bytes, its LF included.
pub const LINE: usize = 200;
/// Bytes of output that one character can bring.
const RESERVE: usize = 512;

settings! {
    /// What an operator can set.
    pub struct Settings {
        answer_time: i64 = 2000 in 10..=60000 "ms", "How long the answer to a line may take.";
        repeats: i64 = 3 in 0..=15 "", "How often a refused line is sent again.";
    }
}

timers! {
    enum Timer {
        Answer,
    }
}

/// The converter: all that it must remember between two events.
#[derive(Debug, State)]
pub struct Plugin {
    #[state(skip)]
    settings: Settings,
    timers: Timers<Timer, 1>,
    answers: Answers<16>,
    sender: BlockSender<LINE>,
    /// A line has been given to the link; its answer is awaited.
    awaits_answer: bool,
    heard: Block<LINE>,
    is_bad: bool,
    delivery: DeliveryId,
    #[state(skip)]
    unread: Unread,
}

softplug_plugin::export!(Plugin);

impl Converter for Plugin {
    type Settings = Settings;
    const MANIFEST: &'static str = manifest! {
        head: r#""abi":"1.0","name":"my-protocol","version":"0.1.0","licence":"MIT","protocol":"my-protocol",
            "description":"Lines of text, each answered with ACK or NAK.""#,
        settings: Settings,
        tail: r#""jobs":[{"name":"send","text":"Sends a text line by line."}],
            "profiles":[{"name":"my-protocol","features":[]}],
            "needs":{"line_errors":"used"},"state":{"saves":1,"accepts":[1]}"#,
    };

    fn new(settings: Settings) -> Self {
        Self {
            settings,
            timers: Timers::new(),
            answers: Answers::new(),
            sender: BlockSender::new(),
            awaits_answer: false,
            heard: Block::new(),
            is_bad: false,
            delivery: DeliveryId::NONE,
            unread: Unread::new(),
        }
    }

    parts!(timers, sender);

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let rest = link.each_byte(bytes, RESERVE, |link, byte| match byte {
            ACK | NAK => self.answered(link, byte == ACK),
            _ => self.hear(link, byte),
        });
        self.unread.keep(link, rest);
    }

    fn more(&mut self, link: &mut Context<'_>) {
        let unread = self.unread;
        self.received(link, unread.bytes());
    }

    fn line_error(
        &mut self,
        _link: &mut Context<'_>,
        _kind: LineErrorKind,
        _byte: Option<u8>,
        _span: u32,
    ) {
        self.is_bad = true;
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.stop(link, Failure::LinkDown);
        self.answers.forget();
        self.heard.clear();
        self.is_bad = false;
    }

    fn timer(&mut self, link: &mut Context<'_>, _id: u8, _deadline: Micros) {
        self.stop(link, Failure::NoAnswer);
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        let has_left = state == MarkState::SurelyLeft && self.sender.is_latest(mark);
        if has_left && self.awaits_answer {
            self.timers
                .set_after(link, Timer::Answer, self.settings.answer_time);
        }
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        self.sender.begin(link, job.job);
    }

    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        // 0 is the delivery under way; here each begins and ends in one event.
        if job != JobId::NONE {
            self.stop(link, Failure::Aborted);
        }
    }

    fn after(&mut self, link: &mut Context<'_>) {
        self.go_on(link);
    }

    // Count it up when the fields change.
    state_format!(1);
}

impl Plugin {
    /// Sends the next line, if there is one and nothing else is awaited.
    fn go_on(&mut self, link: &mut Context<'_>) {
        self.pay(link);
        let goes_on = self.sender.is_given_in_part();
        let can_go = self.sender.is_active() && !self.sender.is_paused();
        if self.awaits_answer || !can_go || !(goes_on || self.answers.owes_nothing()) {
            return;
        }
        let data = *self.sender.data();
        let text = data.as_slice();
        let line = match text.iter().position(|byte| *byte == LF) {
            Some(end) => text.get(..end).unwrap_or_default(),
            None if data.room() == 0 => return self.sender.fail(link, Failure::TooLong),
            None if !self.sender.has_ended() => return self.sender.want(link, data.room()),
            None if text.is_empty() => return self.sender.done(link),
            // The last line gets its LF if it has none.
            None => text,
        };
        self.awaits_answer = self.sender.give(link, &[line, &[LF]]);
    }

    fn answered(&mut self, link: &mut Context<'_>, is_good: bool) {
        // An answer before the line can have left is none.
        if !self.awaits_answer || !self.sender.has_left() {
            return;
        }
        self.timers.cancel(link, Timer::Answer);
        self.awaits_answer = false;
        if is_good {
            let data = self.sender.data();
            let end = data.as_slice().iter().position(|byte| *byte == LF);
            self.sender
                .acknowledged(end.map_or(data.len(), |end| end + 1));
        } else if !self.sender.repeats(self.settings.repeats) {
            self.sender.fail(link, Failure::AttemptsUsedUp);
        }
        self.go_on(link);
    }

    /// A character of a line: the last one delivers it, if it is good and there is room.
    fn hear(&mut self, link: &mut Context<'_>, byte: u8) {
        self.is_bad |= !self.heard.push(byte);
        if byte != LF {
            return;
        }
        let line = self.heard.as_slice();
        let is_taken = !self.is_bad && line.len() <= link.delivery_room() as usize;
        let is_answered = self.answers.keep(&[if is_taken { ACK } else { NAK }]);
        if is_taken && is_answered {
            self.delivery = self.delivery.next();
            link.delivery_begin(self.delivery, JobId::NONE);
            link.deliver(self.delivery, line);
            link.delivery_end(self.delivery, None, 0);
        }
        self.heard.clear();
        self.is_bad = false;
        self.pay(link);
    }

    /// Sends answers that wait, but never in the middle of a line of our own.
    fn pay(&mut self, link: &mut Context<'_>) {
        if !self.sender.is_given_in_part() {
            self.answers.pay(link);
        }
    }

    fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        self.timers.cancel(link, Timer::Answer);
        self.awaits_answer = false;
        self.sender.stop(link, failure);
    }
}
