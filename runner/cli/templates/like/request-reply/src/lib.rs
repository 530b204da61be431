//! my-protocol: the host asks the machine with a line, and the machine replies with one.
//!
//! The host calls a method for each event, and the method answers with actions on `link`. What the protocol
//! demands stands in `requirements`, and the cases in `traces` show it.
#![cfg_attr(target_arch = "wasm32", no_std)]

use softplug_plugin::parts::{Block, BlockSender, Timers};
use softplug_plugin::{
    Context, Converter, DeliveryId, Failure, JobId, JobStart, LineErrorKind, LinkDownReason,
    MarkId, MarkState, Micros, State, Unread, manifest, parts, settings, state_format, timers,
};

/// The end of a line.
pub const CR: u8 = b'\r';
/// The longest question and reply in bytes, without CR.
const LINE: usize = 120;
/// Bytes of output that one character can bring.
const RESERVE: usize = 512;

settings! {
    /// What an operator can set.
    pub struct Settings {
        reply_time: i64 = 1000 in 10..=60000 "ms", "How long to wait for the reply to a question that has left.";
        repeats: i64 = 2 in 0..=15 "", "How often a question without a reply is asked again.";
    }
}

timers! {
    enum Timer {
        Reply,
    }
}

/// The converter: all that it must remember between two events.
#[derive(Debug, State)]
pub struct Plugin {
    #[state(skip)]
    settings: Settings,
    timers: Timers<Timer, 1>,
    /// One byte more shows that a question is too long.
    sender: BlockSender<{ LINE + 1 }>,
    /// The question has been given to the link; its reply is awaited.
    awaits_reply: bool,
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
            "description":"A line asks, and a line replies.""#,
        settings: Settings,
        tail: r#""jobs":[{"name":"ask","text":"Sends a line and delivers the reply."}],
            "profiles":[{"name":"my-protocol","features":[]}],
            "needs":{"line_errors":"used"},"state":{"saves":1,"accepts":[1]}"#,
    };

    fn new(settings: Settings) -> Self {
        Self {
            settings,
            timers: Timers::new(),
            sender: BlockSender::new(),
            awaits_reply: false,
            heard: Block::new(),
            is_bad: false,
            delivery: DeliveryId::NONE,
            unread: Unread::new(),
        }
    }

    parts!(timers, sender);

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let rest = link.each_byte(bytes, RESERVE, |link, byte| self.hear(link, byte));
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
        self.forget();
    }

    fn timer(&mut self, link: &mut Context<'_>, _id: u8, _deadline: Micros) {
        // What has come of a reply is none.
        self.forget();
        self.awaits_reply = false;
        if !self.sender.repeats(self.settings.repeats) {
            self.sender.fail(link, Failure::NoAnswer);
        }
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        let has_left = state == MarkState::SurelyLeft && self.sender.is_latest(mark);
        if has_left && self.awaits_reply {
            self.timers
                .set_after(link, Timer::Reply, self.settings.reply_time);
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
    /// Asks, when the question is there as a whole.
    fn go_on(&mut self, link: &mut Context<'_>) {
        if self.awaits_reply || !self.sender.is_active() || self.sender.is_paused() {
            return;
        }
        let data = *self.sender.data();
        if data.room() == 0 {
            return self.sender.fail(link, Failure::TooLong);
        }
        if !self.sender.has_ended() {
            return self.sender.want(link, data.room());
        }
        self.awaits_reply = self.sender.give(link, &[data.as_slice(), &[CR]]);
    }

    /// A character of a reply: CR delivers it, if a question has left and there is room.
    fn hear(&mut self, link: &mut Context<'_>, byte: u8) {
        if byte != CR {
            self.is_bad |= !self.heard.push(byte);
            return;
        }
        let reply = self.heard.as_slice();
        let has_room = reply.len() <= link.delivery_room() as usize;
        // A reply before the question can have left is none.
        if self.awaits_reply && self.sender.has_left() && !self.is_bad && has_room {
            self.timers.cancel(link, Timer::Reply);
            self.awaits_reply = false;
            self.delivery = self.delivery.next();
            link.delivery_begin(self.delivery, self.sender.job());
            if !reply.is_empty() {
                link.deliver(self.delivery, reply);
            }
            link.delivery_end(self.delivery, None, 0);
            self.sender.done(link);
        }
        self.forget();
    }

    /// What has come is over.
    fn forget(&mut self) {
        self.heard.clear();
        self.is_bad = false;
    }

    fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        self.timers.cancel(link, Timer::Reply);
        self.awaits_reply = false;
        self.sender.stop(link, failure);
    }
}
