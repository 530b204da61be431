//! A lane: a channel, its port that comes and goes, its jobs, its watchdogs.

mod faults;
mod jobs;
mod port;
mod swapping;
mod watchdogs;

use mio::unix::SourceFd;
use softplug_abi::limits::FUEL_PER_EVENT;
use softplug_abi::{Instance, JobId, Micros};
use softplug_link::{Link, LinkFault, LinkHost};
use std::ops::Range;
use std::os::fd::AsRawFd;
use std::sync::Arc;

use super::Thread;
use crate::channel::{Channel, StationOptions, Wants, Work};
use crate::clock::Clock;
use crate::due::Due;
use crate::reactor::endpoint::{ENDPOINT_JOBS, EndpointNews, LaneEndpoint};
use crate::reactor::host::LaneHost;
use crate::reactor::report::Report;
use crate::reactor::setup::{Command, LaneSetup};
use crate::reactor::status::{Condition, JobFigures, LaneStatus};
use crate::reactor::{LaneId, LaneInstance};
use crate::recorder::Recorded;
use port::PortSetup;
use swapping::Swapping;
use watchdogs::Watching;

/// Tokens of one lane: its port, then its endpoint's.
pub(super) const TOKENS: usize = 4;

/// Fuel that one event may use without holding up the lanes beside it: well above
/// what any sound plug-in was seen to use, and a quarter of a millisecond or so.
const LIGHT: u64 = FUEL_PER_EVENT / 4;

/// How old what is shown of a job may become while its line is written to: turns that only
/// write show nothing.
const SHOWN_EVERY: Micros = Micros::from_millis(250);

/// What a turn of a lane left behind.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Turn {
    /// There is more to do at once; others first.
    More,
    /// Nothing before something comes, or this time of the thread's clock.
    Until(Option<Micros>),
    /// The lane is no more.
    Removed,
}

pub(in crate::reactor) struct Lane<I: Instance> {
    pub(super) id: LaneId,
    tokens: Range<usize>,
    phase: Phase<I>,
    host: LaneHost,
    port: PortSetup,
    /// The lane's clock began here on the thread's.
    clock: Clock,
    began: Micros,
    watching: Watching,
    swapping: Swapping<I>,
    recorder_bytes: usize,
    status: Arc<LaneStatus>,
    next_endpoint_job: JobId,
    /// No plug-in that works is in it.
    is_faulted: bool,
    starved_since: Option<Micros>,
    closing_until: Option<Micros>,
    /// The last turn left nothing to do before `next_other` but to give the line more
    /// of what waits, and nothing has come since.
    only_writes: bool,
    next_other: Option<Micros>,
    /// When what has left of the job was shown last.
    shown_at: Micros,
    /// Its plug-in holds up all that share a thread with it.
    is_burden: bool,
    /// The device stays open when the lane has ended.
    hands_over: bool,
}

enum Phase<I: Instance> {
    /// The port has not been open yet.
    New(Option<Box<(Recorded<I>, StationOptions)>>),
    Open(Box<Channel<Recorded<I>>>),
}

impl<I: LaneInstance> Lane<I> {
    /// A lane in `slot`, whose port is asked for. `host` is made with the room
    /// for deliveries and the endpoint.
    pub(super) fn new(
        id: LaneId,
        slot: usize,
        setup: LaneSetup<I>,
        host: impl FnOnce(u32, Option<LaneEndpoint>) -> LaneHost,
        status: Arc<LaneStatus>,
        thread: &Thread<I>,
    ) -> Self {
        let first = slot * TOKENS;
        let instance = Recorded::new(setup.instance, setup.recorder_bytes);
        let mut lane = Self {
            id,
            tokens: first..first + TOKENS,
            host: host(setup.station.delivery_room, setup.endpoint),
            phase: Phase::New(Some(Box::new((instance, setup.station)))),
            swapping: Swapping::new(),
            recorder_bytes: setup.recorder_bytes,
            port: PortSetup::new(setup.port, setup.port_options, setup.reopen),
            clock: Clock::start(),
            began: thread.clock.now(),
            watching: Watching::new(setup.watchdogs),
            status,
            next_endpoint_job: ENDPOINT_JOBS,
            is_faulted: false,
            starved_since: None,
            closing_until: None,
            only_writes: false,
            next_other: None,
            shown_at: Micros::ZERO,
            is_burden: false,
            hands_over: false,
        };
        lane.attach_endpoint(thread);
        lane.ask_for_port(thread);
        lane
    }

    /// Whether its plug-in holds up all that share a thread with it: it has failed, or
    /// uses a good part of what one event may use.
    pub(super) fn is_burden(&self) -> bool {
        self.is_burden
    }

    /// Something has come up for it: its next turn is a whole one.
    pub(super) fn call(&mut self) {
        self.only_writes = false;
    }

