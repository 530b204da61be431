//! One thread that drives lanes: what is ready, what is due, what is told,
//! each lane a bounded turn, round and round.

mod lane;

use mio::unix::SourceFd;
use mio::{Events, Interest, Poll, Registry, Token};
use softplug_abi::Instance;
use std::collections::{HashMap, HashSet};
use std::os::fd::{AsFd, AsRawFd};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, TryRecvError};
use std::task::Wake;

use super::deadlines::Deadlines;
use super::host::LaneHost;
use super::opener::Opener;
use super::setup::{Command, LaneId, LaneSetup};
use super::status::LaneStatus;
use super::{LaneInstance, Reports};
use crate::clock::Clock;
use crate::error::PortError;
use crate::port::{Port, PortOptions, PortSpec};
use crate::timer::Timer;
use lane::{Lane, TOKENS, Turn};

const TIMER: Token = Token(usize::MAX - 1);
const WAKER: Token = Token(usize::MAX - 2);
/// Events that are taken at once.
const EVENTS: usize = 256;

/// What a thread is told.
pub(super) enum ThreadCommand<I: Instance> {
    Add(LaneId, Box<LaneSetup<I>>, Arc<LaneStatus>),
    Tell(LaneId, Command<I>),
    Remove(LaneId),
    Opened(LaneId, Result<Port, PortError>),
    /// There is something to do for this lane.
    Poke(Arc<Poke<I>>),
    /// A lane of another thread is driven here from now on.
    Take(Box<Lane<I>>),
    Stop,
}

impl<I: Instance> ThreadCommand<I> {
    /// The lane for which this is, wherever it is driven.
    fn lane(&self) -> Option<LaneId> {
        match self {
            Self::Tell(id, _) | Self::Remove(id) | Self::Opened(id, _) => Some(*id),
            Self::Poke(poke) => Some(poke.id),
            Self::Add(..) | Self::Take(_) | Self::Stop => None,
        }
    }
}

/// How to reach a thread.
pub(super) struct Reach<I: Instance> {
    commands: Sender<ThreadCommand<I>>,
    waker: Arc<mio::Waker>,
}

impl<I: Instance> Clone for Reach<I> {
    fn clone(&self) -> Self {
        Self { commands: self.commands.clone(), waker: Arc::clone(&self.waker) }
    }
}

impl<I: Instance> Reach<I> {
    pub(super) fn give(&self, command: ThreadCommand<I>) {
        if self.commands.send(command).is_ok() {
            let _ = self.waker.wake();
        }
    }
}

/// Wakes a lane from another thread.
pub(super) struct Poke<I: Instance> {
    id: LaneId,
    reach: Reach<I>,
    /// Given and not taken yet: once is enough.
    is_given: AtomicBool,
}

impl<I: LaneInstance> Wake for Poke<I> {
    fn wake(self: Arc<Self>) {
        if !self.is_given.swap(true, Ordering::AcqRel) {
            self.reach.give(ThreadCommand::Poke(Arc::clone(&self)));
        }
    }
}

/// What lanes need of the thread that drives them.
pub(super) struct Thread<I: Instance> {
    pub(super) registry: Registry,
    pub(super) opener: Opener,
    pub(super) reach: Reach<I>,
    pub(super) clock: Clock,
}

impl<I: LaneInstance> Thread<I> {
    /// Has a lane's port opened, and sent to this thread.
    pub(super) fn open(&self, id: LaneId, spec: &PortSpec, options: &PortOptions) {
        let reach = self.reach.clone();
        let opened = move |opened| reach.give(ThreadCommand::Opened(id, opened));
        self.opener.open(spec, options, Box::new(opened));
    }
}

pub(super) struct Driver<I: Instance> {
    poll: Poll,
    timer: Timer,
    thread: Thread<I>,
    commands: Receiver<ThreadCommand<I>>,
    reports: Reports,
    lanes: Vec<Option<Box<Lane<I>>>>,
    free: Vec<usize>,
    slots: HashMap<LaneId, usize>,
    /// The thread for lanes that hold others up; none on that thread itself.
    aside: Option<Reach<I>>,
    /// Lanes that were given to it: what is for them is passed on.
    set_aside: HashSet<LaneId>,
    deadlines: Deadlines,
    /// Slots that have a turn to come, and whether each is among them.
    ready: Vec<usize>,
    is_ready: Vec<bool>,
    is_stopped: bool,
}

