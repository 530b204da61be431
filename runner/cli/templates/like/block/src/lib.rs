//! my-protocol: data in blocks with a sum, each answered with ACK or NAK, both ways.
//!
//! A block is STX, the count of its data, the data, their sum. EOT, answered too, ends a transfer.
//! The host calls a method for each event, which acts on `link`.
#![cfg_attr(target_arch = "wasm32", no_std)]

use softplug_plugin::parts::{Answers, Block, BlockSender, TimerName, Timers, checks};
use softplug_plugin::{
    Context, Converter, DeliveryId, Failure, JobId, JobStart, LinkDownReason, MarkId, MarkState,
    Micros, State, Unread, manifest, parts, settings, state_format, timers,
};

pub const STX: u8 = 0x02;
pub const EOT: u8 = 0x04;
pub const ACK: u8 = 0x06;
pub const NAK: u8 = 0x15;
const BLOCK: usize = 128;
/// Bytes of output for one character.
const RESERVE: usize = 512;

settings! {
    /// The settings.
    pub struct Settings {
        answer_time: i64 = 2000 in 10..=60000 "ms", "Time for the answer to a block.";
        character_time: i64 = 500 in 10..=60000 "ms", "Silence that damages a block.";
        repeats: i64 = 3 in 0..=15 "", "How often a block is sent again.";
    }
}

timers! {
    enum Timer {
        Answer,
        Character,
    }
}

#[derive(Debug, State)]
pub struct Plugin {
    #[state(skip)]
    settings: Settings,
    timers: Timers<Timer, 2>,
    answers: Answers<16>,
    sender: BlockSender<BLOCK>,
    /// A block is with the link.
    awaits_answer: bool,
    heard: Block<258>,
    is_open: bool,
    delivery: DeliveryId,
    #[state(skip)]
    unread: Unread,
}

softplug_plugin::export!(Plugin);

impl Converter for Plugin {
    type Settings = Settings;
    const MANIFEST: &'static str = manifest! {
        head: r#""abi":"1.0","name":"my-protocol","version":"0.1.0","licence":"MIT","protocol":"my-protocol",
            "description":"Data in blocks, each answered with ACK or NAK.""#,
        settings: Settings,
        tail: r#""jobs":[{"name":"send","text":"Sends data in blocks."}],
            "profiles":[{"name":"my-protocol","features":[]}],"state":{"saves":1,"accepts":[1]}"#,
    };

    fn new(settings: Settings) -> Self {
        Self {
            settings,
            timers: Timers::new(),
            answers: Answers::new(),
            sender: BlockSender::new(),
            awaits_answer: false,
            heard: Block::new(),
            is_open: false,
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

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.stop(link, Failure::LinkDown);
        self.answers.forget();
        self.end(link, Some(Failure::LinkDown));
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        match Timer::from_id(id) {
            Some(Timer::Answer) => self.stop(link, Failure::NoAnswer),
            Some(Timer::Character) => {
                self.heard.clear();
                self.answers.keep(&[NAK]);
            }
            None => {}
        }
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
        // None: the delivery.
        if job == JobId::NONE {
            self.end(link, Some(Failure::Aborted));
        } else {
            self.stop(link, Failure::Aborted);
        }
    }

    fn after(&mut self, link: &mut Context<'_>) {
        self.go_on(link);
    }

    state_format!(1);
}

impl Plugin {
    /// Sends the next block, or EOT, if nothing else is awaited.
    fn go_on(&mut self, link: &mut Context<'_>) {
        self.pay(link);
        let goes_on = self.sender.is_given_in_part();
        let can_go = self.sender.is_active() && !self.sender.is_paused();
        if self.awaits_answer || !can_go || !(goes_on || self.answers.owes_nothing()) {
            return;
        }
        let data = *self.sender.data();
        if data.room() > 0 && !self.sender.has_ended() {
            return self.sender.want(link, data.room());
        }
        let text = data.as_slice();
        let (head, sum) = ([STX, text.len() as u8], [checks::sum(&[text])]);
        let block: &[&[u8]] = match text.len() {
            0 => &[&[EOT]],
            _ => &[&head, text, &sum],
        };
        self.awaits_answer = self.sender.give(link, block);
    }

    fn answered(&mut self, link: &mut Context<'_>, is_good: bool) {
        // An answer before the block can have left is none.
        if !self.awaits_answer || !self.sender.has_left() {
            return;
        }
        self.timers.cancel(link, Timer::Answer);
        self.awaits_answer = false;
        if is_good && self.sender.data().is_empty() {
            self.sender.done(link);
        } else if is_good {
            self.sender.acknowledged(BLOCK);
        } else if !self.sender.repeats(self.settings.repeats) {
            self.sender.fail(link, Failure::AttemptsUsedUp);
        }
        self.go_on(link);
    }

    fn hear(&mut self, link: &mut Context<'_>, byte: u8) {
        if self.heard.is_empty() {
            match byte {
                ACK | NAK => return self.answered(link, byte == ACK),
                EOT => {
                    self.answers.keep(&[ACK]);
                    return self.end(link, None);
                }
                STX => {}
                _ => return,
            }
        }
        self.heard.push(byte);
        self.timers
            .set_after(link, Timer::Character, self.settings.character_time);
        if let [_, count, text @ .., sum] = self.heard.as_slice()
            && text.len() == usize::from(*count)
        {
            let has_room = text.len() <= link.delivery_room() as usize;
            let is_taken = *sum == checks::sum(&[text]) && has_room;
            let is_answered = self.answers.keep(&[if is_taken { ACK } else { NAK }]);
            if is_taken && is_answered && !text.is_empty() {
                if !self.is_open {
                    self.is_open = true;
                    self.delivery = self.delivery.next();
                    link.delivery_begin(self.delivery, JobId::NONE);
                }
                link.deliver(self.delivery, text);
            }
            self.forget(link);
        }
    }

    /// Sends answers, but not inside a block of our own.
    fn pay(&mut self, link: &mut Context<'_>) {
        if !self.sender.is_given_in_part() {
            self.answers.pay(link);
        }
    }

    /// The block that is heard is over.
    fn forget(&mut self, link: &mut Context<'_>) {
        self.heard.clear();
        self.timers.cancel(link, Timer::Character);
        self.pay(link);
    }

    /// Ends the delivery under way.
    fn end(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        self.forget(link);
        if core::mem::take(&mut self.is_open) {
            link.delivery_end(self.delivery, failure, 0);
        }
    }

    fn stop(&mut self, link: &mut Context<'_>, failure: Failure) {
        self.timers.cancel(link, Timer::Answer);
        self.awaits_answer = false;
        self.sender.stop(link, failure);
    }
}
