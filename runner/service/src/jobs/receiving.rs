//! Receptions: jobs that a machine begins, and answers to those that ask it.

use super::store::{Change, look};
use super::told::{note, received_note};
use super::{
    FromUnit, Job, JobSpec, Jobs, JobsError, Kind, Note, Origin, Reason, Reception, State, Step,
    Subject, Today, Weight, created, live, now,
};
use softplug_abi::JobId;

impl Jobs {
    /// A machine sends of its own accord: a job that is under way already.
    ///
    /// # Errors
    /// It cannot be written down.
    pub fn receive(&self, link: &str) -> Result<Job, JobsError> {
        let mut store = self.store();
        let spec = JobSpec { origin: Origin::Machine, ..JobSpec::new(link, Kind::Receive, "") };
        let mut job = created(JobId(store.next_job()), spec, State::Running);
        job.began = Some(job.created);
        let notes = vec![note(&job, format!("job {}: the machine sends", job.id))];
        let came = Some((link.to_owned(), 1, 0));
        let change = Change { jobs: vec![job.clone()], notes, came, ..Change::default() };
        store.write(&change, now())?;
        Ok(job)
    }

    /// What came is on the disk, under its name. Ends the job if it is a reception of the
    /// machine's own accord; notes the answer otherwise. `unit`: the delivery of a unit that it was,
    /// which counts as stored from now on.
    ///
    /// # Errors
    /// The job is not under way, or it cannot be written down.
    pub fn received(
        &self,
        id: JobId,
        name: Option<String>,
        reception: Reception,
        reason: Option<Reason>,
        unit: Option<FromUnit>,
    ) -> Result<Job, JobsError> {
        let mut store = self.store();
        let mut job = live(&store, id, Step::End(State::Done))?;
        let note = received_note(&job, name.as_deref(), &reception, reason.as_ref());
        // An answer is begun by its job, and counted here.
        let receptions = u64::from(job.spec.kind != Kind::Receive);
        let came = Some((job.spec.link.clone(), receptions, reception.bytes));
        job.reception = Some(reception);
        if job.spec.kind == Kind::Receive {
            job.state = if reason.is_some() { State::Failed } else { State::Done };
            job.reason = reason;
            job.spec.program = name.or(job.spec.program);
            job.ended = Some(now());
            job.is_unseen = job.has_ended_badly();
        }
        let (jobs, notes) = (vec![job.clone()], vec![note]);
        let change = Change { jobs, notes, came, stored: unit, ..Change::default() };
        store.write(&change, now())?;
        Ok(job)
    }

    /// What a link has received today.
    pub fn today(&self, link: &str) -> Today {
        look(&self.known).today(link, now())
    }

    /// The gateway was killed before anything of it was on the disk: what had come is lost.
    ///
    /// # Errors
    /// It cannot be written down.
    pub fn lost(&self, id: JobId) -> Result<(), JobsError> {
        let mut store = self.store();
        let Some(mut job) = store.job(id)? else { return Ok(()) };
        let text = "the gateway ended in the middle of it; nothing of it is on the disk";
        job.reason = Some(Reason::new("interrupted", text));
        let text = format!("job {id}: what came is lost: {text}");
        let note = Note::new(Subject::Reception, text).of_link(&*job.spec.link).of_job(id);
        let (jobs, notes) = (vec![job], vec![note.weighing(Weight::Warning)]);
        Ok(store.write(&Change { jobs, notes, ..Change::default() }, now())?)
    }

    /// What came before the gateway was killed is on the disk as failed: the job that it belongs
    /// to says so. One that is not known any more gets a job of its own, if its link is known.
    ///
    /// # Errors
    /// It cannot be written down.
    pub fn recovered(
        &self,
        id: JobId,
        link: Option<&str>,
        file: String,
        bytes: u64,
    ) -> Result<(), JobsError> {
        let mut store = self.store();
        let reception = Reception { file: Some(file), bytes, is_complete: false, compared: None };
        let reason = Reason::new("interrupted", "the gateway ended in the middle of it");
        let is_of_link = |job: &Job| link.is_none_or(|link| job.spec.link == link);
        let found = store.job(id)?.filter(is_of_link).filter(|job| job.reception.is_none());
        let mut job = match (found, link) {
            (Some(job), _) => job,
            (None, Some(link)) => {
                let spec =
                    JobSpec { origin: Origin::Machine, ..JobSpec::new(link, Kind::Receive, "") };
                let mut job = created(JobId(store.next_job()), spec, State::Interrupted);
                (job.began, job.ended) = (Some(job.created), Some(job.created));
                job.reason = Some(reason.clone());
                job.is_unseen = job.has_ended_badly();
                job
            }
            (None, None) => return Ok(()),
        };
        let notes = vec![received_note(&job, None, &reception, Some(&reason))];
        let came = Some((job.spec.link.clone(), 0, bytes));
        job.reception = Some(reception);
        let change = Change { jobs: vec![job], notes, came, ..Change::default() };
        Ok(store.write(&change, now())?)
    }
}
