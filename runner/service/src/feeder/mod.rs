//! The feeder: one thread that fills the buffers of all jobs under way from their
//! snapshots, at the pace of their lines.
//!
//! A buffer is filled to its high mark; then each packet that the machine has taken makes room
//! for one more, which follows the last one by the pacing delay. Nothing is given away before it is
//! written down that it may leave; the writing is shared by all jobs that need it at the time.

mod pace;
mod progress;
mod stream;

pub use pace::Pace;
pub use stream::Stream;

use softplug_abi::JobId;
use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use softplug_live::reactor::LaneStatus;
use softplug_live::reservoir::ReservoirWriter;

use crate::jobs::{Advance, Data, Jobs};
use crate::programs::Snapshots;
use crate::wakes::{SLOTS, Wakes};
use progress::Progress;

/// How often progress is looked at.
const LOOK: Duration = Duration::from_millis(250);
/// How often it is looked whether all before a gate has left.
const LOOK_AT_GATES: Duration = Duration::from_millis(20);
/// When writing down failed, it is tried again after this.
const AGAIN: Duration = Duration::from_millis(500);

/// A job to feed.
#[derive(Debug)]
pub struct Feeding {
    /// The job.
    pub job: JobId,
    /// Its snapshot.
    pub data: Data,
    /// The first byte to send.
    pub from: u64,
    /// No byte from this one on is given before the gate is [moved](Feeder::move_gate).
    pub gate: Option<u64>,
    /// Where to.
    pub to: ReservoirWriter,
    /// How fast.
    pub pace: Pace,
    /// The plug-in only looks at the data: nothing leaves, nothing is paced.
    pub is_check: bool,
    /// The lane's figures, from which follows what has surely left.
    pub status: Option<Arc<LaneStatus>>,
}

/// What the feeder tells.
#[derive(Clone, PartialEq, Eq, Debug)]
pub enum FeederNews {
    /// What may leave cannot be written down: no job is fed further until it can be. Says why.
    Stalled(String),
    /// It can be written down again.
    GoesOn,
    /// All that lies before a job's gate has surely left.
    AtGate {
        /// The job.
        job: JobId,
        /// Its gate.
        gate: u64,
    },
}

/// The thread, until it is dropped.
#[derive(Debug)]
pub struct Feeder {
    requests: Option<Sender<Request>>,
    thread: Option<JoinHandle<()>>,
}

#[derive(Debug)]
enum Request {
    Feed(Box<Feeding>),
    Forget(JobId),
    Gate(JobId, Option<u64>),
}

impl Feeder {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system has no thread to give.
    pub fn start(
        jobs: Jobs,
        snapshots: Snapshots,
        tell: impl FnMut(FeederNews) + Send + 'static,
    ) -> io::Result<Self> {
        let (sender, requests) = channel();
        let thread = thread::Builder::new().name("feeder".to_owned());
        let thread = thread.spawn(move || {
            let wakes = Wakes::new(thread::current());
            let now = Instant::now();
            Worker {
                jobs,
                snapshots,
                tell,
                wakes,
                feeds: Vec::new(),
                due: BinaryHeap::new(),
                buffer: Vec::new(),
                next_look: now + LOOK,
                stalled: None,
            }
            .run(&requests);
        })?;
        Ok(Self { requests: Some(sender), thread: Some(thread) })
    }

    /// Feeds a job, from now on. If its data cannot be read, its buffer says so to the lane.
    pub fn feed(&self, feeding: Feeding) {
        self.request(Request::Feed(Box::new(feeding)));
    }

    /// A job has ended: it is not looked after any more. Its buffer ends where it is.
    pub fn forget(&self, job: JobId) {
        self.request(Request::Forget(job));
    }

    /// A job goes on, up to this byte; without one to its end.
    pub fn move_gate(&self, job: JobId, gate: Option<u64>) {
        self.request(Request::Gate(job, gate));
    }

    fn request(&self, request: Request) {
        if let (Some(requests), Some(thread)) = (&self.requests, &self.thread) {
            // It has panicked if not; then each buffer has failed, and says so.
            let _ = requests.send(request);
            thread.thread().unpark();
        }
    }
}

impl Drop for Feeder {
    fn drop(&mut self) {
        drop(self.requests.take());
        if let Some(thread) = self.thread.take() {
            thread.thread().unpark();
            let _ = thread.join();
        }
    }
}

/// A job that is being fed.
struct Feed {
    job: JobId,
    /// None when all of it has been given, or it has failed.
    to: Option<ReservoirWriter>,
    file: File,
    packet: usize,
    high: usize,
    /// The next byte to give.
    at: u64,
    end: u64,
    /// What is only looked at is looked at as a whole: it has no gate.
    is_check: bool,
    /// Nothing behind it is given yet.
    gate: Option<u64>,
    /// It was told that all before its gate has left.
    is_gate_told: bool,
    /// None from this byte on may be given yet.
    granted: u64,
    schedule: pace::Schedule,
    /// The buffer has been full once.
    is_filled: bool,
    progress: Option<Progress>,
}

