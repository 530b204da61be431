//! my-protocol: bytes as they are, both ways, under the machine's XOFF and XON.
//!
//! The host calls a method for each event, and the method answers with actions on `link`. What the protocol
//! demands stands in `requirements`, and the cases in `traces` show it.
#![cfg_attr(target_arch = "wasm32", no_std)]

use softplug_plugin::parts::BlockSender;
use softplug_plugin::{
    Context, Converter, DeliveryId, Failure, JobId, JobStart, LinkDownReason, MarkId, MarkState,
    State, Unread, manifest, parts, settings, state_format,
};

pub const XON: u8 = 0x11;
pub const XOFF: u8 = 0x13;
/// Bytes of the job that are given to the link at a time.
const PIECE: usize = 128;
/// Bytes of output that one character can bring.
const RESERVE: usize = 256;

settings! {
    /// What an operator can set.
    pub struct Settings {
        end: i64 = 37 in 0..=255 "", "The byte at the end of what the machine sends; 37 is %.";
        reserve: i64 = 256 in 16..=4096 "bytes", "Less room than this stops the machine.";
    }
}

/// The converter: all that it must remember between two events.
#[derive(Debug, State)]
pub struct Plugin {
    #[state(skip)]
    settings: Settings,
    sender: BlockSender<PIECE>,
    /// All has been given to the link.
    is_last: bool,
    /// We have stopped the machine.
    is_stopped: bool,
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
            "description":"Bytes as they are, under XOFF and XON.""#,
        settings: Settings,
        tail: r#""jobs":[{"name":"send","text":"Sends data as it is."}],
            "profiles":[{"name":"my-protocol","features":[]}],"state":{"saves":1,"accepts":[1]}"#,
    };

    fn new(settings: Settings) -> Self {
        Self {
            settings,
            sender: BlockSender::new(),
            is_last: false,
            is_stopped: false,
            is_open: false,
            delivery: DeliveryId::NONE,
            unread: Unread::new(),
        }
    }

    parts!(sender);

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let rest = link.each_byte(bytes, RESERVE, |link, byte| match byte {
            XOFF => link.hold(),
            XON => link.release(),
            _ => self.hear(link, byte),
        });
        self.unread.keep(link, rest);
    }

    fn more(&mut self, link: &mut Context<'_>) {
        let unread = self.unread;
        self.received(link, unread.bytes());
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.sender.stop(link, Failure::LinkDown);
        self.end(link, Some(Failure::LinkDown));
        link.release();
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        let has_left = state == MarkState::SurelyLeft && self.sender.is_latest(mark);
        if has_left && self.is_last && self.sender.is_active() {
            self.sender.done(link);
        }
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        if self.sender.begin(link, job.job) {
            self.is_last = false;
        }
    }

    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        // None: the delivery.
        if job == JobId::NONE {
            self.end(link, Some(Failure::Aborted));
        } else {
            self.sender.stop(link, Failure::Aborted);
        }
    }

    fn force_resume(&mut self, link: &mut Context<'_>) {
        link.release();
    }

    fn after(&mut self, link: &mut Context<'_>) {
        self.go_on(link);
        // The machine may send again when there is twice the room at which it was stopped.
        let reserve = self.settings.reserve as u32;
        let limit = if self.is_stopped {
            2 * reserve
        } else {
            reserve
        };
        let is_short = link.delivery_room() < limit;
        if is_short != self.is_stopped && self.is_open {
            self.is_stopped = is_short;
            link.transmit_urgent(&[if is_short { XOFF } else { XON }]);
        }
    }

    // Count it up when the fields change.
    state_format!(1);
}

impl Plugin {
    /// Gives the link what it takes of the job.
    fn go_on(&mut self, link: &mut Context<'_>) {
        while self.sender.is_active() && !self.is_last && !self.sender.is_paused() {
            let data = *self.sender.data();
            if data.room() > 0 && !self.sender.has_ended() {
                return self.sender.want(link, data.room());
            }
            if !self.sender.give(link, &[data.as_slice()]) {
                return;
            }
            self.sender.acknowledged(data.len());
            self.is_last = data.room() > 0;
        }
    }

    /// A character of what the machine sends. Up to the end it is one delivery.
    fn hear(&mut self, link: &mut Context<'_>, byte: u8) {
        if !self.is_open {
            self.is_open = true;
            self.delivery = self.delivery.next();
            link.delivery_begin(self.delivery, JobId::NONE);
        }
        if link.delivery_room() == 0 {
            return self.end(link, Some(Failure::Overrun));
        }
        link.deliver(self.delivery, &[byte]);
        if i64::from(byte) == self.settings.end {
            self.end(link, None);
        }
    }

    fn end(&mut self, link: &mut Context<'_>, failure: Option<Failure>) {
        if core::mem::take(&mut self.is_open) {
            link.delivery_end(self.delivery, failure, 0);
        }
    }
}
