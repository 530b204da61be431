//! XON/XOFF in both directions: the sender obeys the partner's XOFF and XON, the
//! receiver speaks them by low and high mark.
//!
//! The protocol's page is `docs/protocols/xon-xoff.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod codes;
mod lines;
mod receiver;
mod sender;
mod settings;
mod state;

pub use settings::{ControlInData, LineEnd, OnLineError, Settings, WhileSending};

use codes::{Codes, Control};
use core::sync::atomic::{AtomicBool, Ordering};
use receiver::Receiver;
use sender::Sender;
use softplug_plugin::{
    Context, Converter, Failure, JobStart, LineErrorKind, LinkDownReason, MarkState, Micros,
    NoteLevel, Opening, StateError, StateReader, StateWriter, mutant,
};
use state::State;

/// Timer: silence ends the reception.
const QUIET: u8 = 0;
/// Timer: nothing came since our XON, say it again.
const REPEAT_XON: u8 = 1;
/// Timer: the partner has held us too long.
const HELD: u8 = 2;
/// Timer of mutants that are late.
const LATE: u8 = 3;

/// Only mutants ask for it: the state was saved, or the link opened.
static SAVED: AtomicBool = AtomicBool::new(false);

/// The converter.
#[derive(Debug)]
pub struct XonXoff {
    settings: Settings,
    codes: Codes,
    sender: Sender,
    receiver: Receiver,
    /// The state that the host knows.
    named: Option<State>,
}

softplug_plugin::export!(XonXoff);