impl<I: LaneInstance> Driver<I> {
    /// A thread's driver, and how to reach it. Lanes that hold others up are given
    /// to `aside`.
    pub(super) fn new(
        opener: Opener,
        reports: Reports,
        aside: Option<Reach<I>>,
    ) -> Result<(Self, Reach<I>), PortError> {
        let failed = |error| PortError::io("set up a thread for links", error);
        let poll = Poll::new().map_err(failed)?;
        let waker = Arc::new(mio::Waker::new(poll.registry(), WAKER).map_err(failed)?);
        let clock = Clock::start();
        let timer = Timer::new(clock)?;
        let fd = timer.as_fd().as_raw_fd();
        poll.registry().register(&mut SourceFd(&fd), TIMER, Interest::READABLE).map_err(failed)?;
        let registry = poll.registry().try_clone().map_err(failed)?;
        let (sender, commands) = std::sync::mpsc::channel();
        let reach = Reach { commands: sender, waker };
        let driver = Self {
            poll,
            timer,
            thread: Thread { registry, opener, reach: reach.clone(), clock },
            commands,
            reports,
            lanes: Vec::new(),
            free: Vec::new(),
            slots: HashMap::new(),
            aside,
            set_aside: HashSet::new(),
            deadlines: Deadlines::default(),
            ready: Vec::new(),
            is_ready: Vec::new(),
            is_stopped: false,
        };
        Ok((driver, reach))
    }

    /// Drives lanes until it is told to stop.
    pub(super) fn run(mut self) {
        let mut events = Events::with_capacity(EVENTS);
        while !self.is_stopped {
            if let Err(error) = self.wait(&mut events) {
                // Nothing can be heard any more; the lanes are told off below.
                tracing::error!(%error, "a thread for links has failed");
                break;
            }
            let mut is_called = false;
            for event in &events {
                match event.token() {
                    TIMER => self.timer.has_expired(),
                    WAKER => is_called = true,
                    token => self.hand_over(token.0 / TOKENS, event),
                }
            }
            if is_called {
                self.take_orders();
            }
            self.take_due();
            self.take_turns();
        }
        for slot in 0..self.lanes.len() {
            self.end_lane(slot);
        }
    }

    fn wait(&mut self, events: &mut Events) -> Result<(), PortError> {
        let mut patience = None;
        if self.ready.is_empty() {
            self.arm()?;
        } else {
            patience = Some(std::time::Duration::ZERO);
        }
        match self.poll.poll(events, patience) {
            Ok(()) => Ok(()),
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => {
                events.clear();
                Ok(())
            }
            Err(error) => Err(PortError::io("wait for links", error)),
        }
    }

    /// Sets the timer, unless it is set for earlier: that costs one turn of
    /// nothing, setting it at each event would cost more.
    fn arm(&mut self) -> Result<(), PortError> {
        let Some(next) = self.deadlines.next() else { return Ok(()) };
        if self.timer.deadline().is_some_and(|set| set <= next) {
            return Ok(());
        }
        self.timer.set(Some(next))
    }

    fn hand_over(&mut self, slot: usize, event: &mio::event::Event) {
        if let Some(Some(lane)) = self.lanes.get_mut(slot) {
            lane.call();
            lane.ready(&self.thread, event);
            mark(&mut self.ready, &mut self.is_ready, slot);
        }
    }

    fn take_orders(&mut self) {
        while !self.is_stopped {
            match self.commands.try_recv() {
                Ok(command) => {
                    if let Some(command) = self.pass_on(command) {
                        self.take_order(command);
                    }
                }
                Err(TryRecvError::Disconnected) => self.is_stopped = true,
                Err(TryRecvError::Empty) => return,
            }
        }
    }

    fn take_order(&mut self, command: ThreadCommand<I>) {
        match command {
            ThreadCommand::Add(id, setup, status) => self.add(id, *setup, status),
            ThreadCommand::Tell(id, command) => {
                self.with(id, |lane, thread| lane.tell(thread, command));
            }
            ThreadCommand::Opened(id, opened) => self.take_opened(id, opened),
            ThreadCommand::Remove(id) => {
                if let Some(slot) = self.slots.get(&id).copied() {
                    self.end_lane(slot);
                }
            }
            ThreadCommand::Poke(poke) => {
                poke.is_given.store(false, Ordering::Release);
                self.with(poke.id, |_, _| {});
            }
            ThreadCommand::Take(lane) => self.take_over(lane),
            ThreadCommand::Stop => self.is_stopped = true,
        }
    }