struct Worker<T> {
    jobs: Jobs,
    snapshots: Snapshots,
    tell: T,
    wakes: Arc<Wakes>,
    feeds: Vec<Option<Feed>>,
    /// Who waits for its time.
    due: BinaryHeap<Reverse<(Instant, usize)>>,
    buffer: Vec<u8>,
    next_look: Instant,
    /// Since when nothing can be written down: tried again then.
    stalled: Option<Instant>,
}

impl<T: FnMut(FeederNews)> Worker<T> {
    fn run(mut self, requests: &Receiver<Request>) {
        let mut ready = Vec::new();
        loop {
            loop {
                match requests.try_recv() {
                    Ok(Request::Feed(feeding)) => ready.extend(self.take_on(*feeding)),
                    Ok(Request::Forget(job)) => self.forget(job),
                    Ok(Request::Gate(job, gate)) => ready.extend(self.move_gate(job, gate)),
                    Err(TryRecvError::Empty) => break,
                    Err(TryRecvError::Disconnected) => return,
                }
            }
            ready.extend(self.wakes.take());
            let now = Instant::now();
            while let Some(Reverse((due, slot))) = self.due.peek().copied()
                && due <= now
            {
                self.due.pop();
                ready.push(slot);
            }
            ready.sort_unstable();
            ready.dedup();
            if now >= self.next_look {
                self.next_look = now + LOOK;
                self.look_at_progress(now);
            }
            if !ready.is_empty() {
                self.serve(&mut ready, now);
            }
            if self.look_at_gates() {
                self.next_look = self.next_look.min(now + LOOK_AT_GATES);
            }
            let next = self.due.peek().map(|Reverse((due, _))| *due);
            let until = next.map_or(self.next_look, |due| due.min(self.next_look));
            thread::park_timeout(until.saturating_duration_since(Instant::now()));
        }
    }

    fn take_on(&mut self, feeding: Feeding) -> Option<usize> {
        let Feeding { job, data, from, gate, mut to, pace, is_check, status } = feeding;
        let file = match self.snapshots.open(data) {
            Ok(file) => file,
            Err(error) => {
                to.fail(format!("the program's snapshot is gone: {error}"));
                return None;
            }
        };
        // A job that is rewound has one before it.
        self.forget(job);
        let free = self.feeds.iter().position(Option::is_none);
        let slot = free.unwrap_or(self.feeds.len());
        if slot >= SLOTS {
            to.fail(format!("more than {SLOTS} jobs are fed already"));
            return None;
        }
        let (size, _, high) = to.figures().marks();
        let pace = if is_check { Pace { characters_a_second: None, ..pace } } else { pace };
        let packet = pace.packet.clamp(1, high.min(size));
        to.wake_with(self.wakes.waker(slot));
        let feed = Feed {
            job,
            to: Some(to),
            file,
            packet,
            high,
            at: from,
            end: data.size,
            is_check,
            gate: gate.filter(|_| !is_check),
            is_gate_told: false,
            granted: if is_check { u64::MAX } else { from },
            schedule: pace::Schedule::new(&Pace { packet, ..pace }, Instant::now()),
            is_filled: false,
            progress: status.filter(|_| !is_check).map(|status| Progress::new(status, job, from)),
        };
        if free.is_none() {
            self.feeds.push(None);
        }
        self.feeds[slot] = Some(feed);
        Some(slot)
    }

    fn move_gate(&mut self, job: JobId, gate: Option<u64>) -> Option<usize> {
        let is_its = |feed: &Option<Feed>| {
            feed.as_ref().is_some_and(|feed| feed.job == job && !feed.is_check)
        };
        let slot = self.feeds.iter().position(is_its)?;
        let feed = self.feeds[slot].as_mut()?;
        feed.gate = gate;
        feed.is_gate_told = false;
        Some(slot)
    }

    /// Tells whose gate all has left before; whether there are others that stand at theirs.
    fn look_at_gates(&mut self) -> bool {
        let mut waits = false;
        for feed in self.feeds.iter_mut().flatten() {
            let Some(gate) = feed.gate.filter(|gate| feed.at >= *gate && !feed.is_gate_told) else {
                continue;
            };
            let drained = feed.progress.as_ref().and_then(Progress::drained);
            feed.is_gate_told = drained.is_some_and(|drained| drained >= gate);
            waits |= !feed.is_gate_told;
            if feed.is_gate_told {
                (self.tell)(FeederNews::AtGate { job: feed.job, gate });
            }
        }
        waits
    }

    fn forget(&mut self, job: JobId) {
        for place in &mut self.feeds {
            if place.as_ref().is_some_and(|feed| feed.job == job) {
                *place = None;
            }
        }
    }

