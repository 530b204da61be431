//! XON/XOFF in both directions: the sender obeys the partner's XOFF and XON, the
//! receiver speaks them by low and high mark.
//!
//! The protocol's page is `docs/protocols/xon-xoff.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]
#![allow(clippy::inline_always, reason = "calls are most of what an event costs in the sandbox")]

mod byte_set;
mod codes;
mod lines;
mod receiver;
mod sender;
mod settings;
mod state;

pub use settings::{ControlInData, LineEnd, OnLineError, Settings, WhileSending};

use codes::{Codes, Control};
use receiver::{Receiver, Timer};
use sender::Sender;
use softplug_plugin::parts::TimerName;
use softplug_plugin::{
    Context, Converter, Failure, JobId, JobStart, LineErrorKind, LinkDownReason, MarkId, MarkState,
    Micros, NoteLevel, Opening, State, parts, state_format,
};
use state::Name;

/// The sender's timer, behind those of the receiver: the partner has held us too long.
const HELD: u8 = 2;

/// The converter.
#[derive(Debug, State)]
pub struct XonXoff {
    #[state(skip)]
    settings: Settings,
    #[state(skip)]
    codes: Codes,
    sender: Sender,
    receiver: Receiver,
    /// The state that the host knows.
    #[state(skip)]
    named: Option<Name>,
}

softplug_plugin::export!(XonXoff);

impl Converter for XonXoff {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;

    fn check_settings(settings: &Settings) -> Result<(), &'static str> {
        settings.check()
    }

    fn new(settings: Settings) -> Self {
        let codes = Codes::new(&settings);
        Self {
            settings,
            codes,
            sender: Sender::default(),
            receiver: Receiver::default(),
            named: None,
        }
    }

    parts!(receiver.timers);

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        self.sender.prepare(&self.settings);
        self.receiver.prepare(&self.settings);
        if opening.resumed {
            self.sender.set_timers(link);
        } else {
            self.receiver.raise_marks(&self.settings, opening.delivery_room);
            if self.settings.xon_at_open && self.settings.speak {
                self.receiver.say(link, &self.codes);
            }
        }
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let mut rest = bytes;
        let held_until = self.sender.hears();
        loop {
            let (data, after) = self.codes.split(rest);
            if !data.is_empty() && !self.ignores_data() {
                self.receiver.data(link, &self.settings, data);
            }
            let Some((control, after)) = after else { break };
            match control {
                Control::Xoff => self.sender.xoff(link, &self.settings),
                Control::Xon => self.sender.xon(link),
            }
            rest = after;
        }
        self.sender.has_heard(link, held_until);
        self.receiver.after_bytes(link, &self.settings, &self.codes);
    }

    fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        byte: Option<u8>,
        span: u32,
    ) {
        link.note(NoteLevel::Warning, u16::from(kind.code()), kind.text());
        // With a span the character was given already.
        let byte = if span == 0 { byte } else { None };
        if !self.ignores_data() {
            self.receiver.damaged(link, &self.settings, kind, byte);
            self.receiver.after_bytes(link, &self.settings, &self.codes);
        }
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.sender.stop(link, Failure::LinkDown);
        self.receiver.end(link, Some(Failure::LinkDown));
    }

    fn link_up(&mut self, link: &mut Context<'_>) {
        self.sender.released(link);
        self.receiver.let_go(link, &self.codes);
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        match Timer::from_id(id) {
            Some(Timer::Quiet) => self.receiver.quiet(link, &self.settings),
            Some(Timer::RepeatXon) => self.receiver.repeat_xon(link, &self.settings, &self.codes),
            None => self.sender.stop(link, Failure::HeldTooLong),
        }
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        if state == MarkState::SurelyLeft {
            if mark == MarkId(receiver::OUR_CONTROL.0) {
                self.receiver.left(link, &self.codes);
            } else {
                self.sender.left(link, mark);
            }
        }
    }

    fn transmit_room(&mut self, link: &mut Context<'_>) {
        self.sender.go_on(link, &self.settings);
    }

    fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        self.sender.discarded(link, &self.settings, bytes);
    }

    fn delivery_room(&mut self, link: &mut Context<'_>) {
        self.receiver.drained(link, &self.settings, &self.codes);
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        self.sender.begin(link, &self.settings, &job);
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: JobId, bytes: &[u8]) {
        self.sender.data(link, &self.settings, &self.codes, bytes);
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.sender.data_ended(link, &self.settings);
    }

    fn pause(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.sender.set_paused(link, true);
    }

    fn resume(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.sender.set_paused(link, false);
    }

    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        if job == JobId::NONE {
            self.receiver.abort(link, &self.codes);
        } else {
            self.sender.stop(link, Failure::Aborted);
        }
    }

    fn force_resume(&mut self, link: &mut Context<'_>) {
        self.sender.forget_hold(link);
    }

    #[inline]
    fn after(&mut self, link: &mut Context<'_>) {
        let name = self.sender.state().unwrap_or_else(|| self.receiver.state());
        if self.named != Some(name) {
            self.name(link, name);
        }
    }

    state_format!(1);
}

impl XonXoff {
    /// Whether what comes while we send is only an echo.
    fn ignores_data(&self) -> bool {
        self.settings.while_sending == WhileSending::Ignore && self.sender.is_sending()
    }

    #[cold]
    fn name(&mut self, link: &mut Context<'_>, name: Name) {
        self.named = Some(name);
        link.state(name.text());
    }
}
