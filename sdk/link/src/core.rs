//! What a link knows, and what each action does to it.

use crate::LinkHost;
use crate::fault::RuleBroken;
use crate::fed::Fed;
use crate::job::ActiveJob;
use crate::queue::Queue;
use crate::timers::Timers;
use alloc::vec::Vec;
use core::hash::{Hash, Hasher};
use softplug_abi::limits::REQUESTS;
use softplug_abi::{Action, Actions, DeliveryId, Failure, JobId, Micros, Pass, RequestId, Values};

/// Whether the plug-in holds the transmit queue.
///
/// The example of [`Link`](crate::Link) shows it.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum HoldState {
    /// Bytes may leave.
    Free,
    /// The plug-in holds the queue.
    Held,
}

/// Which actions an event may be answered with.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Answering {
    /// Anything but state.
    Ordinary,
    /// Nothing: settings.
    Nothing,
}

#[derive(Clone, Debug)]
pub(crate) struct Core {
    pub(crate) queue: Queue,
    pub(crate) timers: Timers,
    pub(crate) job: Option<ActiveJob>,
    /// What the plug-in was given of the latest job's data.
    pub(crate) fed: Fed,
    /// The delivery under way.
    pub(crate) delivery: Option<DeliveryId>,
    delivery_capacity: u32,
    /// What the plug-in knows to be free for deliveries.
    delivery_room: u32,
    drained: u32,
    pub(crate) requests: Vec<RequestId>,
}

impl Core {
    pub(crate) fn new(transmit_room: u32, delivery_room: u32) -> Self {
        Self {
            queue: Queue::new(transmit_room),
            timers: Timers::default(),
            job: None,
            fed: Fed::new(transmit_room),
            delivery: None,
            delivery_capacity: delivery_room,
            delivery_room,
            drained: 0,
            requests: Vec::with_capacity(REQUESTS),
        }
    }

    pub(crate) fn apply(
        &mut self,
        now: Micros,
        action: &Action<'_>,
        answering: Answering,
        host: &mut dyn LinkHost,
    ) -> Result<(), RuleBroken> {
        match (answering, action) {
            (Answering::Ordinary, Action::Saved { .. }) => return Err(RuleBroken::StateUnasked),
            (_, Action::Note { .. } | Action::State { .. }) | (Answering::Ordinary, _) => {}
            (Answering::Nothing, _) => return Err(RuleBroken::ActedOnState),
        }
        match action {
            Action::Transmit { mark, bytes } => return self.queue.transmit(*mark, bytes),
            Action::TransmitUrgent { mark, bytes } => {
                self.fed.urgent(bytes.len());
                return self.queue.transmit_urgent(*mark, bytes);
            }
            Action::Break { micros } => return self.queue.send_break(*micros),
            Action::SetTimer { id, deadline } => {
                self.timers.set(*id, *deadline);
                return Ok(());
            }
            Action::CancelTimer { id } => {
                self.timers.cancel(*id);
                return Ok(());
            }
            Action::Want { job, bytes } => {
                self.active(*job)?.want(*bytes);
                return Ok(());
            }
            Action::Discard => {
                self.queue.discard();
                self.fed.discarded(self.queue.given());
                return Ok(());
            }
            Action::Hold => self.queue.set_held(true),
            Action::Release => self.queue.set_held(false),
            Action::DeliveryBegin { delivery, .. } => self.begin_delivery(*delivery)?,
            Action::Deliver { delivery, bytes } => self.deliver(*delivery, bytes.len() as u32)?,
            Action::DeliveryName { delivery, .. } => self.in_delivery(*delivery)?,
            Action::DeliveryEnd { delivery, .. } => {
                self.in_delivery(*delivery)?;
                self.delivery = None;
            }
            Action::JobDone { job, .. } | Action::JobFailed { job, .. } => {
                self.end_job(*job, action)?;
            }
            Action::CheckResult { job, failure, .. } => self.checked(*job, failure.is_none())?,
            Action::Request { request, fields, .. } => self.request(*request, fields)?,
            Action::Withdraw { request } => self.requests.retain(|id| id != request),
            Action::ModemLines { .. } | Action::Note { .. } | Action::State { .. } => {}
            Action::Saved { .. } => unreachable!("answered above"),
        }
        host.handle(now, action);
        Ok(())
    }

    /// Applies all actions of an answer that is known to be readable.
    pub(crate) fn apply_all(
        &mut self,
        now: Micros,
        actions: &[u8],
        host: &mut dyn LinkHost,
    ) -> Result<(), RuleBroken> {
        for action in Actions::new(actions).flatten() {
            self.apply(now, &action, Answering::Ordinary, host)?;
        }
        Ok(())
    }

    fn active(&mut self, id: JobId) -> Result<&mut ActiveJob, RuleBroken> {
        self.job.as_mut().filter(|active| active.job.id == id).ok_or(RuleBroken::NoSuchJob(id))
    }

    fn end_job(&mut self, id: JobId, action: &Action<'_>) -> Result<(), RuleBroken> {
        let active = self.active(id)?;
        if active.pass == Pass::Check && matches!(action, Action::JobDone { .. }) {
            return Err(RuleBroken::OnlyChecked(id));
        }
        self.job = None;
        Ok(())
    }

