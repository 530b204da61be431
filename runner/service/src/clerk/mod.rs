//! The clerk: one thread that puts away what machines send. A reception is complete when it
//! is on the disk under its name, and not before.
//!
//! When the disk takes nothing, nothing is read either: the buffer fills, and the plug-in holds
//! the machine. It is tried again until there is room.

mod delivery;

use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use softplug_abi::Failure;
use softplug_gateway::reactor::LaneId;
use softplug_gateway::reservoir::ReservoirReader;

use crate::jobs::{Job, Jobs};
use crate::programs::{Receptions, Snapshots};
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
    /// The disk takes nothing; the machine is held. Says why.
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
        tell: impl FnMut(ClerkNews) + Send + 'static,
    ) -> io::Result<Self> {
        let (sender, orders) = channel();
        let thread = thread::Builder::new().name("clerk".to_owned());
        let thread = thread.spawn(move || {
            let wakes = Wakes::new(thread::current());
            let office = Office { jobs, receptions, snapshots };
            Desk { office, tell, wakes, deliveries: Vec::new() }.run(&orders);
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
}

struct Desk<T> {
    office: Office,
    tell: T,
    wakes: Arc<Wakes>,
    deliveries: Vec<Option<Delivery>>,
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
                if let Some(delivery) = self.deliveries.get_mut(slot).and_then(Option::as_mut) {
                    delivery.is_woken = true;
                }
            }
            let retry = self.serve(&mut buffer);
            match retry {
                None if self.deliveries.iter().flatten().any(|delivery| delivery.is_woken) => {}
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
                for delivery in self.deliveries.iter_mut().flatten() {
                    if delivery.lane == lane {
                        delivery.end(Some(Failure::Interrupted), 0, None);
                    }
                }
            }
        }
    }

    /// The one that has not ended, if the plug-in has used an id again.
    fn find(&mut self, lane: LaneId, id: u32) -> Option<&mut Delivery> {
        let mut all = self.deliveries.iter_mut().flatten();
        all.find(|delivery| delivery.lane == lane && delivery.id == id && !delivery.has_ended())
    }

    fn take_on(&mut self, incoming: Incoming) {
        // A lane has one at a time: what is still open there never got its end.
        for delivery in self.deliveries.iter_mut().flatten() {
            if delivery.lane == incoming.lane {
                delivery.end(Some(Failure::Interrupted), 0, None);
            }
        }
        let free = self.deliveries.iter().position(Option::is_none);
        let slot = free.unwrap_or(self.deliveries.len());
        if slot >= SLOTS {
            tracing::error!(link = incoming.link, "too many receptions at once, one is dropped");
            return;
        }
        incoming.bytes.wake_with(self.wakes.waker(slot));
        if free.is_none() {
            self.deliveries.push(None);
        }
        self.deliveries[slot] = Some(Delivery::new(incoming));
    }

    /// Gives each its turn; tells when the first of those that the disk refused is tried again.
    fn serve(&mut self, buffer: &mut [u8]) -> Option<Instant> {
        let now = Instant::now();
        let mut retry: Option<Instant> = None;
        for place in &mut self.deliveries {
            let Some(delivery) = place else { continue };
            if delivery.retry_at.map_or(!delivery.is_woken, |at| now < at) {
                retry = [retry, delivery.retry_at].into_iter().flatten().min();
                continue;
            }
            delivery.is_woken = false;
            match delivery.work(&self.office, buffer, &mut self.tell) {
                Ok(next) => {
                    if delivery.retry_at.take().is_some() {
                        (self.tell)(ClerkNews::GoesOn { link: delivery.link.clone() });
                    }
                    match next {
                        Next::Woken => {}
                        Next::Again => delivery.is_woken = true,
                        Next::Over => *place = None,
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
        for place in &mut self.deliveries {
            let Some(delivery) = place else { continue };
            delivery.end(Some(Failure::Interrupted), 0, None);
            loop {
                match delivery.work(&self.office, buffer, &mut self.tell) {
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
