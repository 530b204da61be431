//! What has surely left, out of a lane's figures.

use std::sync::Arc;
use std::time::{Duration, Instant};

use softplug_gateway::reactor::{LaneFigures, LaneStatus};

/// It is written down at least so far apart, but at once when the partner holds us.
const APART: Duration = Duration::from_secs(2);
/// Bytes that a plug-in may have taken and not yet passed on.
const IN_THE_PLUG_IN: u64 = 1_024;

/// A job's progress.
#[derive(Debug)]
pub(super) struct Progress {
    status: Arc<LaneStatus>,
    job: u32,
    from: u64,
    written: u64,
    next: Option<Instant>,
    was_held: bool,
}

impl Progress {
    pub(super) fn new(status: Arc<LaneStatus>, job: u32, from: u64) -> Self {
        Self { status, job, from, written: from, next: None, was_held: false }
    }

    /// What has surely left, if that is to be written down now.
    pub(super) fn look(&mut self, now: Instant) -> Option<u64> {
        let figures = self.status.read();
        if figures.job != self.job {
            return None;
        }
        let is_new_hold = figures.is_held && !self.was_held;
        self.was_held = figures.is_held;
        let surely = self.from + surely_left(&figures);
        let is_time = is_new_hold || self.next.is_none_or(|next| now >= next);
        if surely <= self.written || !is_time {
            return None;
        }
        self.written = surely;
        self.next = Some(now + APART);
        Some(surely)
    }
}

/// Bytes of the job's data that have surely left. Characters on the line are not bytes of the program:
/// a plug-in adds some. So it is no more than either of two counts: the characters that have left, and
/// what the plug-in took less all that may still be on its way.
pub fn surely_left(figures: &LaneFigures) -> u64 {
    let under_way = figures.job_maybe_left.saturating_sub(figures.job_surely_left);
    let behind = figures.waiting + under_way + IN_THE_PLUG_IN;
    figures.job_taken.saturating_sub(behind).min(figures.job_surely_left)
}
