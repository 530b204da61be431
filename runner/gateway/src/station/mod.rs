//! A station: one port, one plug-in, one clock, on the thread that runs it.

mod counters;
mod departures;
mod tap;

pub use counters::Counters;

use departures::Departures;
use softplug_abi::manifest::SettingValues;
use softplug_abi::{Failure, Instance, LinkDownReason, Micros, ModemLines};
use softplug_link::{Job, Link, LinkFault, LinkOptions, Outside, Taken};
use std::error::Error;
use tap::Tap;
use thiserror::Error;

use crate::clock::Clock;
use crate::error::PortError;
use crate::pacer::{Pacer, default_depth};
use crate::poll::{Interest, Poller};
use crate::port::{Input, Port, ReadOutcome};

/// A received byte is delivered as at most so many: a line end can become LF CR CR.
const GROWTH: u32 = 3;
/// Most reads and writes of one turn: then the host has its say.
const ROUNDS: usize = 16;
/// Most bytes that are taken from the link at once.
const CHUNK: usize = 64;
/// How often modem lines are looked at.
const MODEM_LINES_EVERY: Micros = Micros::from_millis(20);

/// What a station is made with.
#[derive(Clone, Debug)]
pub struct StationOptions {
    /// A value for every setting of the plug-in.
    pub settings: SettingValues,
    /// Characters that may be in flight; by baud if `None`.
    pub depth: Option<u32>,
    /// Bytes that the transmit queue takes.
    pub transmit_room: u32,
    /// Bytes of deliveries that may wait to be put away.
    pub delivery_room: u32,
}

impl Default for StationOptions {
    /// No settings, depth by baud, 4,096 bytes to transmit, 16,384 to deliver.
    fn default() -> Self {
        Self {
            settings: SettingValues::default(),
            depth: None,
            transmit_room: 4_096,
            delivery_room: 16_384,
        }
    }
}

/// Why a station cannot go on.
#[derive(Debug, Error)]
pub enum StationError<F: Error + 'static> {
    /// The port, or the system below it.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The plug-in has ended.
    #[error(transparent)]
    Plugin(#[from] LinkFault<F>),
}

/// What a turn left behind.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Turn {
    /// Go on.
    Live,
    /// The port is gone; the plug-in has been told.
    Gone(LinkDownReason),
}

/// One port with a plug-in on it.
///
/// [`turn`](Self::turn) reads, delivers what is due, writes what may leave, and
/// waits. Requests of the host come between turns.
#[derive(Debug)]
pub struct Station<I: Instance> {
    port: Port,
    link: Link<I>,
    pacer: Pacer,
    poller: Poller,
    departures: Departures,
    /// Given out by the link, not yet taken by the port.
    pending: [u8; CHUNK],
    pending_from: usize,
    pending_to: usize,
    /// A break to send as soon as nothing is in flight, and one under way.
    break_next: Option<u32>,
    break_until: Option<Micros>,
    modem_lines: Option<(ModemLines, ModemLines)>,
    counters: Counters,
    gone: Option<LinkDownReason>,
}

impl<I: Instance> Station<I> {
    /// A station whose link is not open yet.
    pub fn new(port: Port, instance: I, options: StationOptions) -> Result<Self, PortError> {
        let line = port.line();
        let modem_lines = port.modem_lines();
        let link = Link::new(
            instance,
            LinkOptions {
                line,
                transmit_room: options.transmit_room,
                delivery_room: options.delivery_room,
                modem_lines,
                settings: options.settings,
            },
        );
        let depth = options.depth.unwrap_or_else(|| default_depth(line.baud));
        let departures = Departures::new(port.rate_known());
        Ok(Self {
            port,
            link,
            pacer: Pacer::new(line, depth),
            poller: Poller::new(Clock::start())?,
            departures,
            pending: [0; CHUNK],
            pending_from: 0,
            pending_to: 0,
            break_next: None,
            break_until: None,
            modem_lines,
            counters: Counters::default(),
            gone: None,
        })
    }

    /// The port.
    pub fn port(&self) -> &Port {
        &self.port
    }

    /// The plug-in's link.
    pub fn link(&self) -> &Link<I> {
        &self.link
    }

    /// What has been counted so far.
    pub fn counters(&self) -> Counters {
        self.counters.at(self.now())
    }

    /// Time on the link's clock.
    pub fn now(&self) -> Micros {
        self.poller.clock().now()
    }

    /// Gives the settings to the plug-in and opens the link.
    pub fn open(&mut self, outside: &mut dyn Outside) -> Result<(), StationError<I::Fault>> {
        self.ask(outside, |link, now, outside| link.open(now, outside))
    }

    /// Begins a job.
    pub fn begin_job(
        &mut self,
        job: Job,
        outside: &mut dyn Outside,
    ) -> Result<(), StationError<I::Fault>> {
        self.ask(outside, |link, now, outside| link.begin_job(now, job, outside))
    }

