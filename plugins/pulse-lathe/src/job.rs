//! A job: its text comes in, is checked, and its end is told.

use crate::lathe::Lathe;
use crate::stage::Stage;
use crate::{ECHO, TICK};
use softplug_plugin::{Context, Failure, JobStart, NoteLevel, Pass};

impl Lathe {
    pub(crate) fn begin(&mut self, link: &mut Context<'_>, job: &JobStart<'_>) {
        if self.stage != Stage::Idle {
            link.job_failed(job.job, Failure::Busy, 0, 0);
            return;
        }
        if job.kind != 0 {
            link.job_failed(job.job, Failure::NotSupported, 0, 0);
            return;
        }
        self.job = job.job;
        self.wanted = 0;
        self.program.clear(self.queued.x, self.queued.z);
        if job.pass == Pass::Check {
            self.stage = Stage::Checking;
        } else {
            self.prepare();
            self.stage = Stage::Loading;
            if self.program.is_streamed() {
                self.start();
            }
            self.update_hold(link);
        }
        self.ask(link);
    }

    /// Nothing of a job before is left, but where the axes stand.
    fn prepare(&mut self) {
        (self.queued.count, self.left) = (0, 0);
        (self.seen, self.mark_before) = (self.mark, self.mark);
        self.step = 0;
        (self.speed, self.tool, self.offset) = (None, None, (0, 0));
        (self.cut, self.dwell, self.block) = (None, 0, crate::block::Block::default());
        self.underruns = 0;
    }

    fn start(&mut self) {
        self.stage = Stage::Running;
        if self.settings.start_block > 1 {
            self.stage = Stage::Rebuilding;
            self.rebuilt = (self.queued.x, self.queued.z);
        }
    }

    /// Asks for as much text as can be taken.
    pub(crate) fn ask(&mut self, link: &mut Context<'_>) {
        let takes_text = match self.stage {
            Stage::Idle | Stage::Stopping(..) | Stage::Ending => false,
            Stage::Checking | Stage::Loading => true,
            _ => !self.program.has_ended(),
        };
        let room = self.program.room() as u32;
        if takes_text && self.wanted == 0 && room > 0 {
            link.want(self.job, room);
            self.wanted = room;
        }
    }

    pub(crate) fn data(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        self.wanted = self.wanted.saturating_sub(bytes.len() as u32);
        if matches!(self.stage, Stage::Idle | Stage::Stopping(..) | Stage::Ending) {
            return;
        }
        let taken = self.program.text(bytes, &self.settings);
        self.go_on(link, taken);
    }

    pub(crate) fn data_ended(&mut self, link: &mut Context<'_>) {
        if matches!(self.stage, Stage::Idle | Stage::Stopping(..) | Stage::Ending) {
            return;
        }
        let taken = self.program.text_ended(&self.settings);
        let is_good = self.go_on(link, taken);
        match self.stage {
            Stage::Checking if is_good => {
                self.stage = Stage::Idle;
                link.check_good(self.job);
            }
            Stage::Loading if is_good => {
                self.start();
                self.work(link);
            }
            _ => {}
        }
    }

    /// After text has come. Returns whether it was good.
    fn go_on(&mut self, link: &mut Context<'_>, taken: Result<(), crate::block::Bad>) -> bool {
        let checked = match self.stage {
            Stage::Checking => taken.and_then(|()| self.program.check(&self.settings)),
            _ => taken,
        };
        if let Err(bad) = checked {
            if self.stage == Stage::Checking {
                let failure = Failure::BadJob;
                link.check_failed_with(self.job, failure, bad.status, bad.line, bad.column);
                self.finish(link);
            } else {
                self.stop(link, Failure::BadJob, bad.status);
            }
            return false;
        }
        self.ask(link);
        self.work(link);
        true
    }

    /// Stops at once and drops what is queued; the job fails when it is known how much that was.
    pub(crate) fn stop(&mut self, link: &mut Context<'_>, failure: Failure, status: u16) {
        match self.stage {
            Stage::Idle | Stage::Stopping(..) => {}
            Stage::Checking | Stage::Loading => {
                link.job_failed(self.job, failure, status, 0);
                self.finish(link);
            }
            _ => {
                link.discard();
                self.cancel(link, ECHO);
                self.cancel(link, TICK);
                self.stage = Stage::Stopping(failure, status);
            }
        }
    }

    pub(crate) fn discarded(&mut self, link: &mut Context<'_>, bytes: u32) {
        let Stage::Stopping(failure, status) = self.stage else { return };
        self.queued.drop_last(bytes);
        link.job_failed(self.job, failure, status, self.queued.count);
        self.finish(link);
        if failure != Failure::LinkDown {
            // Not of the queue: what is dropped of it belongs to jobs alone.
            self.said.stop(link);
        }
    }

    pub(crate) fn done(&mut self, link: &mut Context<'_>) {
        link.job_done(self.job, self.queued.count);
        self.finish(link);
    }

    fn finish(&mut self, link: &mut Context<'_>) {
        self.stage = Stage::Idle;
        self.wanted = 0;
        (self.is_paused, self.is_held) = (false, false);
        self.update_hold(link);
    }

    /// The queue ran empty inside a cut.
    pub(crate) fn underrun(&mut self, link: &mut Context<'_>) {
        self.underruns += 1;
        let code = self.underruns.min(u32::from(u16::MAX)) as u16;
        link.note(NoteLevel::Error, code, "underrun: the queue ran empty inside a cut");
    }
}
