//! What is under way on a link, in a few numbers.

use crate::Link;
use crate::core::Core;
use softplug_abi::{Instance, Pass};

/// What is under way on a link: what a plug-in that takes over finds there.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct UnderWay {
    /// The job and its pass.
    pub job: Option<(u32, Pass)>,
    /// The delivery.
    pub delivery: Option<u32>,
    /// Requests that are not answered yet.
    pub requests: Vec<u32>,
    /// Marks outstanding.
    pub marks: u32,
}

impl<I: Instance> Link<I> {
    /// What is under way now.
    pub fn under_way(&self) -> UnderWay {
        UnderWay::of(&self.core)
    }

    /// What was under way when the plug-in took over; nothing if it began as new.
    pub fn taken_over_with(&self) -> &UnderWay {
        &self.taken_over_with
    }
}

impl UnderWay {
    pub(crate) fn of(core: &Core) -> Self {
        Self {
            job: core.job.as_ref().map(|active| (active.job.id, active.pass)),
            delivery: core.delivery,
            requests: core.requests.clone(),
            marks: core.queue.marks_outstanding(),
        }
    }
}
