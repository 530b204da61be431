//! The job under way: its data is pulled block by block.

use crate::block::Block;
use crate::cause::Cause;
use softplug_plugin::{Context, StateError, StateReader, StateWriter};

/// Largest block in bytes, of data or of a telegram.
pub(crate) const BLOCK: usize = 1_024;

/// What a job is at.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub(crate) enum Stage {
    /// There is no job.
    #[default]
    None,
    /// Data is missing for the next block.
    Filling,
    /// The block may be sent.
    Ready,
    /// It is on the line, or was and will be again: a pause does not stop it.
    Begun,
    /// The partner has the telegram; its reaction is still to come.
    Awaiting,
    /// It fails as soon as it is known how much left for it.
    Failing,
}

/// The job, with the block that is sent for it.
#[derive(Debug)]
#[repr(C)]
pub(crate) struct Job {
    pub(crate) stage: Stage,
    pub(crate) id: u32,
    /// Place of its kind in the manifest.
    pub(crate) kind: u16,
    /// Bytes that left for it, or are about to.
    pub(crate) sent: u64,
    /// All data was given.
    pub(crate) ended: bool,
    pub(crate) paused: bool,
    /// Why it fails.
    pub(crate) failing: Option<Cause>,
    pub(crate) block: Block<BLOCK>,
}

impl Job {
    pub(crate) const fn none() -> Self {
        Self {
            stage: Stage::None,
            id: 0,
            kind: 0,
            sent: 0,
            ended: false,
            paused: false,
            failing: None,
            block: Block::new(),
        }
    }

    /// Forgets the job before this one.
    pub(crate) fn begin(&mut self, id: u32, kind: u16) {
        self.stage = Stage::Filling;
        self.id = id;
        self.kind = kind;
        self.sent = 0;
        self.ended = false;
        self.paused = false;
        self.failing = None;
        self.block.clear();
    }

    /// Whether its block may go onto the line.
    pub(crate) fn may_send(&self) -> bool {
        match self.stage {
            Stage::Ready => !self.paused,
            Stage::Begun => true,
            Stage::None | Stage::Filling | Stage::Awaiting | Stage::Failing => false,
        }
    }

    pub(crate) fn done(&mut self, link: &mut Context<'_>) {
        self.stage = Stage::None;
        link.job_done(self.id, self.sent);
    }

    #[inline(never)]
    pub(crate) fn failed(&mut self, link: &mut Context<'_>, cause: Cause) {
        self.stage = Stage::None;
        self.failing = None;
        link.job_failed(self.id, cause.failure(), cause.status(), self.sent);
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u8(self.stage as u8);
        state.u32(self.id);
        state.u16(self.kind);
        state.u64(self.sent);
        state.bool(self.ended);
        state.bool(self.paused);
        Cause::save(self.failing, state);
        self.block.save(state);
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) -> Result<(), StateError> {
        self.stage = match state.u8() {
            0 => Stage::None,
            1 => Stage::Filling,
            2 => Stage::Ready,
            3 => Stage::Begun,
            4 => Stage::Awaiting,
            5 => Stage::Failing,
            _ => return Err(StateError::DAMAGED),
        };
        self.id = state.u32();
        self.kind = state.u16();
        self.sent = state.u64();
        self.ended = state.bool();
        self.paused = state.bool();
        self.failing = Cause::restore(state);
        self.block.restore(state)
    }
}
