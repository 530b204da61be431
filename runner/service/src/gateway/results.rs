//! How jobs ended: the last one of each link, and those that nobody has acknowledged.

use softplug_abi::JobId;
use std::collections::BTreeMap;

use super::Control;
use crate::Refusal;
use crate::jobs::{Job, Jobs, JobsError};
use crate::view::{JobBrief, JobView};

/// Results of a link that are shown; the others are counted.
const SHOWN: usize = 10;

/// How the jobs of all links ended.
#[derive(Debug, Default)]
pub(super) struct Results(BTreeMap<String, Ended>);

/// How the jobs of one link ended.
#[derive(Debug, Default)]
struct Ended {
    last: Option<Job>,
    /// By number.
    unseen: BTreeMap<JobId, Job>,
}

impl Results {
    /// As they were written down. Reads all jobs.
    pub(super) fn of(jobs: &Jobs) -> Result<Self, JobsError> {
        let mut results = Self::default();
        for job in jobs.reader().results()? {
            results.take(&job);
        }
        Ok(results)
    }

    /// A job may have ended, or been acknowledged.
    pub(super) fn take(&mut self, job: &Job) {
        if !job.state.is_final() || !job.has_begun() {
            return;
        }
        let link = self.0.entry(job.spec.link.clone()).or_default();
        if job.is_unseen {
            link.unseen.insert(job.id, job.clone());
        } else {
            link.unseen.remove(&job.id);
        }
        // Not by number: one of a higher priority may have been begun before.
        if link.last.as_ref().is_none_or(|last| last.id == job.id || last.ended <= job.ended) {
            link.last = Some(job.clone());
        }
    }

    /// The job of a link that ended last.
    pub(super) fn last(&self, link: &str) -> Option<JobBrief> {
        Some(self.0.get(link)?.last.as_ref()?.brief(None))
    }

    /// The newest that nobody has acknowledged, and how many there are.
    pub(super) fn unseen(&self, link: &str) -> (Vec<JobBrief>, u32) {
        let Some(link) = self.0.get(link) else { return (Vec::new(), 0) };
        let newest = link.unseen.values().rev().take(SHOWN).map(|job| job.brief(None));
        (newest.collect(), link.unseen.len() as u32)
    }

    /// This job of a link and those before it, as far as nobody has acknowledged them.
    fn up_to(&self, link: &str, job: JobId) -> Vec<Job> {
        let link = self.0.get(link);
        link.map_or_else(Vec::new, |link| {
            link.unseen.range(..=job).map(|(_, job)| job.clone()).collect()
        })
    }
}

impl Control {
    /// Somebody has seen how a job ended, and with it those of its link before it.
    pub(super) fn acknowledge(&mut self, id: JobId) -> Result<JobView, Refusal> {
        let job = self.shared.parts.jobs.reader().job(id)?;
        if !job.state.is_final() {
            let state = job.state.name();
            let text = format!("job {id} is {state}: it can be acknowledged when it has ended");
            return Err(Refusal::Conflict(text));
        }
        let unseen = self.results.up_to(&job.spec.link, id);
        for seen in self.shared.parts.jobs.acknowledge(&unseen)? {
            self.show_job(&seen);
        }
        let job = self.shared.parts.jobs.reader().job(id)?;
        Ok(self.job_view(&job))
    }
}
