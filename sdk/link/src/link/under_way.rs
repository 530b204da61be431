//! What is under way on a link, in a few numbers.

use super::Link;
use crate::core::Core;
use alloc::vec::Vec;
use softplug_abi::{DeliveryId, Instance, JobId, Pass, RequestId};

/// What is under way on a link: what a plug-in that takes over finds there.
///
/// ```
/// use softplug_abi::{DeliveryId, Event, JobId, Micros};
/// # use softplug_abi::{ActionWriter, Instance, NoSpace, Output};
/// use softplug_abi::{Action, Pass};
/// use softplug_link::{Job, Link, LinkOptions, Recorder, UnderWay};
///
/// # type Act = fn(&Event<'_>, &mut ActionWriter<'_>) -> Result<(), NoSpace>;
/// # struct Plugin(Act, Vec<u8>);
/// # impl Instance for Plugin {
/// #     type Fault = NoSpace;
/// #     fn input_capacity(&self) -> usize {
/// #         512
/// #     }
/// #     fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, NoSpace> {
/// #         self.1.resize(1_024, 0);
/// #         let mut actions = ActionWriter::new(&mut self.1);
/// #         (self.0)(event, &mut actions)?;
/// #         let length = actions.len();
/// #         Ok(Output { actions: &self.1[..length], more: false })
/// #     }
/// # }
/// # fn plugin(act: Act) -> Plugin {
/// #     Plugin(act, Vec::new())
/// # }
/// let waiting = plugin(|event, actions| match event {
///     Event::JobBegin { .. } => actions.push(&Action::DeliveryBegin { delivery: DeliveryId(3), job: JobId::NONE }),
///     _ => Ok(()),
/// });
/// let mut link = Link::new(waiting, LinkOptions::default());
/// let mut host = Recorder::default();
/// link.open(Micros(0), &mut host)?;
/// assert_eq!(link.under_way(), UnderWay::default());
/// let job = Job { id: JobId(7), kind: 0, size: None, fields: Vec::new(), check: false };
/// link.begin_job(Micros(0), job, &mut host)?;
/// let UnderWay { job, delivery, .. } = link.under_way();
/// assert_eq!((job, delivery), (Some((JobId(7), Pass::Run)), Some(DeliveryId(3))));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct UnderWay {
    /// The job and its pass.
    pub job: Option<(JobId, Pass)>,
    /// The delivery.
    pub delivery: Option<DeliveryId>,
    /// Requests that are not answered yet.
    pub requests: Vec<RequestId>,
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