    /// What is for a lane that was set aside goes after it; gives back all else.
    fn pass_on(&mut self, command: ThreadCommand<I>) -> Option<ThreadCommand<I>> {
        let id = command.lane().filter(|id| self.set_aside.contains(id));
        let (Some(id), Some(aside)) = (id, &self.aside) else { return Some(command) };
        if matches!(command, ThreadCommand::Remove(_)) {
            self.set_aside.remove(&id);
        }
        aside.give(command);
        None
    }

    fn take_opened(&mut self, id: LaneId, opened: Result<Port, PortError>) {
        if self.slots.contains_key(&id) {
            self.with(id, |lane, thread| lane.opened(thread, opened));
        } else if let Ok(port) = opened {
            self.thread.opener.close(port);
        }
    }

    fn add(&mut self, id: LaneId, setup: LaneSetup<I>, status: Arc<LaneStatus>) {
        let slot = self.free_slot();
        let poke = Poke { id, reach: self.thread.reach.clone(), is_given: AtomicBool::new(false) };
        let reports = Arc::clone(&self.reports);
        let host =
            |room, endpoint| LaneHost::new(id, reports, Arc::new(poke).into(), room, endpoint);
        let lane = Lane::new(id, slot, setup, host, status, &self.thread);
        self.put(slot, Box::new(lane));
    }

    fn free_slot(&mut self) -> usize {
        self.free.pop().unwrap_or_else(|| {
            self.lanes.push(None);
            self.is_ready.push(false);
            self.lanes.len() - 1
        })
    }

    fn put(&mut self, slot: usize, lane: Box<Lane<I>>) {
        self.slots.insert(lane.id, slot);
        self.lanes[slot] = Some(lane);
        mark(&mut self.ready, &mut self.is_ready, slot);
    }

    fn take_over(&mut self, mut lane: Box<Lane<I>>) {
        let slot = self.free_slot();
        lane.settle(slot, &self.thread);
        self.put(slot, lane);
    }

    /// Gives a lane to the thread for those that hold others up.
    fn give_away(&mut self, slot: usize) {
        let Some(aside) = self.aside.clone() else { return };
        let Some(mut lane) = self.lanes[slot].take() else { return };
        lane.leave(&self.thread);
        self.set_aside.insert(lane.id);
        self.free_up(slot, lane.id);
        aside.give(ThreadCommand::Take(lane));
    }

    fn with(&mut self, id: LaneId, act: impl FnOnce(&mut Lane<I>, &Thread<I>)) {
        let Some(slot) = self.slots.get(&id).copied() else { return };
        if let Some(lane) = &mut self.lanes[slot] {
            lane.call();
            act(lane, &self.thread);
            mark(&mut self.ready, &mut self.is_ready, slot);
        }
    }

    fn take_due(&mut self) {
        let now = self.thread.clock.now();
        while let Some(slot) = self.deadlines.take_due(now) {
            mark(&mut self.ready, &mut self.is_ready, slot);
        }
    }

    /// One turn for each that is ready now; who wants more is ready again.
    fn take_turns(&mut self) {
        let (mut removed, mut burdens) = (Vec::new(), Vec::new());
        let count = self.ready.len();
        for at in 0..count {
            let slot = self.ready[at];
            self.is_ready[slot] = false;
            let Some(lane) = &mut self.lanes[slot] else { continue };
            let turn = lane.turn(&self.thread);
            if self.aside.is_some() && lane.is_burden() {
                burdens.push(slot);
            }
            match turn {
                Turn::More => mark(&mut self.ready, &mut self.is_ready, slot),
                Turn::Until(deadline) => self.deadlines.set(slot, deadline),
                Turn::Removed => removed.push(slot),
            }
        }
        self.ready.drain(..count);
        for slot in removed {
            self.forget(slot);
        }
        for slot in burdens {
            self.give_away(slot);
        }
    }

    fn end_lane(&mut self, slot: usize) {
        if let Some(lane) = &mut self.lanes[slot] {
            lane.end(&self.thread);
            self.forget(slot);
        }
    }

    fn forget(&mut self, slot: usize) {
        if let Some(lane) = self.lanes[slot].take() {
            self.free_up(slot, lane.id);
        }
    }

    fn free_up(&mut self, slot: usize, id: LaneId) {
        self.slots.remove(&id);
        self.deadlines.clear(slot);
        self.free.push(slot);
    }
}

fn mark(ready: &mut Vec<usize>, is_ready: &mut [bool], slot: usize) {
    if !std::mem::replace(&mut is_ready[slot], true) {
        ready.push(slot);
    }
}
