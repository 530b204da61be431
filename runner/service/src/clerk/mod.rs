//! The clerk: one thread that puts away what machines send. A reception is complete when it
//! is on the disk under its name, and not before.
//!
//! When the disk takes nothing, or a quota is reached, nothing is read either: the buffer fills, and
//! the plug-in holds the machine. It is tried again until there is room.

mod delivery;

use std::collections::VecDeque;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use softplug_abi::Failure;
use softplug_gateway::reactor::LaneId;
use softplug_gateway::reservoir::ReservoirReader;

use crate::jobs::{Job, Jobs};
use crate::programs::{Quotas, Receptions, Snapshots};
use crate::wakes::{SLOTS, Wakes};
use delivery::{Delivery, Next};

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
    pub delivery: u32,
    /// The job that it answers.
    pub job: Option<u32>,
    /// Its bytes.
    pub bytes: ReservoirReader,
}

/// What the clerk tells.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum ClerkNews {
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
}

/// The thread, until it is dropped. What is under way then is kept as failed.
#[derive(Debug)]
pub struct Clerk {
    orders: Option<Sender<Order>>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
enum Order {
    Take(Box<Incoming>),
    Name { lane: LaneId, delivery: u32, name: String },
    End { lane: LaneId, delivery: u32, failure: Option<Failure>, status: u16, bytes: u64 },
    Lose(LaneId),
}

impl Clerk {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system has no thread to give.
    pub fn start(
        jobs: Jobs,
        receptions: Receptions,
        snapshots: Snapshots,
        quotas: Quotas,
        tell: impl FnMut(ClerkNews) + Send + 'static,
    ) -> io::Result<Self> {
        let (sender, orders) = channel();
        let thread = thread::Builder::new().name("clerk".to_owned());
        let thread = thread.spawn(move || {
            let wakes = Wakes::new(thread::current());
            let office = Office { jobs, receptions, snapshots, quotas };
            Desk { office, tell, wakes, lanes: Vec::new() }.run(&orders);
        })?;
        Ok(Self { orders: Some(sender), thread: Some(thread) })
    }

    /// A delivery has begun.
    pub fn take(&self, incoming: Incoming) {
        self.order(Order::Take(Box::new(incoming)));
    }

    /// Its name was found. From the line: nothing in it is trusted.
    pub fn name(&self, lane: LaneId, delivery: u32, name: String) {
        self.order(Order::Name { lane, delivery, name });
    }

    /// It has ended, with so many bytes; `failure`: why it is not all.
    pub fn end(
        &self,
        lane: LaneId,
        delivery: u32,
        failure: Option<Failure>,
        status: u16,
        bytes: u64,
    ) {
        self.order(Order::End { lane, delivery, failure, status, bytes });
    }

    /// The lane, or its plug-in, has ended: so have its deliveries.
    pub fn lose(&self, lane: LaneId) {
        self.order(Order::Lose(lane));
    }

