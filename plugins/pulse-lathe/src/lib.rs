//! Pulse lathe: a part program becomes a train of pulses, a byte for each period of 250 µs.
//!
//! The protocol's page is `docs/protocols/pulse-lathe.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod arc;
mod block;
pub mod codes;
mod cut;
mod iso;
mod job;
mod lathe;
mod line;
mod octal;
mod program;
mod queued;
mod said;
mod settings;
mod stage;
mod status;
mod thread;

pub use arc::Arc;
pub use cut::{Cut, FASTEST, feed_of_word};
pub use line::Line;
pub use settings::{Input, Settings, Underrun};
pub use thread::Thread;

use lathe::Lathe;
use softplug_plugin::{
    Context, Converter, Failure, JobId, JobStart, LineErrorKind, LinkDownReason, MarkId, MarkState,
    Micros, NoteLevel, Opening, StateError, StateReader, StateWriter,
};

/// Timer: the echo of S, T or M.
const ECHO: u8 = 0;
/// Timer: goes on with what took long.
const TICK: u8 = 1;

/// The converter.
#[derive(Debug)]
pub struct PulseLathe {
    lathe: Lathe,
    /// The state that the host knows.
    named: Option<&'static str>,
}

softplug_plugin::export!(PulseLathe);

impl Converter for PulseLathe {
    type Settings = Settings;
    const MANIFEST: &'static str = settings::MANIFEST;
    const STATE_FORMAT: Option<u16> = Some(2);
    /// A whole program is in it.
    const STATE_CAPACITY: usize = 8_192;

    fn new(settings: Settings) -> Self {
        Self { lathe: Lathe::new(settings), named: None }
    }

    fn opened(&mut self, link: &mut Context<'_>, opening: &Opening) {
        self.lathe.opened(link, opening.resumed);
        self.name_state(link);
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        self.lathe.received(link, bytes);
        self.name_state(link);
    }

    fn line_error(
        &mut self,
        link: &mut Context<'_>,
        kind: LineErrorKind,
        _byte: Option<u8>,
        _span: u32,
    ) {
        link.note(NoteLevel::Warning, u16::from(kind.code()), kind.text());
    }

    fn link_down(&mut self, link: &mut Context<'_>, _reason: LinkDownReason) {
        self.lathe.stop(link, Failure::LinkDown, 0);
        self.name_state(link);
    }

    fn timer(&mut self, link: &mut Context<'_>, id: u8, _deadline: Micros) {
        if self.lathe.ran_out(id) {
            match id {
                ECHO => self.lathe.stop(link, Failure::NoAnswer, 0),
                _ => self.lathe.work(link),
            }
        }
        self.name_state(link);
    }

    fn mark(&mut self, link: &mut Context<'_>, mark: MarkId, state: MarkState) {
        self.lathe.marked(link, mark, state);
        self.name_state(link);
    }

    fn transmit_room(&mut self, link: &mut Context<'_>) {
        self.lathe.work(link);
        self.name_state(link);
    }

    fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        self.lathe.discarded(link, bytes);
        self.name_state(link);
    }

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        self.lathe.begin(link, &job);
        self.name_state(link);
    }

    fn job_data(&mut self, link: &mut Context<'_>, _job: JobId, bytes: &[u8]) {
        self.lathe.data(link, bytes);
        self.name_state(link);
    }

    fn job_end(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.lathe.data_ended(link);
        self.name_state(link);
    }

    fn pause(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.lathe.is_paused = true;
        self.lathe.update_hold(link);
    }

    fn resume(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.lathe.is_paused = false;
        self.lathe.go(link);
        self.name_state(link);
    }

    fn abort(&mut self, link: &mut Context<'_>, job: JobId) {
        // 0 is a delivery, of which there is none here.
        if job != JobId::NONE {
            self.lathe.stop(link, Failure::Aborted, 0);
        }
        self.name_state(link);
    }

    fn force_resume(&mut self, link: &mut Context<'_>) {
        self.lathe.is_held = false;
        self.lathe.go(link);
        self.name_state(link);
    }

    fn save(&self, state: &mut StateWriter<'_>) {
        self.lathe.save(state);
    }

    fn restore(&mut self, format: u16, state: &mut StateReader<'_>) -> Result<(), StateError> {
        if Some(format) != Self::STATE_FORMAT {
            return Err(StateError::FORMAT);
        }
        self.lathe.restore(state);
        Ok(())
    }
}

impl PulseLathe {
    fn name_state(&mut self, link: &mut Context<'_>) {
        let name = self.lathe.stage.name();
        if self.named != Some(name) {
            self.named = Some(name);
            link.state(name);
        }
    }
}
