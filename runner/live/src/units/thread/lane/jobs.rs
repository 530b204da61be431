//! The job of a unit's link: taken up in each session, steered, ended.

use softplug_abi::{Failure, JobId};
use softplug_unit_protocol::{Outcome, ToServer, ToUnit};

use super::{Around, UnitLane};
use crate::reactor::{JobEnd, JobOutcome, Report, UnitFigures};
use crate::text::plain_text;
use crate::units::job::UnitJob;

impl UnitLane {
    pub(super) fn take_up_job(
        &mut self,
        link: u8,
        job: u64,
        pass: u8,
        received: u64,
        is_whole: bool,
        around: &mut Around<'_>,
    ) {
        self.foreign_job = None;
        let ours = self.job.as_ref().filter(|ours| ours.is_begun).map(|ours| ours.number);
        if job != 0 && ours != Some(job) {
            // Its server is no more: as a local port's job ends with its gateway.
            self.foreign_job = Some(job);
            around.say(&ToUnit::Abort { link, job });
        }
        let Some(active) = self.job.as_mut().filter(|active| active.is_begun) else { return };
        if job != active.number {
            // It never came there, or the unit was started anew.
            let end = active.interrupted();
            if end.bytes_maybe_left == 0 && end.maybe_left == 0 && !active.is_aborted {
                active.never_came();
            } else {
                self.let_go(end, around);
            }
            return;
        }
        if pass != active.pass() {
            let id = active.job.id;
            active.rewound();
            self.report(Report::Rewind { job: id }, around);
        }
        let Some(active) = &mut self.job else { return };
        if let Err(error) = active.resume(link, received, is_whole, around.outbox) {
            self.give_up_job(&error.to_string(), around);
        }
    }

    /// Positions do not fit together: nothing more is given, and the unit aborts it.
    pub(super) fn give_up_job(&mut self, why: &str, around: &mut Around<'_>) {
        let (Some(job), Some(link)) = (&mut self.job, self.number) else { return };
        tracing::error!(why, job = job.job.id.0, "a job is aborted: the unit and we disagree");
        job.is_aborted = true;
        around.say(&ToUnit::Abort { link, job: job.number });
    }

    pub(super) fn job_of(&mut self, id: JobId) -> Option<&mut UnitJob> {
        self.job.as_mut().filter(|active| active.job.id == id)
    }

    pub(super) fn pause(&mut self, id: JobId, is_paused: bool, around: &mut Around<'_>) {
        let number = self.number;
        let Some(active) = self.job_of(id) else { return };
        active.is_paused = is_paused;
        let Some(link) = number.filter(|_| active.is_begun) else { return };
        let job = active.number;
        let message =
            if is_paused { ToUnit::Pause { link, job } } else { ToUnit::Resume { link, job } };
        around.say(&message);
    }

    pub(super) fn abort(&mut self, id: JobId, around: &mut Around<'_>) {
        let number = self.number;
        if id == JobId::NONE {
            self.plain(|link| ToUnit::Abort { link, job: 0 }, around);
            return;
        }
        let Some(active) = self.job_of(id) else { return };
        active.is_aborted = true;
        if !active.is_begun {
            let end = active.interrupted();
            self.let_go(end, around);
        } else if let Some(link) = number {
            around.say(&ToUnit::Abort { link, job: active.number });
        }
        // Else it is said when the unit is back: it feeds the machine meanwhile.
    }

    pub(super) fn unit_job(&mut self, number: u64) -> Option<&mut UnitJob> {
        self.job.as_mut().filter(|active| active.number == number)
    }

    pub(super) fn progress(&mut self, message: &ToServer<'_>, around: &Around<'_>) {
        let ToServer::Progress {
            job,
            taken,
            maybe_left,
            surely_left,
            bytes_left,
            level,
            is_held,
            is_starved,
            ..
        } = *message
        else {
            return;
        };
        let Some(active) = self.unit_job(job) else { return };
        active.left = JobEnd {
            taken,
            maybe_left,
            surely_left,
            bytes_surely_left: bytes_left,
            ..active.left.clone()
        };
        let id = active.job.id;
        if active.pass() == u8::from(active.job.check) {
            let now = around.thread.clock.now().as_secs_f64();
            self.consumption.taken(now, 8.0 * taken as f64);
        }
        self.status.store_unit_job(&UnitFigures {
            job: id,
            taken,
            maybe_left,
            surely_left,
            bytes_left,
            level: u64::from(level),
            is_held,
            is_starved,
        });
    }

    pub(super) fn ended(&mut self, number: u64, message: &ToServer<'_>, around: &mut Around<'_>) {
        let Some(link) = self.number else { return };
        around.say(&ToUnit::Noted { link, job: number });
        if self.foreign_job == Some(number) {
            self.foreign_job = None;
            self.order(around);
        }
        let Some(active) = self.unit_job(number) else { return };
        let end = active.ended(end_of(active.job.id, message));
        self.let_go(end, around);
    }

    /// The job has ended so.
    pub(super) fn let_go(&mut self, end: JobEnd, around: &Around<'_>) {
        self.job = None;
        self.consumption.ended();
        // Nothing of it must be shown any more, nor that it is held.
        self.status.store_unit_job(&UnitFigures::default());
        self.report(Report::JobEnded(end), around);
    }
}

fn end_of(job: JobId, message: &ToServer<'_>) -> JobEnd {
    let ToServer::Ended {
        outcome,
        failure,
        status,
        line,
        column,
        taken,
        sent,
        maybe_left,
        surely_left,
        bytes_maybe_left,
        bytes_surely_left,
        why,
        ..
    } = *message
    else {
        return JobEnd::unbegun(job, JobOutcome::Done, 0);
    };
    let failure = failure.unwrap_or(Failure::Internal);
    let outcome = match outcome {
        Outcome::Done => JobOutcome::Done,
        Outcome::Failed => JobOutcome::Failed { failure, status },
        Outcome::CheckFailed => JobOutcome::CheckFailed { failure, status, line, column },
        Outcome::SourceFailed => JobOutcome::SourceFailed(plain_text(why)),
    };
    JobEnd {
        job,
        outcome,
        taken,
        sent,
        maybe_left,
        surely_left,
        bytes_maybe_left,
        bytes_surely_left,
    }
}
