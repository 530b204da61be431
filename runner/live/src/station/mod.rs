//! A station: a channel that waits for itself, on the thread that runs it.

pub use crate::channel::{ChannelError as StationError, Counters, StationOptions};

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use softplug_abi::{Action, Failure, Instance, JobId, LinkDownReason, Micros, RequestId};
use softplug_link::{Job, Link, LinkHost, Supply};

use crate::channel::{Channel, ChannelHost, Left, Place, Wants, Work};
use crate::clock::Clock;
use crate::error::PortError;
use crate::poll::{Interest, Poller, Source};
use crate::port::Port;

/// What a turn left behind.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Turn {
    /// Go on.
    Live,
    /// The port is gone; the plug-in has been told.
    Gone(LinkDownReason),
}

/// Keeps all back that the plug-in says. For a host that cannot put away what was delivered: it
/// pulls the brake before it lets the action go, and the acknowledgement behind it does not leave.
#[derive(Clone, Debug, Default)]
pub struct Brake(Arc<AtomicBool>);

impl Brake {
    /// Nothing leaves any more, until [`Station::drop_unsent`].
    pub fn pull(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether nothing leaves.
    pub fn is_pulled(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}

/// One port with a plug-in on it.
///
/// [`turn`](Self::turn) reads, delivers what is due, writes what may leave, and
/// waits. Requests of the host come between turns.
#[derive(Debug)]
pub struct Station<I: Instance> {
    channel: Channel<I>,
    poller: Poller,
    brake: Brake,
}

impl<I: Instance> Station<I> {
    /// A station whose link is not open yet.
    pub fn new(port: Port, instance: I, options: StationOptions) -> Result<Self, PortError> {
        let poller = Poller::new(Clock::start())?;
        let channel = Channel::new(port, instance, options);
        Ok(Self { channel, poller, brake: Brake::default() })
    }

    /// The port.
    pub fn port(&self) -> &Port {
        self.channel.port().expect("a station never gives its port away")
    }

    /// The plug-in's link.
    pub fn link(&self) -> &Link<I> {
        self.channel.link()
    }

    /// What has been counted so far.
    pub fn counters(&self) -> Counters {
        self.channel.counters(self.now())
    }

    /// How much the port was given so far: a job begins behind it.
    pub fn place(&self) -> Place {
        self.channel.place()
    }

    /// What has left of all that the port was given behind `from`.
    pub fn left(&mut self, from: Place) -> Left {
        self.channel.left(self.now(), from)
    }

    /// What the host pulls when something must not leave.
    pub fn brake(&self) -> Brake {
        self.brake.clone()
    }

    /// Drops what the plug-in has said and the port was not given, and lets the brake go.
    pub fn drop_unsent(&mut self) {
        let now = self.now();
        self.channel.drop_unsent(now);
        self.brake.0.store(false, Ordering::Relaxed);
    }

    /// Time on the link's clock.
    pub fn now(&self) -> Micros {
        self.poller.clock().now()
    }

    /// Gives the settings to the plug-in and opens the link.
    pub fn open(&mut self, host: &mut dyn LinkHost) -> Result<(), StationError<I::Fault>> {
        Ok(self.ask(host, |link, now, host| link.open(now, host))??)
    }

    /// Begins a job.
    pub fn begin_job(
        &mut self,
        job: Job,
        host: &mut dyn LinkHost,
    ) -> Result<(), StationError<I::Fault>> {
        Ok(self.ask(host, |link, now, host| link.begin_job(now, job, host))??)
    }

    /// Aborts the job, or, with 0, the delivery under way.
    pub fn abort(
        &mut self,
        job: JobId,
        host: &mut dyn LinkHost,
    ) -> Result<(), StationError<I::Fault>> {
        Ok(self.ask(host, |link, now, host| link.abort(now, job, host))??)
    }

    /// Answers a request: with data, or with why it is refused. One that was
    /// withdrawn in the meantime gets no answer.
    pub fn answer(
        &mut self,
        request: RequestId,
        answer: Result<&[u8], Failure>,
        host: &mut dyn LinkHost,
    ) -> Result<(), StationError<I::Fault>> {
        Ok(self.ask(host, |link, now, host| link.answer(now, request, answer, host))??)
    }

    /// A request of the host: whatever `act` does with the link, as it is done in a
    /// reactor's lanes. For a pause, or a plug-in that takes the place of the one that runs.
    ///
    /// # Errors
    /// The port failed. The inner result is that of the link.
    pub fn ask<R>(
        &mut self,
        host: &mut dyn LinkHost,
        act: impl FnOnce(&mut Link<I>, Micros, &mut dyn LinkHost) -> R,
    ) -> Result<R, PortError> {
        let now = self.now();
        self.channel.ask(now, &mut Unwatched(host, &self.brake), act)
    }

    /// One turn: what came, what is due, what may leave; then waits until there
    /// is more to do or `until` has come.
    pub fn turn(
        &mut self,
        until: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<Turn, StationError<I::Fault>> {
        let work = self.work(host)?;
        if let Some(reason) = self.channel.gone() {
            return Ok(Turn::Gone(reason));
        }
        if work == Work::Done {
            self.wait(until)?;
        }
        Ok(Turn::Live)
    }

    /// Turn after turn until `until` has come, the port is gone or the host has enough.
    pub fn turns<H: LinkHost>(
        &mut self,
        until: Micros,
        host: &mut H,
        has_enough: impl Fn(&H) -> bool,
    ) -> Result<Turn, StationError<I::Fault>> {
        let mut turn = Turn::Live;
        while turn == Turn::Live && self.now() < until && !has_enough(host) {
            turn = self.turn(until, host)?;
        }
        Ok(turn)
    }

    /// Lets what was given to the port leave, at most for `patience` and not with the brake
    /// pulled, then closes the link.
    pub fn close(
        &mut self,
        patience: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<(), StationError<I::Fault>> {
        let until = self.now() + patience;
        while self.now() < until && !self.brake.is_pulled() && self.channel.is_settling(self.now())
        {
            if self.work(host)? == Work::Done {
                // Nobody tells when the line has sent all.
                let look = self.channel.next_look_at_the_line(self.now());
                self.wait(look.map_or(until, |at| at.min(until)))?;
            }
        }
        Ok(self.ask(host, |link, now, host| link.close(now, host))??)
    }

    /// What a lane of a reactor does in its turn, too.
    fn work(&mut self, host: &mut dyn LinkHost) -> Result<Work, StationError<I::Fault>> {
        self.channel.set_readable();
        self.channel.work(self.poller.clock(), &mut Unwatched(host, &self.brake))
    }

    fn wait(&mut self, until: Micros) -> Result<(), PortError> {
        let Wants { read, write, deadline, write_on } = self.channel.wants(self.now());
        let write_on = write_on.map(|due| due.at);
        let deadline = [deadline, write_on].into_iter().flatten().fold(until, Micros::min);
        let port = self.channel.port().map(|port| port as &dyn Source);
        self.poller.wait(port, Interest { read, write }, Some(deadline))?;
        Ok(())
    }
}

/// A host that does not look at the line.
struct Unwatched<'a>(&'a mut dyn LinkHost, &'a Brake);

impl ChannelHost for Unwatched<'_> {
    fn keeps_back(&self) -> bool {
        self.1.is_pulled()
    }
}

impl LinkHost for Unwatched<'_> {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        self.0.handle(now, action);
    }

    fn supply(&mut self, job: JobId, buffer: &mut [u8]) -> Supply {
        self.0.supply(job, buffer)
    }

    fn rewind(&mut self, job: JobId) {
        self.0.rewind(job);
    }

    fn drained(&mut self) -> u32 {
        self.0.drained()
    }
}