impl Converter for XonXoff {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;
    const STATE_FORMAT: Option<u16> = Some(1);

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

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        if opening.resumed {
            let is_timed = !mutant!("abi.swap.timers/not-set-again");
            if is_timed && !mutant!("xon-xoff.link.swap/hold-not-timed") {
                self.sender.set_timers(link);
            }
            if is_timed && !mutant!("xon-xoff.link.swap/silence-not-timed") {
                self.receiver.set_timers(link);
            }
            if self.settings.xon_at_open && mutant!("xon-xoff.rx.xon-at-open/on-take-over") {
                link.transmit_urgent(&[self.codes.xon]);
            }
        } else {
            self.receiver.set_marks(&self.settings, opening.delivery_room);
            if mutant!("abi.close.as-new/second-opening-speaks")
                && SAVED.swap(true, Ordering::Relaxed)
            {
                link.transmit_urgent(&[self.codes.xon]);
            }
            if mutant!("xon-xoff.link.close/hold-kept") {
                self.sender.hold_as_before(link, &self.settings);
            }
            let says_xon = self.settings.xon_at_open && !mutant!("xon-xoff.rx.xon-at-open/missing");
            if says_xon || mutant!("xon-xoff.rx.xon-at-open/always") {
                self.receiver.say(link, &self.codes);
            }
        }
        self.name_state(link);
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let mut rest = bytes;
        if mutant!("xon-xoff.rx.deliver/last-of-burst-lost") && rest.len() > 1 {
            rest = rest.get(..rest.len() - 1).unwrap_or_default();
        }
        if mutant!("abi.cuts.one-time/first-of-read-lost") && rest.len() > 1 {
            rest = rest.get(1..).unwrap_or_default();
        }
        if mutant!("abi.swap.save-changes-nothing/next-byte-lost")
            && SAVED.swap(false, Ordering::Relaxed)
        {
            rest = rest.get(1..).unwrap_or_default();
        }
        if mutant!("abi.output.rounds/endless") {
            link.again();
        }
        let mut is_first = true;
        loop {
            let (data, after) = self.codes.split(rest);
            if !data.is_empty() && !self.ignores_data() {
                self.receiver.data(link, &self.settings, data);
            }
            let Some((control, after)) = after else { break };
            if mutant!("xon-xoff.rx.deliver/control-bytes-too") {
                let byte = rest.get(data.len()..data.len() + 1).unwrap_or_default();
                self.receiver.data(link, &self.settings, byte);
            }
            if mutant!("xon-xoff.rx.transparent/control-bytes-are-data")
                && self.settings.transparent
            {
                let byte = rest.get(data.len()..data.len() + 1).unwrap_or_default();
                self.receiver.data(link, &self.settings, byte);
                rest = after;
                continue;
            }
            if mutant!("xon-xoff.rx.while-sending/controls-too") && self.ignores_data() {
                rest = after;
                continue;
            }
            if mutant!("xon-xoff.tx.no-leak/first-only") && !core::mem::take(&mut is_first) {
                rest = after;
                continue;
            }
            match control {
                Control::Xoff => self.sender.xoff(link, &self.settings),
                Control::Xon => self.sender.xon(link),
            }
            rest = after;
        }
        self.receiver.after_bytes(link, &self.settings, &self.codes);
        self.name_state(link);
    }

    fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        byte: Option<u8>,
        span: u32,
    ) {
        link.note(NoteLevel::Warning, u16::from(kind.code()), kind.text());
        if mutant!("xon-xoff.rx.line-error/still-a-control-byte")
            && byte.is_some_and(|byte| self.codes.control(byte) == Some(Control::Xoff))
        {
            self.sender.xoff(link, &self.settings);
            return;
        }
        // With a span the character was given already.
        let byte = if span == 0 { byte } else { None };
        if !self.ignores_data() {
            self.receiver.damaged(link, &self.settings, kind, byte);
            self.receiver.after_bytes(link, &self.settings, &self.codes);
        }
        self.name_state(link);
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        if mutant!("xon-xoff.link.down/other-reason") {
            self.sender.stop(link, Failure::Aborted);
        }
        self.sender.stop(link, Failure::LinkDown);
        if mutant!("xon-xoff.link.down/delivery-ends-well") {
            self.receiver.end(link, None);
        }
        if !mutant!("xon-xoff.link.down/delivery-goes-on") {
            self.receiver.end(link, Some(Failure::LinkDown));
        }
        self.name_state(link);
    }

    fn link_up(&mut self, link: &mut Context<'_>) {
        if !mutant!("xon-xoff.link.down/hold-kept") {
            self.sender.forget_hold(link);
        }
        if !mutant!("xon-xoff.link.down/partner-not-let-go") {
            self.receiver.let_go(link, &self.codes);
        }
        self.name_state(link);
    }

    fn more(&mut self, link: &mut Context<'_>) {
        if mutant!("abi.output.rounds/endless") {
            link.again();
        }
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        if mutant!("abi.timers.step-limit/again-at-once") {
            link.set_timer(id, link.now());
        }
        match id {
            QUIET => self.receiver.quiet(link, &self.settings),
            REPEAT_XON => self.receiver.repeat_xon(link, &self.settings, &self.codes),
            HELD => self.sender.stop(link, Failure::HeldTooLong),
            LATE if mutant!("xon-xoff.tx.resume-on-xon/tick-late") => self.sender.forget_hold(link),
            LATE if mutant!("xon-xoff.tx.at-boundary/tick-late")
                || mutant!("xon-xoff.tx.depth/one-more") =>
            {
                self.sender.update_hold(link);
            }
            _ => {}
        }
        self.name_state(link);
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: u32, state: MarkState) {
        if state == MarkState::SurelyLeft {
            if mark == receiver::OUR_CONTROL {
                self.receiver.left(link, &self.codes);
                return;
            }
            self.sender.left(link, mark);
            self.name_state(link);
        }
    }

    fn transmit_room(&mut self, link: &mut Context<'_>) {
        self.sender.ask(link, &self.settings);
    }

    fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        self.sender.discarded(link, &self.settings, bytes);
        self.name_state(link);
    }

    fn delivery_room(&mut self, link: &mut Context<'_>) {
        self.receiver.drained(link, &self.settings, &self.codes);
        self.name_state(link);
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        self.sender.begin(link, &self.settings, &job);
        self.name_state(link);
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: u32, bytes: &[u8]) {
        self.sender.data(link, &self.settings, &self.codes, bytes);
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: u32) {
        self.sender.data_ended(link, &self.settings);
    }

    fn pause(&mut self, link: &mut Context<'_>, _job: u32) {
        self.sender.set_paused(link, true);
        self.name_state(link);
    }

    fn resume(&mut self, link: &mut Context<'_>, _job: u32) {
        self.sender.set_paused(link, false);
        self.name_state(link);
    }

    fn abort(&mut self, link: &mut Context<'_>, job: u32) {
        if job == 0 {
            self.receiver.abort(link, &self.codes);
        } else {
            self.sender.stop(link, Failure::Aborted);
        }
        self.name_state(link);
    }

    fn force_resume(&mut self, link: &mut Context<'_>) {
        if mutant!("xon-xoff.tx.force-resume/ignored") {
            return;
        }
        if mutant!("xon-xoff.tx.force-resume/for-ever") {
            self.codes.xoff = self.codes.xon;
        }
        self.sender.forget_hold(link);
        self.name_state(link);
    }

    fn save(&self, state: &mut StateWriter<'_>) {
        if mutant!("abi.swap.save-changes-nothing/next-byte-lost") {
            SAVED.store(true, Ordering::Relaxed);
        }
        self.sender.save(state);
        self.receiver.save(state);
    }

    fn restore(&mut self, format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
        if Some(format) != Self::STATE_FORMAT {
            return Err(StateError);
        }
        self.sender = Sender::restore(state)?;
        self.receiver = Receiver::restore(state)?;
        Ok(())
    }
}

impl XonXoff {
    /// Whether what comes while we send is only an echo.
    fn ignores_data(&self) -> bool {
        if mutant!("xon-xoff.rx.while-sending/echo-delivered") {
            return false;
        }
        if mutant!("xon-xoff.rx.while-sending/never-delivered") && self.sender.is_sending() {
            return true;
        }
        self.settings.while_sending == WhileSending::Ignore && self.sender.is_sending()
    }

    fn name_state(&mut self, link: &mut Context<'_>) {
        let state = self.sender.state().unwrap_or_else(|| self.receiver.state());
        if self.named != Some(state) {
            self.named = Some(state);
            link.state(state.name());
        }
    }
}
