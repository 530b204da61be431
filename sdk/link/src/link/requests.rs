//! What the host asks of a plug-in.

use super::Link;
use crate::LinkHost;
use crate::fault::LinkFault;
use crate::job::{ActiveJob, Job};
use softplug_abi::{Action, Event, Failure, Instance, JobId, Micros, RequestId, Values};

/// Bytes of a job's beginning before its fields.
const JOB_BEGIN_HEAD: usize = 16;

/// Whether the beginning of a job with these fields fits no event.
pub(crate) fn is_too_long(fields: &[u8], input_capacity: usize) -> bool {
    fields.len() + JOB_BEGIN_HEAD > input_capacity
}

impl<I: Instance> Link<I> {
    /// Begins a job. One that finds another under way fails as busy, one whose
    /// fields do not fit an event as a bad job.
    pub fn begin_job(
        &mut self,
        now: Micros,
        job: Job,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.handle_timeout(now, host)?;
        self.steps = 0;
        let too_long = is_too_long(&job.fields, self.instance.input_capacity());
        let failure = match &self.core.job {
            Some(_) => Some(Failure::Busy),
            None => too_long.then_some(Failure::BadJob),
        };
        if let Some(failure) = failure {
            let refused = Action::JobFailed { job: job.id, failure, status: 0, sent: 0 };
            host.handle(self.now, &refused);
            return Ok(());
        }
        self.core.job = Some(ActiveJob::new(job));
        self.core.fed.begin();
        self.begin_event(host)?;
        self.handle_timeout(now, host)
    }

    pub(crate) fn begin_event(
        &mut self,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        let Some(active) = &self.core.job else { return Ok(()) };
        let Job { id, kind, size, fields, .. } = active.job.clone();
        let pass = active.pass;
        let fields = Values::new(&fields);
        self.step(&Event::JobBegin { job: id, kind, pass, size, fields }, host)
    }

    /// Asks for a pause of the job.
    pub fn pause(
        &mut self,
        now: Micros,
        job: JobId,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.request_of_job(now, job, &Event::Pause { job }, host)
    }

    /// Ends the pause.
    pub fn resume(
        &mut self,
        now: Micros,
        job: JobId,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.request_of_job(now, job, &Event::Resume { job }, host)
    }

    /// Aborts the job, or, with 0, the delivery under way.
    pub fn abort(
        &mut self,
        now: Micros,
        job: JobId,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.request_of_job(now, job, &Event::Abort { job }, host)
    }

    /// A job that has ended in the meantime is no longer asked anything.
    fn request_of_job(
        &mut self,
        now: Micros,
        job: JobId,
        event: &Event<'_>,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.handle_timeout(now, host)?;
        self.steps = 0;
        if job != JobId::NONE && self.job() != Some(job) {
            return Ok(());
        }
        self.step(event, host)?;
        self.handle_timeout(now, host)
    }

    /// Goes on although the partner holds the line.
    pub fn force_resume(
        &mut self,
        now: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.handle_timeout(now, host)?;
        self.steps = 0;
        self.step(&Event::ForceResume, host)?;
        self.handle_timeout(now, host)
    }

    /// Answers a request: with data, or with why it is refused. An answer to a
    /// request that was withdrawn is dropped.
    pub fn answer(
        &mut self,
        now: Micros,
        request: RequestId,
        answer: Result<&[u8], Failure>,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.handle_timeout(now, host)?;
        self.steps = 0;
        let (refused, bytes) = match answer {
            Ok(bytes) => (None, bytes),
            Err(failure) => (Some(failure), [].as_slice()),
        };
        let mut rest = bytes;
        loop {
            let most = self.capacity() - 8;
            let (piece, later) = rest.split_at(rest.len().min(most));
            rest = later;
            let more = !rest.is_empty();
            if self.core.awaits_answer(request, !more) {
                self.step(&Event::Answer { request, refused, more, bytes: piece }, host)?;
                self.give_due(host)?;
            }
            if !more {
                return self.handle_timeout(now, host);
            }
        }
    }
}
