//! Receptions: jobs that a machine begins, and answers to those that ask it.

use super::told::{note, received_note};
use super::{
    Job, Jobs, JobsError, Kind, Order, Origin, Reason, Reception, State, Step, created, live, now,
    put,
};

impl Jobs {
    /// A machine sends of its own accord: a job that is under way already.
    ///
    /// # Errors
    /// It cannot be written down.
    pub fn receive(&self, link: &str) -> Result<Job, JobsError> {
        let mut book = self.book();
        let order = Order { origin: Origin::Machine, ..Order::new(link, Kind::Receive, "") };
        let mut job = created(book.next_job(), order, State::Running);
        job.began = Some(job.created);
        let note = note(&job, format!("job {}: the machine sends", job.id));
        put(&mut book, job, vec![note])
    }

    /// What came is on the disk, under its name. Ends the job if it is a reception of the
    /// machine's own accord; notes the answer otherwise.
    ///
    /// # Errors
    /// The job is not under way, or it cannot be written down.
    pub fn received(
        &self,
        id: u32,
        name: Option<String>,
        reception: Reception,
        reason: Option<Reason>,
    ) -> Result<Job, JobsError> {
        let mut book = self.book();
        let mut job = live(&mut book, id, Step::End(State::Done))?;
        let note = received_note(&job, name.as_deref(), &reception, reason.as_ref());
        job.reception = Some(reception);
        if job.order.kind == Kind::Receive {
            job.state = if reason.is_some() { State::Failed } else { State::Done };
            job.reason = reason;
            job.order.program = name.or(job.order.program);
            job.ended = Some(now());
            job.is_unseen = job.has_ended_badly();
        }
        put(&mut book, job, vec![note])
    }
}