    /// Leaves the thread, to be driven by another.
    pub(super) fn leave(&mut self, thread: &Thread<I>) {
        if let Phase::Open(channel) = &self.phase
            && let Some(port) = channel.port()
        {
            let _ = thread.registry.deregister(&mut SourceFd(&port.fd().as_raw_fd()));
        }
        if let Some(lane) = &mut self.host.endpoint {
            lane.endpoint.leave(&thread.registry);
        }
    }

    /// Goes on in `slot` of another thread.
    pub(super) fn settle(&mut self, slot: usize, thread: &Thread<I>) {
        let first = slot * TOKENS;
        self.tokens = first..first + TOKENS;
        self.call();
        self.began = thread.clock.now() - self.clock.now();
        self.attach_endpoint(thread);
        let Phase::Open(channel) = &mut self.phase else { return };
        channel.set_readable();
        let registered = channel.port().map(|port| self.port.register(thread, first, port));
        if let Some(Err(error)) = registered {
            self.port_failed(thread, &error);
        }
    }

    fn attach_endpoint(&mut self, thread: &Thread<I>) {
        let tokens = self.tokens.start + 1..self.tokens.end;
        if let Some(endpoint) = &mut self.host.endpoint
            && let Err(error) = endpoint.endpoint.attach(&thread.registry, tokens)
        {
            self.host.tell(Report::Endpoint(EndpointNews::Failed(error.to_string())));
        }
    }

    /// Something came for one of the lane's tokens.
    pub(super) fn ready(&mut self, thread: &Thread<I>, event: &mio::event::Event) {
        if event.token().0 == self.tokens.start {
            if let Phase::Open(channel) = &mut self.phase {
                // A hang-up is read, too.
                channel.set_readable();
            }
        } else if let Some(lane) = &mut self.host.endpoint {
            lane.endpoint.ready(&thread.registry, event, self.clock.now());
        }
    }

    pub(super) fn tell(&mut self, thread: &Thread<I>, command: Command<I>) {
        match command {
            Command::Watch(watch) => self.host.watch = watch,
            Command::Refill { job, source } => self.host.refill(job, source),
            Command::Begin(feed) => self.begin(thread, feed),
            Command::Pause(job) => {
                self.count_pause(job, true);
                self.ask(thread, |link, now, out| link.pause(now, job, out));
            }
            Command::Resume(job) => {
                self.ask(thread, |link, now, out| link.resume(now, job, out));
                self.count_pause(job, false);
            }
            Command::Abort(job) => {
                self.ask(thread, |link, now, out| link.abort(now, job, out));
            }
            Command::ForceResume => self.ask(thread, |link, now, out| link.force_resume(now, out)),
            Command::Answer { request, answer } => self.ask(thread, |link, now, out| {
                link.answer(now, request, answer.as_deref().map_err(|failure| *failure), out)
            }),
            Command::Swap(swap) => self.swap(thread, swap),
            Command::CancelSwap => self.cancel_swap(),
            Command::Halt(why) => self.halt(why),
            Command::Replace { instance, settings } => self.replace(thread, instance, settings),
            Command::Reopen => self.reopen(thread),
            Command::Close { patience, hand_over } => {
                self.hands_over = hand_over;
                self.close(patience);
            }
        }
    }

    /// One turn: what came, what is due, what may leave, up to a bound.
    pub(super) fn turn(&mut self, thread: &Thread<I>) -> Turn {
        self.write_on(thread).unwrap_or_else(|| self.whole_turn(thread))
    }

    /// A turn that only writes, where there is nothing else to do: most are such where
    /// many slow lines are full. What is shown of the lane stays as it was.
    fn write_on(&mut self, thread: &Thread<I>) -> Option<Turn> {
        let now = self.clock.now();
        let only_writes = std::mem::take(&mut self.only_writes);
        if !only_writes || self.next_other.is_some_and(|at| at <= now) {
            return None;
        }
        let Phase::Open(channel) = &mut self.phase else { return None };
        match channel.write_on(self.clock, &mut self.host) {
            Ok(Some(due)) => {
                self.only_writes = true;
                Some(self.until(Some(due)))
            }
            Ok(None) => None,
            Err(error) => {
                self.failed(thread, error);
                None
            }
        }
    }

    fn until(&self, write_on: Option<Due>) -> Turn {
        let due = Due::first([self.next_other.map(Due::exactly), write_on]);
        Turn::Until(due.map(|due| due.on_clock_since(self.began).gathered()))
    }

