//! FANUC-style RS-232: the reader/punch interface and the remote buffer.
//!
//! The protocol's page is `docs/protocols/fanuc-rs232.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod code;
mod feed;
mod punch;
mod reason;
mod remote_buffer;
mod request;
mod settings;
mod short;
mod state;
mod tape;
mod timer;

pub use settings::{
    AfterEnd, BlockNumbers, Eob, LineEnd, Mode, OnLineError, OutputFlow, PacketEnd, ParityMode,
    Programs, ReceiveCode, ResumeCode, SendCode, Settings, Unsupported,
};

use code::{Code, Control, control};
use feed::Feed;
use punch::Punch;
use remote_buffer::RemoteBuffer;
use softplug_plugin::{
    Context, Converter, Failure, JobId, JobStart, LineErrorKind, LinkDownReason, MarkId, MarkState,
    Micros, ModemLines, NoteLevel, Opening, Pass, RequestId, StateError, StateReader, StateWriter,
    Unread,
};
use state::State;
use tape::Setup;
use zerocopy::{FromZeros, Immutable, IntoBytes, TryFromBytes};

/// Timer: the capture ends by silence, or after DC4. The feed has 0 to 3.
const CAPTURE: u8 = 4;
/// Timer: the remote buffer is silent, or waits for us.
const PACKET: u8 = 5;

/// What one character can bring of actions, and what follows the last one of an
/// event: a packet, or a capture's text, name, end and request.
const OUTPUT_RESERVE: usize = 1_800;

/// The converter.
#[derive(Debug)]
pub struct FanucRs232 {
    settings: Setup,
    kept: Kept,
    /// The remote buffer has the job that is carried out.
    is_packets: bool,
    /// A job has been sent in this event or after the one before.
    was_sending: bool,
    unread: Unread,
    /// The state that the host knows.
    named: Option<State>,
}

/// All that is saved: plain data, so that its bytes are the state.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
struct Kept {
    feed: Feed,
    punch: Punch,
    remote_buffer: RemoteBuffer,
    is_dsr_on: bool,
    spare: [u8; 7],
}

softplug_plugin::export!(FanucRs232);

impl Converter for FanucRs232 {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;
    const STATE_FORMAT: Option<u16> = Some(1);

