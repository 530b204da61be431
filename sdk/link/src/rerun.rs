//! What an instance was given, given to another one: step by step, with the same
//! judgement of what it answers.

use crate::core::{Answering, Core};
use crate::fault::LinkFault;
use crate::job::{ActiveJob, Job};
use crate::link::{give_quiet, saved_by};
use crate::{Link, LinkHost, LinkOptions, UnderWay};
use alloc::vec::Vec;
use softplug_abi::{Event, Instance, JobId, MarkState, Micros};

/// Gives an instance exactly the events that another one was given, at their
/// times. There is no line: nothing comes of what the instance does, but it is
/// held to the rules. How many urgent bytes wait cannot be told from events; they
/// count as sent when time goes on.
///
/// ```
/// use softplug_abi::{Event, Micros};
/// # use softplug_abi::{ActionWriter, Instance, NoSpace, Output};
/// use softplug_abi::LineParameters;
/// use softplug_link::{LinkFault, Recorder, Rerun, UnderWay};
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
/// let flood = plugin(|event, actions| match event {
///     Event::Received(_) => actions.transmit(b"too much"),
///     _ => Ok(()),
/// });
/// let mut rerun = Rerun::new(flood, &UnderWay::default());
/// let mut host = Recorder::default();
/// // As it was recorded: the plug-in was told of 4 bytes of room.
/// let line = LineParameters::new(9_600);
/// let open = Event::Open { resumed: false, line, transmit_room: 4, delivery_room: 4_096 };
/// rerun.give(Micros(0), &open, &mut host)?;
/// let fault = rerun.give(Micros(1_000), &Event::Received(b"?"), &mut host).unwrap_err();
/// assert!(matches!(fault, LinkFault::Rule { .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Rerun<I: Instance> {
    link: Link<I>,
}

impl<I: Instance> Rerun<I> {
    /// For an instance that knows nothing yet. `under_way` is what the recorded
    /// one took over, if it did.
    pub fn new(instance: I, under_way: &UnderWay) -> Self {
        let mut link = Link::new(instance, LinkOptions::default());
        link.core.take_up(under_way);
        Self { link }
    }

    /// Gives the next event. `continue` is asked by itself and is not among them.
    ///
    /// # Errors
    /// The instance fails on it.
    pub fn give(
        &mut self,
        now: Micros,
        event: &Event<'_>,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        let link = &mut self.link;
        if link.has_ended() {
            return Err(LinkFault::Ended);
        }
        if now > link.now {
            link.core.queue.forget_waiting();
        }
        link.begin_instant(now);
        if begins_count_anew(event) {
            link.begin_request();
        }
        link.core.was_told(event);
        match event {
            Event::Continue => Ok(()),
            Event::Settings { .. } => link.step_as(event, Answering::Nothing, host),
            Event::Restore { .. } => {
                let given = give_quiet(&mut link.instance, event, now, host);
                link.ended_by(given, host)
            }
            Event::Save => {
                let saved = saved_by(&mut link.instance, now, host).map(drop);
                link.ended_by(saved, host)
            }
            Event::Close => {
                let closed = link.step_as(event, Answering::Ordinary, host);
                link.core.interrupt(now, host);
                closed
            }
            Event::Open { .. }
            | Event::Received(..)
            | Event::LineError { .. }
            | Event::ModemLines { .. }
            | Event::LinkDown(..)
            | Event::LinkUp
            | Event::Timer { .. }
            | Event::Mark { .. }
            | Event::TransmitRoom { .. }
            | Event::Discarded { .. }
            | Event::DeliveryRoom { .. }
            | Event::JobBegin { .. }
            | Event::JobData { .. }
            | Event::JobEnd { .. }
            | Event::Pause { .. }
            | Event::Resume { .. }
            | Event::Abort { .. }
            | Event::ForceResume
            | Event::Answer { .. } => link.step_as(event, Answering::Ordinary, host),
        }
    }
}

/// Whether it comes from outside, so that steps of this instant count anew.
fn begins_count_anew(event: &Event<'_>) -> bool {
    !matches!(
        event,
        Event::Mark { .. }
            | Event::TransmitRoom { .. }
            | Event::Discarded { .. }
            | Event::Timer { .. }
            | Event::DeliveryRoom { .. }
            | Event::JobEnd { .. }
    )
}

impl Core {
    fn take_up(&mut self, under_way: &UnderWay) {
        let UnderWay { job, delivery, requests, marks } = under_way;
        self.delivery = *delivery;
        self.requests.clone_from(requests);
        self.queue.mark_unnamed(*marks);
        self.job = job.map(|(id, pass)| {
            let mut active = ActiveJob::new(job_of(id));
            active.pass = pass;
            active
        });
    }

    /// The plug-in is told this: what it may do changes with it.
    fn was_told(&mut self, event: &Event<'_>) {
        match event {
            Event::Open { resumed, transmit_room, delivery_room, .. } => {
                if !resumed {
                    *self = Self::new(*transmit_room, *delivery_room);
                }
                self.queue.set_room(*transmit_room);
                self.set_delivery_room(*delivery_room);
            }
            Event::TransmitRoom { grown } => self.queue.grow_room(*grown),
            Event::Discarded { bytes } => self.queue.told_discarded(*bytes),
            Event::DeliveryRoom { grown } => self.grow_delivery_room(*grown),
            Event::Mark { mark, state } if *state != MarkState::MaybeLeft => {
                self.queue.settle_mark(*mark);
            }
            Event::JobBegin { job, pass, .. } => {
                let mut active = ActiveJob::new(job_of(*job));
                active.pass = *pass;
                self.job = Some(active);
            }
            Event::Answer { request, more, .. } => {
                self.awaits_answer(*request, !more);
            }
            Event::Settings { .. }
            | Event::Close
            | Event::Received(..)
            | Event::LineError { .. }
            | Event::ModemLines { .. }
            | Event::LinkDown(..)
            | Event::LinkUp
            | Event::Timer { .. }
            | Event::Mark { .. }
            | Event::JobData { .. }
            | Event::JobEnd { .. }
            | Event::Pause { .. }
            | Event::Resume { .. }
            | Event::Abort { .. }
            | Event::ForceResume
            | Event::Save
            | Event::Restore { .. }
            | Event::Continue => {}
        }
    }
}

fn job_of(id: JobId) -> Job {
    Job { id, kind: 0, size: None, fields: Vec::new(), check: false }
}