    /// Aborts the job, or, with 0, the delivery under way.
    pub fn abort(
        &mut self,
        job: u32,
        outside: &mut dyn Outside,
    ) -> Result<(), StationError<I::Fault>> {
        self.ask(outside, |link, now, outside| link.abort(now, job, outside))
    }

    /// Asks for a pause of the job.
    pub fn pause(
        &mut self,
        job: u32,
        outside: &mut dyn Outside,
    ) -> Result<(), StationError<I::Fault>> {
        self.ask(outside, |link, now, outside| link.pause(now, job, outside))
    }

    /// Ends the pause.
    pub fn resume(
        &mut self,
        job: u32,
        outside: &mut dyn Outside,
    ) -> Result<(), StationError<I::Fault>> {
        self.ask(outside, |link, now, outside| link.resume(now, job, outside))
    }

    /// Answers a request: with data, or with why it is refused. One that was
    /// withdrawn in the meantime gets no answer.
    pub fn answer(
        &mut self,
        request: u32,
        answer: Result<&[u8], Failure>,
        outside: &mut dyn Outside,
    ) -> Result<(), StationError<I::Fault>> {
        self.ask(outside, |link, now, outside| link.answer(now, request, answer, outside))
    }

    /// Goes on although the partner holds the line.
    pub fn force_resume(
        &mut self,
        outside: &mut dyn Outside,
    ) -> Result<(), StationError<I::Fault>> {
        self.ask(outside, |link, now, outside| link.force_resume(now, outside))
    }

    /// One turn: what came, what is due, what may leave; then waits until there
    /// is more to do or `until` has come.
    pub fn turn(
        &mut self,
        until: Micros,
        outside: &mut dyn Outside,
    ) -> Result<Turn, StationError<I::Fault>> {
        self.work(outside)?;
        if let Some(reason) = self.gone {
            return Ok(Turn::Gone(reason));
        }
        self.wait(until)?;
        Ok(Turn::Live)
    }

    /// Lets what was given to the port leave, at most for `patience`, then
    /// closes the link.
    pub fn close(
        &mut self,
        patience: Micros,
        outside: &mut dyn Outside,
    ) -> Result<(), StationError<I::Fault>> {
        let until = self.now() + patience;
        while self.gone.is_none() && self.now() < until && self.is_sending() {
            self.turn(until, outside)?;
        }
        self.ask(outside, |link, now, outside| link.close(now, outside))
    }

    fn is_sending(&self) -> bool {
        self.link.has_to_send()
            || self.pending_from < self.pending_to
            || self.pacer.in_flight(self.now()) > 0
            || self.port.unsent() > 0
    }

    fn ask(
        &mut self,
        outside: &mut dyn Outside,
        act: impl FnOnce(&mut Link<I>, Micros, &mut dyn Outside) -> Result<(), LinkFault<I::Fault>>,
    ) -> Result<(), StationError<I::Fault>> {
        let now = self.now();
        let mut tap = Tap::new(outside, &mut self.counters);
        let asked = act(&mut self.link, now, &mut tap);
        let lines = tap.modem_lines;
        self.set_modem_lines(lines)?;
        asked?;
        Ok(())
    }

