//! Jobs and entries as they are shown.

use super::{Entry, EntryFilter, Job, JobFilter, Order};
use crate::view::{self, JobBrief, JobView, JournalEntry};

/// What a list has if nothing is said, and at most.
const LISTED: (u32, u32) = (100, 1_000);

impl Job {
    /// As it is shown. `last_block` is for [`Snapshots::between`](crate::programs::Snapshots::between)
    /// to find out.
    pub fn view(&self, last_block: Option<u64>) -> JobView {
        let Order { link, job_kind, fields, program, data, .. } = self.order.clone();
        JobView {
            id: self.id,
            link,
            kind: job_kind,
            state: self.state,
            origin: self.order.origin,
            program,
            fields: fields.into_iter().collect(),
            priority: self.order.priority,
            size: data.map(|data| data.size),
            start_byte: self.order.from,
            start_block: self.order.from_block,
            taken: self.taken.max(self.extent.surely),
            sent: self.sent,
            surely_left: self.extent.surely,
            maybe_left: self.extent.maybe,
            last_block,
            created_ms: self.created,
            started_ms: self.began,
            ended_ms: self.ended,
            failure: self.reason.as_ref().map(|reason| reason.failure.clone()),
            message: self.reason.as_ref().map(|reason| reason.text.clone()),
            check: self.reason.as_ref().and_then(|reason| reason.check.clone()),
            answer: self.reception.as_ref().and_then(|reception| reception.file.clone()),
            restart_of: self.order.restarts,
        }
    }

    /// In short.
    pub fn brief(&self) -> JobBrief {
        JobBrief {
            id: self.id,
            kind: self.order.job_kind.clone(),
            program: self.order.program.clone(),
            state: self.state,
            size: self.order.data.map(|data| data.size),
            taken: self.taken.max(self.extent.surely),
            surely_left: self.extent.surely,
        }
    }
}

impl From<Entry> for JournalEntry {
    fn from(Entry { number, time, note }: Entry) -> Self {
        let super::Note { subject, link, job, text, .. } = note;
        Self { number, at_ms: time, kind: subject, link, job, text }
    }
}

impl From<view::JobFilter> for JobFilter {
    fn from(asked: view::JobFilter) -> Self {
        let view::JobFilter { link, state, before, limit } = asked;
        let most = limit.unwrap_or(LISTED.0).min(LISTED.1) as usize;
        Self { link, state, before, most }
    }
}

impl From<view::JournalFilter> for EntryFilter {
    fn from(asked: view::JournalFilter) -> Self {
        let view::JournalFilter { link, kind, job, before, limit } = asked;
        let most = limit.unwrap_or(LISTED.0).min(LISTED.1) as usize;
        Self { link, job, subject: kind, before, most, ..Self::default() }
    }
}
