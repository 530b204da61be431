//! The writer of receptions: one thread that puts away what machines send. A reception is complete when it
//! is on the disk under its name, and not before.
//!
//! When the disk takes nothing, or a quota is reached, nothing is read either: the buffer fills, and
//! the plug-in holds the machine. It is tried again until there is room, also while the gateway
//! stops, unless somebody gives it up.

mod delivery;

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use softplug_abi::{DeliveryId, Failure, JobId};
use softplug_live::reactor::LaneId;
use softplug_live::reservoir::ReservoirReader;

use crate::jobs::{FromUnit, Job, Jobs};
use crate::programs::{Quotas, Receptions, Snapshots};
use crate::wakes::{SLOTS, Wakes};
use delivery::{Delivery, Loss, Next};

/// What the disk would not do is tried again after this.
const AGAIN: Duration = Duration::from_millis(500);

/// A delivery to put away.
#[derive(Debug)]
pub struct Incoming {
    /// The lane that it comes from.
    pub lane: LaneId,
    /// The link's name.
    pub link: String,
    /// The folder for it among the receptions.
    pub place: String,
    /// The plug-in's id for it.
    pub delivery: DeliveryId,
    /// The job that it answers.
    pub job: Option<JobId>,
    /// The unit that it comes from, which says it again until it knows that it is stored.
    pub unit: Option<FromUnit>,
    /// Its bytes.
    pub bytes: ReservoirReader,
}

/// What it tells of what it does.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum ReceptionWriterNews {
    /// It has begun, as a job of its own.
    Begun(Box<Job>),
    /// It is put away; the job's reception says where. One that answers a job has not ended that.
    Kept(Box<Job>),
    /// The disk takes nothing, or a quota is reached; the machine is held. Says why.
    Stuck {
        /// The link.
        link: String,
        /// Why.
        why: String,
    },
    /// The disk takes it again.
    GoesOn {
        /// The link.
        link: String,
    },
    /// It was given up, and this much of it is nowhere.
    Lost {
        /// The link.
        link: String,
        /// Its job, if it has one.
        job: Option<JobId>,
        /// Bytes.
        bytes: u64,
        /// Why it could not be put away.
        why: String,
    },
    /// The writer has no more to do with a delivery that it took, whatever became of it.
    Over {
        /// The link.
        link: String,
    },
}

/// The thread, until it is dropped. What is under way then is kept as failed, and what cannot be put
/// away at once is given up.
#[derive(Debug)]
pub struct ReceptionWriter {
    requests: Option<Sender<Request>>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
enum Request {
    Take(Box<Incoming>),
    Name { lane: LaneId, delivery: DeliveryId, name: String },
    End { lane: LaneId, delivery: DeliveryId, failure: Option<Failure>, status: u16, bytes: u64 },
    Lose(LaneId),
    Finish,
    GiveUp,
}

impl ReceptionWriter {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system has no thread to give.
    pub fn start(
        jobs: Jobs,
        receptions: Receptions,
        snapshots: Snapshots,
        quotas: Quotas,
        tell: impl FnMut(ReceptionWriterNews) + Send + 'static,
    ) -> io::Result<Self> {
        let (sender, requests) = channel();
        let thread = thread::Builder::new().name("receptions".to_owned());
        let thread = thread.spawn(move || {
            let wakes = Wakes::new(thread::current());
            let stores = Stores { jobs, receptions, snapshots, quotas };
            Worker { stores, tell, wakes, links: Vec::new(), is_last: false }.run(&requests);
        })?;
        Ok(Self { requests: Some(sender), thread: Some(thread) })
    }

    /// A delivery has begun.
    pub fn take(&self, incoming: Incoming) {
        self.request(Request::Take(Box::new(incoming)));
    }

    /// Its name was found. From the line: nothing in it is trusted.
    pub fn name(&self, lane: LaneId, delivery: DeliveryId, name: String) {
        self.request(Request::Name { lane, delivery, name });
    }

    /// It has ended, with so many bytes; `failure`: why it is not all.
    pub fn end(
        &self,
        lane: LaneId,
        delivery: DeliveryId,
        failure: Option<Failure>,
        status: u16,
        bytes: u64,
    ) {
        self.request(Request::End { lane, delivery, failure, status, bytes });
    }

    /// The lane, or its plug-in, has ended: so have its deliveries.
    pub fn lose(&self, lane: LaneId) {
        self.request(Request::Lose(lane));
    }