    fn whole_turn(&mut self, thread: &Thread<I>) -> Turn {
        self.retry_port(thread);
        self.turn_endpoint(thread);
        let mut more = false;
        if !self.is_faulted
            && let Phase::Open(channel) = &mut self.phase
        {
            match channel.work(self.clock, &mut self.host) {
                Ok(work) => more = work == Work::More,
                Err(error) => self.failed(thread, error),
            }
        }
        self.look_after_plugin(thread);
        self.look_after_port(thread);
        let now = self.clock.now();
        self.conclude(now);
        self.look_after_swap(thread);
        self.count_starved(now);
        self.host.tell_state(now);
        if self.is_closed(now) {
            self.end(thread);
            return Turn::Removed;
        }
        let counters = match &self.phase {
            Phase::Open(channel) => channel.counters(now),
            Phase::New(_) => crate::channel::Counters::default(),
        };
        self.watch(now, &counters);
        self.show(now, &counters);
        self.is_burden = self.is_faulted || self.largest_fuel() > LIGHT;
        if more || self.has_news() {
            return Turn::More;
        }
        let write_on = self.wants(thread, now);
        self.until(write_on)
    }

    /// A request of the host to the link; of a plug-in that has ended nothing is
    /// asked.
    fn ask(
        &mut self,
        thread: &Thread<I>,
        act: impl FnOnce(
            &mut Link<Recorded<I>>,
            Micros,
            &mut dyn LinkHost,
        ) -> Result<(), LinkFault<I::Fault>>,
    ) {
        if self.is_faulted {
            return;
        }
        let Phase::Open(channel) = &mut self.phase else { return };
        match channel.ask(self.clock.now(), &mut self.host, act) {
            Ok(Ok(())) => {}
            Ok(Err(fault)) => self.failed(thread, fault.into()),
            Err(error) => self.failed(thread, error.into()),
        }
    }

    /// Whether something has come up that the turn was too early for.
    fn has_news(&self) -> bool {
        !self.is_faulted && (self.host.is_supplied() || self.endpoint_waits())
    }

    /// When the line takes more of what waits. What else it is to be called for is
    /// noted.
    fn wants(&mut self, thread: &Thread<I>, now: Micros) -> Option<Due> {
        let mut wants = Wants::default();
        let mut line_free = None;
        if let Phase::Open(channel) = &self.phase {
            if !self.is_faulted {
                wants = channel.wants(now);
            }
            let waits_for_the_line = self.is_about_to_starve()
                || self.is_stopped_and_not_drained()
                || self.closing_until.is_some();
            line_free = waits_for_the_line.then(|| channel.next_look_at_the_line(now)).flatten();
        }
        self.want_write(thread, wants.write);
        let endpoint = self.host.endpoint.as_ref().and_then(|lane| lane.endpoint.poll_timeout());
        self.next_other = [
            wants.deadline,
            line_free,
            endpoint,
            self.port.retry_at,
            self.watching.poll_timeout(),
            self.host.poll_timeout(),
            self.closing_until,
            self.swap_deadline(now),
            self.host.job.as_ref().map(|_| self.shown_at + SHOWN_EVERY),
        ]
        .into_iter()
        .flatten()
        .min();
        self.only_writes = wants.write_on.is_some() && self.closing_until.is_none();
        wants.write_on
    }

    /// Stores what is shown of the lane.
    fn show(&mut self, now: Micros, counters: &crate::channel::Counters) {
        self.status.set_condition(self.condition());
        self.status.store_own(&self.host.own, self.starved_since, now);
        let Phase::Open(channel) = &mut self.phase else { return };
        self.status.store_counters(counters);
        let link = channel.link();
        let (events, fuel) = (link.events(), link.instance().total_fuel());
        let waiting = link.waiting();
        self.status.store_plugin(events, fuel, waiting, self.host.to_put_away());
        let mut figures = JobFigures::default();
        if let Some(active) = &self.host.job {
            self.shown_at = now;
            let left = channel.left_lately(now, active.from);
            let is_drained = active.is_hungry && channel.is_drained(now);
            figures = JobFigures {
                job: active.id,
                taken: active.taken,
                maybe_left: left.maybe,
                surely_left: left.surely,
                bytes_surely_left: 0,
                drained: if is_drained { active.taken } else { 0 },
                level: self.host.level(),
            };
            figures.count_bytes(waiting);
        }
        self.status.store_job(&figures);
    }

    fn largest_fuel(&self) -> u64 {
        match &self.phase {
            Phase::Open(channel) => channel.link().instance().largest_fuel(),
            Phase::New(_) => 0,
        }
    }

    fn condition(&self) -> Condition {
        if self.closing_until.is_some() {
            return Condition::Closing;
        }
        match &self.phase {
            _ if self.is_faulted => Condition::Faulted,
            Phase::New(_) => Condition::Opening,
            Phase::Open(channel) if channel.gone().is_some() => Condition::Down,
            Phase::Open(_) => Condition::Up,
        }
    }
}