    fn order(&self, order: Order) {
        if let (Some(orders), Some(thread)) = (&self.orders, &self.thread) {
            // It has panicked if not: readers are dropped then, and lanes drop what comes.
            let _ = orders.send(order);
            thread.thread().unpark();
        }
    }
}

impl Drop for Clerk {
    fn drop(&mut self) {
        drop(self.orders.take());
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

/// Where things are put.
struct Office {
    jobs: Jobs,
    receptions: Receptions,
    snapshots: Snapshots,
    quotas: Quotas,
}

struct Desk<T> {
    office: Office,
    tell: T,
    wakes: Arc<Wakes>,
    lanes: Vec<Option<Place>>,
}

/// What one lane brought, in its order: only the first is put away, so that a lane takes one
/// place however much of it waits.
struct Place {
    lane: LaneId,
    deliveries: VecDeque<Delivery>,
}

impl Place {
    fn first(&mut self) -> Option<&mut Delivery> {
        self.deliveries.front_mut()
    }
}

impl<T: FnMut(ClerkNews)> Desk<T> {
    fn run(mut self, orders: &Receiver<Order>) {
        let mut buffer = vec![0; 64 * 1024];
        loop {
            let mut is_over = false;
            loop {
                match orders.try_recv() {
                    Ok(order) => self.heed(order),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => {
                        is_over = true;
                        break;
                    }
                }
            }
            if is_over {
                return self.clear_up(&mut buffer);
            }
            for slot in self.wakes.take() {
                let place = self.lanes.get_mut(slot).and_then(Option::as_mut);
                if let Some(delivery) = place.and_then(Place::first) {
                    delivery.is_woken = true;
                }
            }
            let retry = self.serve(&mut buffer);
            match retry {
                None if self.lanes.iter_mut().flatten().any(is_woken) => {}
                None => thread::park(),
                Some(retry) => {
                    thread::park_timeout(retry.saturating_duration_since(Instant::now()));
                }
            }
        }
    }

    fn heed(&mut self, order: Order) {
        match order {
            Order::Take(incoming) => self.take_on(*incoming),
            Order::Name { lane, delivery, name } => {
                if let Some(delivery) = self.find(lane, delivery) {
                    delivery.name = Some(name);
                }
            }
            Order::End { lane, delivery, failure, status, bytes } => {
                if let Some(delivery) = self.find(lane, delivery) {
                    delivery.end(failure, status, Some(bytes));
                }
            }
            Order::Lose(lane) => {
                for delivery in self.of(lane) {
                    delivery.end(Some(Failure::Interrupted), 0, None);
                }
            }
        }
    }

    /// What is there of a lane.
    fn of(&mut self, lane: LaneId) -> impl Iterator<Item = &mut Delivery> {
        let places = self.lanes.iter_mut().flatten().filter(move |place| place.lane == lane);
        places.flat_map(|place| &mut place.deliveries)
    }

    /// The one that has not ended, if the plug-in has used an id again.
    fn find(&mut self, lane: LaneId, id: u32) -> Option<&mut Delivery> {
        self.of(lane).find(|delivery| delivery.id == id && !delivery.has_ended())
    }

    fn take_on(&mut self, incoming: Incoming) {
        // A lane has one at a time: what is still open there never got its end.
        for delivery in self.of(incoming.lane) {
            delivery.end(Some(Failure::Interrupted), 0, None);
        }
        let is_its =
            |place: &Option<Place>| place.as_ref().is_some_and(|place| place.lane == incoming.lane);
        let own = self.lanes.iter().position(is_its);
        let slot = own.or_else(|| self.lanes.iter().position(Option::is_none));
        let slot = slot.unwrap_or(self.lanes.len());
        if slot >= SLOTS {
            tracing::error!(link = incoming.link, "too many links receive at once, one is dropped");
            return;
        }
        incoming.bytes.wake_with(self.wakes.waker(slot));
        if slot == self.lanes.len() {
            self.lanes.push(None);
        }
        let lane = incoming.lane;
        let place = self.lanes[slot].get_or_insert(Place { lane, deliveries: VecDeque::new() });
        place.deliveries.push_back(Delivery::new(incoming));
    }

    /// Gives each its turn; tells when the first of those that the disk refused is tried again.
    fn serve(&mut self, buffer: &mut [u8]) -> Option<Instant> {
        let now = Instant::now();
        let mut retry: Option<Instant> = None;
        for slot in &mut self.lanes {
            let Some(delivery) = slot.as_mut().and_then(Place::first) else { continue };
            if delivery.retry_at.map_or(!delivery.is_woken, |at| now < at) {
                retry = [retry, delivery.retry_at].into_iter().flatten().min();
                continue;
            }
            delivery.is_woken = false;
            match delivery.work(&self.office, buffer, false, &mut self.tell) {
                Ok(next) => {
                    if delivery.retry_at.take().is_some() {
                        (self.tell)(ClerkNews::GoesOn { link: delivery.link.clone() });
                    }
                    match next {
                        Next::Woken => {}
                        Next::Again => delivery.is_woken = true,
                        Next::Over => {
                            let place = slot.as_mut();
                            let rest = place.map_or(0, |place| {
                                place.deliveries.pop_front();
                                place.deliveries.len()
                            });
                            if rest == 0 {
                                *slot = None;
                            }
                        }
                    }
                }
                Err(why) => {
                    if delivery.retry_at.is_none() {
                        let link = delivery.link.clone();
                        (self.tell)(ClerkNews::Stuck { link, why });
                    }
                    let at = now + AGAIN;
                    delivery.retry_at = Some(at);
                    retry = Some(retry.map_or(at, |first| first.min(at)));
                }
            }
        }
        retry
    }

    /// The gateway ends: what has not come is missing.
    fn clear_up(mut self, buffer: &mut [u8]) {
        let lanes = std::mem::take(&mut self.lanes);
        for mut delivery in lanes.into_iter().flatten().flat_map(|place| place.deliveries) {
            delivery.end(Some(Failure::Interrupted), 0, None);
            loop {
                match delivery.work(&self.office, buffer, true, &mut self.tell) {
                    Ok(Next::Again) => {}
                    Ok(Next::Woken | Next::Over) => break,
                    Err(error) => {
                        tracing::error!(
                            link = delivery.link,
                            error,
                            "a reception could not be put away"
                        );
                        break;
                    }
                }
            }
        }
    }
}

fn is_woken(place: &mut Place) -> bool {
    place.first().is_some_and(|delivery| delivery.is_woken)
}
