//! The job under way: its data is pulled block by block.

use crate::cause::{Cause, Kept};
use softplug_plugin::parts::Block;
use softplug_plugin::{Context, JobId, State};

/// Largest block in bytes, of data or of a telegram.
pub(crate) const BLOCK: usize = 1_024;

/// What a job is at.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, State)]
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
#[derive(Debug, State)]
pub(crate) struct Job {
    pub(crate) stage: Stage,
    pub(crate) id: JobId,
    /// Place of its kind in the manifest.
    pub(crate) kind: u16,
    /// Bytes that left for it, or are about to.
    pub(crate) sent: u64,
    /// All data was given.
    pub(crate) ended: bool,
    pub(crate) paused: bool,
    /// Why it fails.
    pub(crate) failing: Kept,
    pub(crate) block: Block<BLOCK>,
}

impl Job {
    pub(crate) const fn none() -> Self {
        Self {
            stage: Stage::None,
            id: JobId::NONE,
            kind: 0,
            sent: 0,
            ended: false,
            paused: false,
            failing: Kept(None),
            block: Block::new(),
        }
    }

    /// Forgets the job before this one.
    pub(crate) fn begin(&mut self, id: JobId, kind: u16) {
        self.stage = Stage::Filling;
        self.id = id;
        self.kind = kind;
        self.sent = 0;
        self.ended = false;
        self.paused = false;
        self.failing = Kept(None);
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
        self.failing = Kept(None);
        link.job_failed(self.id, cause.failure(), cause.status(), self.sent);
    }
}
