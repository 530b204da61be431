//! Jobs and entries as they are shown.

use super::{Entry, EntryFilter, Job, JobFilter, JobSpec, LaneProgress};
use crate::view::{self, JobBrief, JobView, JournalEntry};
use softplug_abi::JobId;

/// What a list has if nothing is said, and at most.
const LISTED: (u32, u32) = (100, 1_000);

impl Job {
    /// As it is shown. `lately`: what its lane knows, while it is under way.
    pub fn view(&self, lane_progress: Option<&LaneProgress>) -> JobView {
        let JobSpec { link, job_kind, fields, program, .. } = self.spec.clone();
        let named = self.other_name().map(ToOwned::to_owned);
        JobView {
            id: self.id.0,
            link,
            kind: kind_name(job_kind),
            state: self.state,
            origin: self.spec.origin,
            program,
            named,
            fields: fields.into_iter().collect(),
            priority: self.spec.priority,
            progress: self.progress(lane_progress),
            start_byte: self.spec.from,
            start_block: self.spec.from_block,
            sent: self.sent,
            last_block: None,
            created_ms: self.created,
            started_ms: self.began,
            ended_ms: self.ended,
            failure: self.reason.as_ref().map(|reason| reason.failure.clone()),
            message: self.reason.as_ref().map(|reason| reason.text.clone()),
            check: self.reason.as_ref().and_then(|reason| reason.check.clone()),
            answer: self.reception.as_ref().and_then(|reception| reception.file.clone()),
            restart_of: self.spec.restarts.map(|job| job.0),
            is_unseen: self.is_unseen,
        }
    }

    /// In short.
    pub fn brief(&self, lane_progress: Option<&LaneProgress>) -> JobBrief {
        JobBrief {
            id: self.id.0,
            kind: kind_name(self.spec.job_kind.clone()),
            program: self.spec.program.clone(),
            state: self.state,
            progress: self.progress(lane_progress),
            message: self.reason.as_ref().map(|reason| reason.text.clone()),
            ended_ms: self.ended,
        }
    }
}

/// What the machine sends of its own accord is of no kind of the plug-in's.
pub(super) fn kind_name(kind: String) -> String {
    if kind.is_empty() { "receive".to_owned() } else { kind }
}

impl From<Entry> for JournalEntry {
    fn from(Entry { number, time, note }: Entry) -> Self {
        let super::Note { subject, weight, link, job, text } = note;
        Self { number, at_ms: time, kind: subject, link, job: job.map(|job| job.0), weight, text }
    }
}

impl From<view::JobFilter> for JobFilter {
    fn from(asked: view::JobFilter) -> Self {
        let view::JobFilter { link, state, kind, find, since_ms, until_ms, before, limit } = asked;
        let most = limit.unwrap_or(LISTED.0).min(LISTED.1) as usize;
        let find = find.map(|find| find.to_lowercase());
        Self { link, state, kind, find, since: since_ms, until: until_ms, before, most }
    }
}

impl From<view::JournalFilter> for EntryFilter {
    fn from(asked: view::JournalFilter) -> Self {
        let view::JournalFilter {
            link,
            kind,
            at_least,
            job,
            find,
            since_ms,
            until_ms,
            before,
            limit,
        } = asked;
        let most = limit.unwrap_or(LISTED.0).min(LISTED.1) as usize;
        let find = find.map(|find| find.to_lowercase());
        let (since, until) = (since_ms, until_ms);
        Self {
            link,
            job: job.map(JobId),
            subject: kind,
            at_least: at_least.unwrap_or_default(),
            find,
            since,
            until,
            before,
            most,
        }
    }
}
