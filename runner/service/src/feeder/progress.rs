//! What has surely left of a job, written down now and then.

use softplug_abi::JobId;
use std::sync::Arc;
use std::time::{Duration, Instant};

use softplug_live::reactor::LaneStatus;

/// It is written down at least so far apart, but at once when the partner holds us.
const APART: Duration = Duration::from_secs(2);

/// A job's progress.
#[derive(Debug)]
pub(super) struct Progress {
    status: Arc<LaneStatus>,
    job: JobId,
    from: u64,
    written: u64,
    next: Option<Instant>,
    was_held: bool,
}

impl Progress {
    pub(super) fn new(status: Arc<LaneStatus>, job: JobId, from: u64) -> Self {
        Self { status, job, from, written: from, next: None, was_held: false }
    }

    /// The byte before which all has left, at a moment when nothing was on its way; none while the
    /// lane does something else.
    pub(super) fn drained(&self) -> Option<u64> {
        Some(self.from + self.status.drained(self.job)?)
    }

    /// What has surely left, if that is to be written down now.
    pub(super) fn look(&mut self, now: Instant) -> Option<u64> {
        let figures = self.status.read();
        if figures.job != self.job.0 {
            return None;
        }
        let is_new_hold = figures.is_held && !self.was_held;
        self.was_held = figures.is_held;
        let surely = self.from + figures.job_bytes_surely_left;
        let is_time = is_new_hold || self.next.is_none_or(|next| now >= next);
        if surely <= self.written || !is_time {
            return None;
        }
        self.written = surely;
        self.next = Some(now + APART);
        Some(surely)
    }
}