    /// What can be done without waiting. Reads before each write: a stop that
    /// is already there must stop the next byte. One read before each write,
    /// too: a partner that never pauses must not keep our own stop from leaving.
    fn work(&mut self, outside: &mut dyn Outside) -> Result<(), StationError<I::Fault>> {
        for _ in 0..ROUNDS {
            let has_read = self.read(outside)?;
            let now = self.now();
            self.look_at_modem_lines(now, outside)?;
            let (maybe, surely) = self.departures.left(now, self.port.unsent());
            self.link.left(maybe, surely);
            self.ask(outside, |link, now, outside| link.run(now, outside))?;
            let has_sent = self.gone.is_none() && self.send_some(now, outside)?;
            if !has_read && !has_sent {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Reads once; whether something came.
    fn read(&mut self, outside: &mut dyn Outside) -> Result<bool, StationError<I::Fault>> {
        if self.gone.is_some() {
            return Ok(false);
        }
        let most = self.readable();
        if most == 0 {
            return Ok(false);
        }
        let now = self.now();
        let mut tap = Tap::new(outside, &mut self.counters);
        let (link, mut fault) = (&mut self.link, None);
        let outcome = self.port.read(most, &mut |input| {
            if fault.is_some() {
                return;
            }
            tap.counters.count_input(&input);
            let told = match input {
                Input::Bytes(bytes) => link.received(now, bytes, &mut tap),
                Input::LineError { kind, byte, span } => {
                    link.line_error(now, kind, byte, span, &mut tap)
                }
            };
            fault = told.err();
        })?;
        let lines = tap.modem_lines;
        self.set_modem_lines(lines)?;
        if let Some(fault) = fault {
            return Err(fault.into());
        }
        match outcome {
            ReadOutcome::Read(_) => Ok(true),
            ReadOutcome::Empty => Ok(false),
            ReadOutcome::Gone(reason) => self.went(reason, outside).map(|()| false),
        }
    }

    /// How many bytes may be read: what finds no room for delivery stays with
    /// the kernel, which loses nothing as long as the partner obeys.
    fn readable(&self) -> usize {
        (self.link.delivery_room() / GROWTH) as usize
    }

    fn went(
        &mut self,
        reason: LinkDownReason,
        outside: &mut dyn Outside,
    ) -> Result<(), StationError<I::Fault>> {
        self.gone = Some(reason);
        self.ask(outside, |link, now, outside| {
            link.link_down(now, reason, outside)?;
            link.run(now, outside)
        })
    }

    /// Gives the port what it may have now; whether something was given.
    fn send_some(
        &mut self,
        now: Micros,
        outside: &mut dyn Outside,
    ) -> Result<bool, StationError<I::Fault>> {
        if self.breaks(now)? {
            return Ok(false);
        }
        let available = self.pacer.available(now);
        if self.pending_from == self.pending_to {
            let most = available.min(CHUNK);
            match self.link.take(&mut self.pending[..most]) {
                Taken::Nothing => return Ok(false),
                Taken::Bytes(count) => (self.pending_from, self.pending_to) = (0, count),
                Taken::Break(micros) => {
                    self.break_next = Some(micros);
                    return Ok(true);
                }
            }
        }
        let end = self.pending_to.min(self.pending_from.saturating_add(available));
        let written = match self.port.write(&self.pending[self.pending_from..end]) {
            Ok(written) => written,
            Err(PortError::Gone { .. }) => {
                self.went(LinkDownReason::Unplugged, outside)?;
                return Ok(false);
            }
            Err(error) => return Err(error.into()),
        };
        self.pending_from += written;
        self.counters.bytes_out += written as u64;
        if written > 0 {
            let run = self.pacer.took(now, written);
            self.departures.took(run);
        }
        Ok(written > 0)
    }

    /// Drives a break; whether one is in the way of bytes.
    fn breaks(&mut self, now: Micros) -> Result<bool, PortError> {
        if let Some(until) = self.break_until {
            if now < until {
                return Ok(true);
            }
            self.break_until = None;
            self.port.stop_break()?;
        }
        let Some(micros) = self.break_next else { return Ok(false) };
        if self.pacer.in_flight(now) > 0 || self.port.unsent() > 0 {
            return Ok(true);
        }
        self.break_next = None;
        match self.port.start_break() {
            Ok(()) => {
                let until = now + Micros(i64::from(micros));
                self.pacer.busy_until(until);
                self.break_until = Some(until);
                Ok(true)
            }
            Err(PortError::Unsupported { what }) => {
                tracing::warn!("this port cannot {what}; the plug-in asked for it");
                Ok(false)
            }
            Err(error) => Err(error),
        }
    }

    fn look_at_modem_lines(
        &mut self,
        now: Micros,
        outside: &mut dyn Outside,
    ) -> Result<(), StationError<I::Fault>> {
        if self.modem_lines.is_none() {
            return Ok(());
        }
        let lines = self.port.modem_lines();
        if lines == self.modem_lines {
            return Ok(());
        }
        self.modem_lines = lines;
        let (known, on) = lines.unwrap_or_default();
        let mut tap = Tap::new(outside, &mut self.counters);
        let told = self.link.modem_lines(now, known, on, &mut tap);
        let wanted = tap.modem_lines;
        self.set_modem_lines(wanted)?;
        Ok(told?)
    }

    fn set_modem_lines(
        &mut self,
        lines: Option<(ModemLines, ModemLines)>,
    ) -> Result<(), PortError> {
        let Some((mask, on)) = lines else { return Ok(()) };
        match self.port.set_modem_lines(mask, on) {
            Err(PortError::Unsupported { what }) => {
                tracing::warn!("this port cannot {what}; the plug-in asked for it");
                Ok(())
            }
            set => set,
        }
    }

    fn wait(&mut self, until: Micros) -> Result<(), PortError> {
        let now = self.now();
        let is_stuck = self.pending_from < self.pending_to && self.pacer.available(now) > 0;
        let in_the_way = self.break_until.is_some() || self.break_next.is_some();
        let wants_to_send = !is_stuck
            && !in_the_way
            && (self.pending_from < self.pending_to || self.link.has_to_send());
        let waiting = self.link.waiting().max(1);
        let deadline = [
            Some(until),
            self.link.next_timer(),
            wants_to_send.then(|| self.pacer.next(now, waiting)),
            self.departures.next(),
            self.break_until,
            self.break_next.is_some().then_some(now + Micros::from_millis(1)),
            self.modem_lines.is_some().then_some(now + MODEM_LINES_EVERY),
        ];
        let deadline = deadline.into_iter().flatten().min();
        let interest = Interest { read: self.readable() > 0, write: is_stuck };
        self.poller.wait(Some(self.port.fd()), interest, deadline)?;
        Ok(())
    }
}