    fn check_settings(settings: &Settings) -> Result<(), &'static str> {
        settings.check()
    }

    fn new(settings: Settings) -> Self {
        let mut kept = Kept::new_zeroed();
        kept.remote_buffer.begin();
        Self {
            settings: Setup::new(&settings),
            kept,
            is_packets: settings.mode == Mode::RemoteA,
            was_sending: false,
            unread: Unread::new(),
            named: None,
        }
    }

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        if opening.resumed {
            self.kept.feed.set_timers(link);
            self.kept.punch.set_timers(link);
            self.kept.remote_buffer.set_timers(link);
        } else {
            self.kept.punch.flow.raise_marks(opening.delivery_room);
        }
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        let mut rest = bytes;
        while let Some((byte, after)) = rest.split_first()
            && link.output_room() >= OUTPUT_RESERVE
        {
            self.byte(link, *byte);
            rest = after;
        }
        self.unread.keep(link, rest);
        self.kept.punch.after_bytes(link, &self.settings);
    }

    fn more(&mut self, link: &mut Context<'_>) {
        let unread = self.unread;
        self.received(link, unread.bytes());
    }

    fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        byte: Option<u8>,
        span: u32,
    ) {
        link.note(NoteLevel::Warning, u16::from(kind.code()), "line error");
        // With a span the character was given already.
        let byte = if span == 0 { byte } else { None };
        if self.is_packets {
            self.kept.remote_buffer.damaged(
                link,
                &self.settings,
                &mut self.kept.feed.encoder,
                byte,
            );
        } else {
            self.kept.punch.line_error(link, &self.settings, kind, byte);
        }
        self.kept.punch.after_bytes(link, &self.settings);
    }

    fn modem_lines(&mut self, link: &mut Context<'_>, known: ModemLines, on: ModemLines) {
        let is_on = on.contains(ModemLines::DSR);
        let is_lost = self.kept.is_dsr_on && !is_on && known.contains(ModemLines::DSR);
        self.kept.is_dsr_on = is_on;
        if is_lost && self.settings.watch_dsr {
            self.kept.feed.lost(link, Failure::PartnerGone);
            self.kept.remote_buffer.lost(link, Failure::PartnerGone);
            self.kept.punch.finish(link, &self.settings, Some(Failure::PartnerGone));
        }
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.kept.feed.link_down(link);
        if self.is_packets {
            self.kept.remote_buffer.link_down(link);
        }
        self.kept.punch.finish(link, &self.settings, Some(Failure::LinkDown));
    }

    fn link_up(&mut self, link: &mut Context<'_>) {
        self.kept.punch.flow.let_go(link, &self.settings);
        self.kept.punch.hear();
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        match id {
            CAPTURE => self.kept.punch.finish(link, &self.settings, None),
            PACKET => self.kept.remote_buffer.timer(link, &self.settings, &self.kept.feed.encoder),
            _ => self.kept.feed.timer(link),
        }
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        self.kept.punch.mark(link, mark, state);
        if self.is_packets {
            self.kept.remote_buffer.mark(link, &self.settings, state);
        } else {
            self.kept.feed.mark(link, &self.settings, mark, state);
        }
    }

    fn transmit_room(&mut self, link: &mut Context<'_>) {
        self.kept.feed.go_on(link, &self.settings);
    }

    fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        self.kept.remote_buffer.discarded(link, bytes);
        self.kept.feed.discarded(link, &self.settings, bytes);
    }

    fn delivery_room(&mut self, link: &mut Context<'_>) {
        self.kept.punch.drained(link, &self.settings);
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        let is_free = !self.kept.feed.is_busy() && self.kept.remote_buffer.state().is_none();
        if is_free && job.pass == Pass::Check {
            // A job before may have failed in its check while it was paused.
            self.set_paused(link, false);
        }
        // The feed does every check, and refuses what is no program.
        if self.is_packets && job.pass == Pass::Run && job.kind == 0 {
            self.kept.remote_buffer.job_begin(
                link,
                &self.settings,
                &mut self.kept.feed.encoder,
                &job,
            );
        } else {
            self.kept.feed.job_begin(link, &self.settings, &job);
            self.end_output(link);
        }
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: JobId, bytes: &[u8]) {
        if self.kept.remote_buffer.state().is_some() {
            self.kept.remote_buffer.job_data(
                link,
                &self.settings,
                &mut self.kept.feed.encoder,
                bytes,
            );
        } else {
            self.kept.feed.job_data(link, &self.settings, bytes);
        }
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: JobId) {
        if self.kept.remote_buffer.state().is_some() {
            self.kept.remote_buffer.job_end(link, &self.settings, &mut self.kept.feed.encoder);
        } else {
            self.kept.feed.job_end(link, &self.settings);
        }
    }

    fn pause(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.set_paused(link, true);
    }

    fn resume(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.set_paused(link, false);
    }

    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        if job == JobId::NONE {
            self.kept.punch.abort(link, &self.settings);
        } else {
            self.kept.remote_buffer.fail(link, Failure::Aborted);
            self.kept.feed.stop(link, Failure::Aborted);
        }
    }

    fn force_resume(&mut self, link: &mut Context<'_>) {
        // As the DC1 that was lost it ends a capture: the control reads again.
        if matches!(self.kept.feed.state(), Some(State::WaitingForDc1 | State::Held)) {
            self.kept.punch.finish(link, &self.settings, None);
        }
        self.kept.feed.force_resume(link, &self.settings);
        self.end_output(link);
    }

    fn answer(
        &mut self,
        link: &mut Context<'_>,
        _request: RequestId,
        answer: Result<&[u8], Failure>,
        more: bool,
    ) {
        self.kept.punch.requests.answered(link, answer.err(), more);
    }

    fn after(&mut self, link: &mut Context<'_>) {
        let is_sending = self.kept.feed.is_sending();
        if core::mem::replace(&mut self.was_sending, is_sending) && !is_sending {
            self.kept.punch.deafen(link, &self.settings);
        }
        let state =
            self.kept.punch.state().or(self.kept.feed.state()).or(self.kept.remote_buffer.state());
        let state = state.unwrap_or(State::Idle);
        if self.named != Some(state) {
            self.named = Some(state);
            link.state(state.name());
        }
    }

    fn save(&self, state: &mut StateWriter<'_>) {
        state.bytes(self.kept.as_bytes());
    }

    fn restore(&mut self, format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
        if Some(format) != Self::STATE_FORMAT {
            return Err(StateError::DAMAGED);
        }
        let bytes = state.bytes(size_of::<Kept>());
        self.kept = Kept::try_read_from_bytes(bytes).map_err(|_| StateError::DAMAGED)?;
        self.was_sending = self.kept.feed.is_sending();
        Ok(())
    }
}