    /// The gateway ends: nothing more comes. What is there is put away whatever the quotas say, and
    /// tried again until there is room for it; what waits for that is told once more.
    pub fn finish(&self) {
        self.request(Request::Finish);
    }

    /// As [`finish`](Self::finish), and what cannot be put away at once is lost.
    pub fn give_up(&self) {
        self.request(Request::GiveUp);
    }

    /// The thread has ended: no more news comes.
    pub fn has_ended(&self) -> bool {
        self.thread.as_ref().is_none_or(JoinHandle::is_finished)
    }

    fn request(&self, request: Request) {
        if let (Some(requests), Some(thread)) = (&self.requests, &self.thread) {
            // It has panicked if not: readers are dropped then, and lanes drop what comes.
            let _ = requests.send(request);
            thread.thread().unpark();
        }
    }
}

impl Drop for ReceptionWriter {
    fn drop(&mut self) {
        drop(self.requests.take());
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

/// Where things are put.
struct Stores {
    jobs: Jobs,
    receptions: Receptions,
    snapshots: Snapshots,
    quotas: Quotas,
}

struct Worker<T> {
    stores: Stores,
    tell: T,
    wakes: Arc<Wakes>,
    links: Vec<Option<Place>>,
    /// The gateway ends.
    is_last: bool,
}

/// What one link brought, in its order: only the first is put away, so that a link takes one
/// place however much of it waits. What a unit says again comes behind what it said before, whatever
/// its link is called by now.
struct Place {
    /// The link's name, or its port at a unit.
    origin: String,
    deliveries: VecDeque<Delivery>,
}

impl Place {
    fn first(&mut self) -> Option<&mut Delivery> {
        self.deliveries.front_mut()
    }

    /// Leaves the first one, which is over; whether that was the last one too.
    fn leave_first(&mut self, tell: &mut dyn FnMut(ReceptionWriterNews)) -> bool {
        if let Some(Delivery { link, .. }) = self.deliveries.pop_front() {
            tell(ReceptionWriterNews::Over { link });
        }
        self.deliveries.is_empty()
    }
}

impl<T: FnMut(ReceptionWriterNews)> Worker<T> {
    fn run(mut self, requests: &Receiver<Request>) {
        loop {
            let mut is_over = false;
            loop {
                match requests.try_recv() {
                    Ok(request) => self.handle(request),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => {
                        is_over = true;
                        break;
                    }
                }
            }
            if is_over {
                return self.clear_up(true);
            }
            for slot in self.wakes.take() {
                let place = self.links.get_mut(slot).and_then(Option::as_mut);
                if let Some(delivery) = place.and_then(Place::first) {
                    delivery.is_woken = true;
                }
            }
            let retry = self.serve();
            match retry {
                None if self.links.iter_mut().flatten().any(is_woken) => {}
                None => thread::park(),
                Some(retry) => {
                    thread::park_timeout(retry.saturating_duration_since(Instant::now()));
                }
            }
        }
    }

    fn handle(&mut self, request: Request) {
        match request {
            Request::Take(incoming) => self.take_on(*incoming),
            Request::Name { lane, delivery, name } => {
                if let Some(delivery) = self.find(lane, delivery) {
                    delivery.name = Some(name);
                }
            }
            Request::End { lane, delivery, failure, status, bytes } => {
                if let Some(delivery) = self.find(lane, delivery) {
                    delivery.end(failure, status, Some(bytes));
                }
            }
            Request::Lose(lane) => {
                for delivery in self.of(lane) {
                    delivery.end(Some(Failure::Interrupted), 0, None);
                }
            }
            Request::Finish => self.finish(),
            Request::GiveUp => self.clear_up(false),
        }
    }

    /// Nothing more comes, and what has not come is missing.
    fn finish(&mut self) {
        self.is_last = true;
        let now = Instant::now();
        for delivery in self.links.iter_mut().flatten().flat_map(|place| &mut place.deliveries) {
            delivery.end(Some(Failure::Interrupted), 0, None);
            delivery.is_told = false;
            // No quota holds it up any more.
            delivery.retry_at = delivery.retry_at.map(|at| at.min(now));
        }
    }

    /// What is there of a lane.
    fn of(&mut self, lane: LaneId) -> impl Iterator<Item = &mut Delivery> {
        let deliveries = self.links.iter_mut().flatten().flat_map(|place| &mut place.deliveries);
        deliveries.filter(move |delivery| delivery.lane == lane)
    }

    /// The one that has not ended, if the plug-in has used an id again.
    fn find(&mut self, lane: LaneId, id: DeliveryId) -> Option<&mut Delivery> {
        self.of(lane).find(|delivery| delivery.id == id && !delivery.has_ended())
    }

    fn take_on(&mut self, incoming: Incoming) {
        let origin = incoming.unit.as_ref().map_or(&incoming.link, |unit| &unit.port);
        let is_its =
            |place: &Option<Place>| place.as_ref().is_some_and(|place| place.origin == *origin);
        let own = self.links.iter().position(is_its);
        let slot = own.or_else(|| self.links.iter().position(Option::is_none));
        let slot = slot.unwrap_or(self.links.len());
        if slot >= SLOTS {
            tracing::error!(link = incoming.link, "too many links receive at once, one is dropped");
            (self.tell)(ReceptionWriterNews::Over { link: incoming.link });
            return;
        }
        incoming.bytes.wake_with(self.wakes.waker(slot));
        if slot == self.links.len() {
            self.links.push(None);
        }
        let place = self.links[slot]
            .get_or_insert_with(|| Place { origin: origin.clone(), deliveries: VecDeque::new() });
        // A link has one at a time: what is still open there never got its end.
        for delivery in &mut place.deliveries {
            delivery.end(Some(Failure::Interrupted), 0, None);
        }
        let mut delivery = Delivery::new(incoming);
        if self.is_last {
            delivery.end(Some(Failure::Interrupted), 0, None);
        }
        place.deliveries.push_back(delivery);
    }

    /// Gives each its turn; tells when the first of those that the disk refused is tried again.
    fn serve(&mut self) -> Option<Instant> {
        let now = Instant::now();
        let mut retry: Option<Instant> = None;
        for slot in &mut self.links {
            let Some(delivery) = slot.as_mut().and_then(Place::first) else { continue };
            if delivery.retry_at.map_or(!delivery.is_woken, |at| now < at) {
                retry = [retry, delivery.retry_at].into_iter().flatten().min();
                continue;
            }
            delivery.is_woken = false;
            let is_over = match delivery.work(&self.stores, self.is_last, &mut self.tell) {
                Ok(next) => {
                    delivery.is_told = false;
                    if delivery.retry_at.take().is_some() {
                        (self.tell)(ReceptionWriterNews::GoesOn { link: delivery.link.clone() });
                    }
                    delivery.is_woken |= matches!(next, Next::Again);
                    matches!(next, Next::Over)
                }
                Err(why) if self.is_last && delivery.is_in_unit() => {
                    delivery.give_up(&self.stores, &why, &mut self.tell);
                    true
                }
                Err(error) => {
                    if !std::mem::replace(&mut delivery.is_told, true) {
                        let (link, why) = (delivery.link.clone(), error.to_string());
                        (self.tell)(ReceptionWriterNews::Stuck { link, why });
                    }
                    let at = now + AGAIN;
                    delivery.retry_at = Some(at);
                    retry = Some(retry.map_or(at, |first| first.min(at)));
                    false
                }
            };
            if is_over && slot.as_mut().is_some_and(|place| place.leave_first(&mut self.tell)) {
                *slot = None;
            }
        }
        retry
    }

    /// The last attempt: what cannot be put away now is given up. `is_alone`: nobody hears of it.
    fn clear_up(&mut self, is_alone: bool) {
        self.finish();
        for mut place in std::mem::take(&mut self.links).into_iter().flatten() {
            while let Some(delivery) = place.first() {
                let why = loop {
                    match delivery.work(&self.stores, true, &mut self.tell) {
                        Ok(Next::Again) => {}
                        Ok(Next::Woken | Next::Over) => break None,
                        Err(why) => break Some(why),
                    }
                };
                if let Some(why) = why {
                    let loss = delivery.give_up(&self.stores, &why, &mut self.tell);
                    let (link, why) = (delivery.link.clone(), why.to_string());
                    let Loss { job, bytes } = loss;
                    if is_alone {
                        tracing::error!(link, bytes, why, "a reception could not be put away");
                    }
                    if bytes > 0 {
                        (self.tell)(ReceptionWriterNews::Lost { link, job, bytes, why });
                    }
                }
                place.leave_first(&mut self.tell);
            }
        }
    }
}

fn is_woken(place: &mut Place) -> bool {
    place.first().is_some_and(|delivery| delivery.is_woken)
}
