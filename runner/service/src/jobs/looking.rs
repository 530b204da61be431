//! What is known of jobs, and the journal.

use std::collections::BTreeSet;

use softplug_host::Digest;

use super::book::{Change, Sent};
use super::{Entry, EntryFilter, Job, JobFilter, Jobs, JobsError, Note, now, plain_name};

impl Jobs {
    /// A job, also one that has ended.
    ///
    /// # Errors
    /// There is none, or the database cannot be read.
    pub fn job(&self, id: u32) -> Result<Job, JobsError> {
        self.book().job(id)?.ok_or(JobsError::NotFound(id))
    }

    /// Jobs, the newest first.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn list(&self, filter: &JobFilter) -> Result<Vec<Job>, JobsError> {
        let takes = |job: &Job| {
            filter.link.as_ref().is_none_or(|link| job.order.link == *link)
                && filter.state.is_none_or(|state| job.state == state)
                && filter.kind.is_none_or(|kind| job.order.kind == kind)
                && filter.before.is_none_or(|before| job.id < before)
        };
        Ok(self.book().jobs(filter.most, takes)?)
    }

    /// Jobs that have ended, those that began: the newest of each link, and all that nobody has
    /// acknowledged, the oldest first. Reads them all: for the start.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn results(&self) -> Result<Vec<Job>, JobsError> {
        let links = std::cell::RefCell::new(BTreeSet::new());
        let takes = |job: &Job| {
            let has_ended = job.state.is_final() && job.has_begun();
            has_ended && (links.borrow_mut().insert(job.order.link.clone()) || job.is_unseen)
        };
        let mut results = self.book().jobs(usize::MAX, takes)?;
        results.reverse();
        Ok(results)
    }

    /// All jobs that have not ended, the oldest first. Asks no disk.
    pub fn live(&self) -> Vec<Job> {
        self.book().live().values().cloned().collect()
    }

    /// Writes something into the journal.
    ///
    /// # Errors
    /// It cannot be written down.
    pub fn note(&self, note: Note) -> Result<(), JobsError> {
        let change = Change { notes: vec![note.tamed()], ..Change::default() };
        Ok(self.book().write(&change, now())?)
    }

    /// Entries of the journal, the newest first.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn journal(&self, filter: &EntryFilter) -> Result<Vec<Entry>, JobsError> {
        Ok(self.book().entries(filter)?)
    }

    /// What was sent last to a link under this name, as a whole.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn last_sent(&self, link: &str, program: &str) -> Result<Option<Sent>, JobsError> {
        Ok(self.book().sent(link, plain_name(program))?)
    }

    /// The snapshots that a job or a comparison may need yet.
    ///
    /// # Errors
    /// The database cannot be read.
    pub fn needed_data(&self) -> Result<BTreeSet<Digest>, JobsError> {
        Ok(self.book().data()?.into_iter().map(|data| data.digest).collect())
    }
}