impl FanucRs232 {
    fn byte(&mut self, link: &mut Context<'_>, byte: u8) {
        let settings = &self.settings;
        if self.is_packets {
            self.kept.remote_buffer.byte(link, settings, &mut self.kept.feed.encoder, byte);
            return;
        }
        let is_capturing = self.kept.punch.is_capturing();
        let (code, is_sending) = if is_capturing {
            (self.kept.punch.code(), false)
        } else {
            let code = if settings.code == SendCode::Eia { Code::Eia } else { Code::Iso };
            (code, self.kept.feed.is_sending())
        };
        let state = self.kept.feed.state();
        match control(settings, code, byte, is_sending) {
            // The control reads: it does not punch, unless it holds us. So this is
            // an echo, or damaged.
            Some(Control::Dc2) if is_sending && state != Some(State::Held) => {}
            Some(control) => {
                let is_awaited = matches!(state, Some(State::WaitingForDc1 | State::Held));
                // It punches: a DC1 that it said before was for a reading that has ended.
                self.kept.feed.is_ready &= control != Control::Dc2;
                if !self.kept.punch.control(link, settings, control, is_awaited) {
                    self.kept.feed.control(link, settings, control);
                    self.was_sending |= self.kept.feed.is_sending();
                    self.end_output(link);
                }
            }
            // While we send, and as the job ends, it is an echo.
            None if !is_sending && (is_capturing || state != Some(State::Stopping)) => {
                self.kept.punch.byte(link, settings, byte);
                // If it begins a capture, a DC1 before it is for no job to come.
                self.kept.feed.is_ready &= is_capturing || !self.kept.punch.is_capturing();
            }
            None => {}
        }
    }

    /// A control that reads puts nothing out.
    fn end_output(&mut self, link: &mut Context<'_>) {
        if self.kept.feed.is_reading() {
            self.kept.punch.flow.end(link, &self.settings);
        }
    }

    #[inline(never)]
    fn set_paused(&mut self, link: &mut Context<'_>, is_paused: bool) {
        self.kept.feed.set_paused(link, is_paused);
        self.kept.remote_buffer.set_paused(is_paused);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::mem::offset_of;
    use softplug_plugin::SettingSet;

    #[test]
    fn a_state_of_another_length_or_with_an_impossible_value_is_refused() {
        let state = FanucRs232::new(Settings::UNSET).kept.as_bytes().to_vec();
        assert!(Kept::try_read_from_bytes(&state).is_ok());
        assert!(Kept::try_read_from_bytes(&state[1..]).is_err());
        let mut damaged = state.clone();
        damaged[offset_of!(Kept, is_dsr_on)] = 2;
        assert!(Kept::try_read_from_bytes(&damaged).is_err());
    }
}