    fn serve(&mut self, ready: &mut Vec<usize>, now: Instant) {
        let grants = ready.iter().filter_map(|slot| self.feeds[*slot].as_ref()?.advance(now));
        let grants: Vec<Advance> = grants.collect();
        if !grants.is_empty() && self.write_down(&grants, now) {
            for feed in self.feeds.iter_mut().flatten() {
                let grant = grants.iter().find(|grant| grant.id == feed.job);
                if let Some(grant) = grant.and_then(|grant| grant.grant) {
                    feed.granted = grant;
                }
            }
        }
        for slot in ready.drain(..) {
            let Some(feed) = self.feeds.get_mut(slot).and_then(Option::as_mut) else { continue };
            match feed.give(&mut self.buffer) {
                Next::Woken => {}
                Next::At(due) => self.due.push(Reverse((due, slot))),
                Next::Ungranted => {
                    let again = self.stalled.unwrap_or(now).max(now);
                    self.due.push(Reverse((again, slot)));
                }
            }
        }
    }

    /// Whether it is on the disk now.
    fn write_down(&mut self, advances: &[Advance], now: Instant) -> bool {
        if self.stalled.is_some_and(|again| now < again) {
            return false;
        }
        match self.jobs.advance(advances) {
            Ok(()) => {
                if self.stalled.take().is_some() {
                    (self.tell)(FeederNews::GoesOn);
                }
                true
            }
            Err(error) => {
                if self.stalled.is_none() {
                    (self.tell)(FeederNews::Stalled(error.to_string()));
                }
                self.stalled = Some(now + AGAIN);
                false
            }
        }
    }

    fn look_at_progress(&mut self, now: Instant) {
        let mut advances = Vec::new();
        for feed in self.feeds.iter_mut().flatten() {
            let surely = feed.progress.as_mut().and_then(|progress| progress.look(now));
            advances.extend(surely.map(|surely| Advance {
                id: feed.job,
                grant: None,
                surely: Some(surely),
            }));
        }
        if !advances.is_empty() {
            // What could not be written this time is written the next.
            self.write_down(&advances, now);
        }
    }
}

/// What a feed waits for.
enum Next {
    /// Being woken, or forgotten.
    Woken,
    /// This time.
    At(Instant),
    /// That it may go on.
    Ungranted,
}

impl Feed {
    /// The next packet, or what is left of the program or up to the gate.
    fn next_packet(&self) -> usize {
        let end = self.gate.map_or(self.end, |gate| gate.min(self.end));
        (end.saturating_sub(self.at)).min(self.packet as u64) as usize
    }

    /// What must be written down before the next packet can go.
    fn advance(&self, now: Instant) -> Option<Advance> {
        self.to.as_ref()?;
        let next = self.at + self.next_packet() as u64;
        let is_due = !self.is_filled || self.schedule.due() <= now;
        // A buffer's worth: so often, and no oftener, something is written.
        let end = self.gate.map_or(self.end, |gate| gate.min(self.end));
        let grant = (self.at + self.high as u64).min(end);
        let advance = Advance { id: self.job, grant: Some(grant), surely: None };
        (is_due && next > self.granted && self.has_room()).then_some(advance)
    }

    fn has_room(&self) -> bool {
        self.to.as_ref().is_some_and(|to| to.room_to_high() >= self.next_packet())
    }

    /// Gives what may be given now.
    fn give(&mut self, buffer: &mut Vec<u8>) -> Next {
        loop {
            let packet = self.next_packet();
            let Some(to) = &mut self.to else { return Next::Woken };
            if to.is_abandoned() {
                self.to = None;
                return Next::Woken;
            }
            // Its end is behind the gate, too.
            let is_at_gate = self.gate.is_some_and(|gate| gate <= self.at);
            to.stop(is_at_gate);
            if is_at_gate {
                return Next::Woken;
            }
            if packet == 0 {
                to.finish();
                self.to = None;
                return Next::Woken;
            }
            if to.room_to_high() < packet {
                self.is_filled = true;
                to.wake_at(self.high - packet);
                return Next::Woken;
            }
            let begin = Instant::now();
            if self.is_filled && begin < self.schedule.due() {
                return Next::At(self.schedule.due());
            }
            if self.at + packet as u64 > self.granted {
                return Next::Ungranted;
            }
            buffer.resize(packet, 0);
            if let Err(error) = self.file.read_exact_at(buffer, self.at) {
                to.fail(format!("the program cannot be read: {error}"));
                self.to = None;
                return Next::Woken;
            }
            let written = to.write(buffer);
            debug_assert_eq!(written, packet, "nobody else writes, and there was room");
            self.at += written as u64;
            let end = Instant::now();
            if self.is_filled {
                self.schedule.sent(begin, end);
                tracing::trace!(
                    job = self.job.0, sending = ?self.schedule.sending, delay = ?self.schedule.delay(), "packet"
                );
            } else {
                self.schedule.filled(begin, end);
            }
        }
    }
}
