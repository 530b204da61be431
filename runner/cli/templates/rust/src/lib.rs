//! my-protocol: lines of text, each answered with ACK or NAK.
//!
//! A plug-in is a state machine: the host calls one of the methods below for each event, and the
//! method answers with actions on `link`. There is no clock, no thread and no I/O; time comes with
//! each event (`link.now()`) and goes on only between events.
//!
//! What the protocol demands stands, clause by clause, in `requirements/my-protocol.toml`; the cases
//! in `traces` show it. Change those first, then the code.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod buffer;
mod receiver;
mod sender;

use receiver::Receiver;
use sender::Sender;
use softplug_plugin::{
    Context, Converter, Failure, JobStart, LineErrorKind, LinkDownReason, MarkState, Micros,
    NoteLevel, Opening, StateError, StateReader, StateWriter, manifest, settings,
};

/// Answer: the line was taken.
pub const ACK: u8 = 0x06;
/// Answer: the line is to be sent again.
pub const NAK: u8 = 0x15;
/// The end of a line.
pub const LF: u8 = b'\n';
/// The longest line in bytes, its LF included.
pub const LINE: usize = 200;

settings! {
    /// What an operator can set. Names, types, ranges and texts go into the manifest by themselves.
    pub struct Settings {
        answer_time: i64 = 2000 in 10..=60000 "ms", "How long to wait for the answer to a line that has left.";
        repeats: i64 = 3 in 0..=15 "", "How often a line that was refused is sent again.";
    }
}

/// The converter: all that it must remember between two events.
#[derive(Debug)]
pub struct Plugin {
    sender: Sender,
    receiver: Receiver,
}

softplug_plugin::export!(Plugin);

impl Converter for Plugin {
    type Settings = Settings;
    const MANIFEST: &'static str = manifest! {
        head: concat!(
            r#""abi":"1.0","name":""#, env!("CARGO_PKG_NAME"),
            r#"","version":""#, env!("CARGO_PKG_VERSION"),
            r#"","licence":""#, env!("CARGO_PKG_LICENSE"),
            r#"","protocol":"lines with ACK","description":"Lines of text, each answered with ACK or NAK.""#,
        ),
        settings: Settings,
        tail: concat!(
            r#""jobs":[{"name":"send","text":"Sends a text line by line."}],"#,
            r#""profiles":[{"name":"my-protocol","features":[]}],"#,
            r#""needs":{"line_errors":"used"},"state":{"saves":1,"accepts":[1]}"#,
        ),
    };
    // Count it up when `save` writes something else than before.
    const STATE_FORMAT: Option<u16> = Some(1);

    fn new(settings: Settings) -> Self {
        Self {
            sender: Sender::new(&settings),
            receiver: Receiver::new(),
        }
    }

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        // A restored plug-in goes on where it was, but the host has forgotten its timers.
        if opening.resumed {
            self.sender.set_timer_again(link);
        }
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        for byte in bytes {
            match *byte {
                ACK => self.sender.acknowledged(link),
                NAK => self.sender.refused(link),
                byte => self.receiver.take(link, byte),
            }
        }
    }

    fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        _byte: Option<u8>,
        _span: u32,
    ) {
        link.note(NoteLevel::Warning, u16::from(kind.code()), kind.text());
        self.receiver.damage();
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.sender.stop(link, Failure::LinkDown);
        self.receiver.forget();
    }

    fn timer(&mut self, link: &mut Context<'_>, _id: u8, _deadline: Micros) {
        self.sender.stop(link, Failure::NoAnswer);
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: u32, state: MarkState) {
        if mark == receiver::ANSWER {
            self.receiver.answer_left(state);
        } else {
            self.sender.line_left(link, mark, state);
        }
    }

    fn transmit_room(&mut self, link: &mut Context<'_>) {
        self.sender.go_on(link);
    }

    fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        self.sender.stopped(link, bytes);
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        self.sender.begin(link, job.job);
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: u32, bytes: &[u8]) {
        self.sender.take(link, bytes);
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: u32) {
        self.sender.data_ended(link);
    }

    fn pause(&mut self, link: &mut Context<'_>, _job: u32) {
        self.sender.set_paused(link, true);
    }

    fn resume(&mut self, link: &mut Context<'_>, _job: u32) {
        self.sender.set_paused(link, false);
    }

    fn abort(&mut self, link: &mut Context<'_>, job: u32) {
        // 0 is the delivery under way; here each begins and ends in one event.
        if job != 0 {
            self.sender.stop(link, Failure::Aborted);
        }
    }

    fn save(&self, state: &mut StateWriter<'_>) {
        self.sender.save(state);
        self.receiver.save(state);
    }

    fn restore(&mut self, _format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
        self.sender.restore(state)?;
        self.receiver.restore(state)
    }
}