    fn checked(&mut self, id: JobId, good: bool) -> Result<(), RuleBroken> {
        let active = self.active(id)?;
        if active.pass != Pass::Check || active.run_next {
            return Err(RuleBroken::NotChecked(id));
        }
        active.run_next = good;
        if !good {
            self.job = None;
        }
        Ok(())
    }

    fn begin_delivery(&mut self, id: DeliveryId) -> Result<(), RuleBroken> {
        if self.delivery.is_some() {
            return Err(RuleBroken::DeliveryUnderWay(id));
        }
        self.delivery = Some(id);
        Ok(())
    }

    fn in_delivery(&self, id: DeliveryId) -> Result<(), RuleBroken> {
        if self.delivery == Some(id) { Ok(()) } else { Err(RuleBroken::NoSuchDelivery(id)) }
    }

    fn deliver(&mut self, id: DeliveryId, bytes: u32) -> Result<(), RuleBroken> {
        self.in_delivery(id)?;
        if bytes > self.delivery_room {
            return Err(RuleBroken::DeliveryRoom { asked: bytes, room: self.delivery_room });
        }
        self.delivery_room -= bytes;
        Ok(())
    }

    fn request(&mut self, id: RequestId, fields: &Values<'_>) -> Result<(), RuleBroken> {
        if !are_ascending(fields) {
            return Err(RuleBroken::RequestFields(id));
        }
        if self.requests.contains(&id) {
            return Err(RuleBroken::RequestTwice(id));
        }
        if self.requests.len() == REQUESTS {
            return Err(RuleBroken::TooManyRequests);
        }
        self.requests.push(id);
        Ok(())
    }

    /// Whether the plug-in still waits for the answer; `last` takes it off the list.
    pub(crate) fn awaits_answer(&mut self, id: RequestId, last: bool) -> bool {
        let waits = self.requests.contains(&id);
        if last {
            self.requests.retain(|other| *other != id);
        }
        waits
    }

    /// Growth of room for deliveries to report: an eighth of the capacity, or
    /// all of it once nothing is left to put away.
    pub(crate) fn next_delivery_room(&mut self, host: &mut dyn LinkHost) -> Option<u32> {
        self.drained += host.drained();
        let all_put_away = self.delivery_room + self.drained == self.delivery_capacity;
        let due = self.drained >= self.delivery_capacity / 8 || all_put_away;
        if self.drained == 0 || !due {
            return None;
        }
        let grown = core::mem::take(&mut self.drained);
        self.delivery_room += grown;
        Some(grown)
    }

    pub(crate) fn set_delivery_room(&mut self, room: u32) {
        self.delivery_room = room;
    }

    pub(crate) fn shrink_delivery_room(&mut self, grown: u32) {
        self.delivery_room -= grown;
    }

    pub(crate) fn grow_delivery_room(&mut self, grown: u32) {
        self.delivery_room = self.delivery_room.saturating_add(grown);
    }

    /// What the plug-in knows to be free for deliveries.
    pub(crate) fn known_delivery_room(&self) -> u32 {
        self.delivery_room
    }

    /// All that is free for deliveries, reported or not.
    pub(crate) fn whole_delivery_room(&self) -> u32 {
        self.delivery_room + self.drained
    }

    /// The plug-in was told both whole rooms.
    pub(crate) fn restate_rooms(&mut self) {
        self.queue.restate_room();
        self.delivery_room += core::mem::take(&mut self.drained);
    }

    /// All that decides what comes. What was fed is not: it is only told.
    pub(crate) fn hash_ahead(&self, now: Micros, state: &mut impl Hasher) {
        let Self {
            queue,
            timers,
            job,
            fed: _,
            delivery,
            delivery_capacity,
            delivery_room,
            drained,
            requests,
        } = self;
        (job, delivery, delivery_capacity, delivery_room, drained, requests).hash(state);
        queue.hash_ahead(state);
        timers.hash_ahead(now, state);
    }

    /// Whether nothing is under way that a plug-in would have to know of.
    pub(crate) fn is_idle(&self) -> bool {
        self.job.is_none()
            && self.delivery.is_none()
            && self.requests.is_empty()
            && self.queue.is_idle()
    }

    /// Ends what the plug-in had under way, because it can no longer.
    pub(crate) fn interrupt(&mut self, now: Micros, host: &mut dyn LinkHost) {
        self.timers.clear();
        self.requests.clear();
        let failure = Failure::Interrupted;
        if let Some(delivery) = self.delivery.take() {
            let end = Action::DeliveryEnd { delivery, failure: Some(failure), status: 0 };
            host.handle(now, &end);
        }
        if let Some(active) = self.job.take() {
            let job = active.job.id;
            host.handle(now, &Action::JobFailed { job, failure, status: 0, sent: 0 });
        }
    }
}

/// Whether these are whole value records, each field once, in the manifest's order.
fn are_ascending(fields: &Values<'_>) -> bool {
    let mut next = 0;
    fields.clone().all(|field| match field {
        Ok((index, _)) if u32::from(index) >= next => {
            next = u32::from(index) + 1;
            true
        }
        _ => false,
    })
}
