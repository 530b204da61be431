//! From the port to the link: what came, in time, and behind what may have left
//! before it.
//!
//! The thread may be late anywhere. Two things hold all the same. Before the
//! plug-in is given anything that came, it is told of all that may have left by
//! then, on a clock that was read behind the read: an answer is never there
//! before what it answers. And no timer runs out before all has been read that
//! had come by then.

use softplug_abi::{Instance, Micros};

use super::departures::Departures;
use super::tap::Tap;
use super::{Channel, ChannelError, ChannelHost, MODEM_LINES_EVERY};
use crate::clock::Clock;
use crate::port::input_sink::InputSink;
use crate::port::scratch::READ_BYTES;
use crate::port::{Backlog, Input, Port, ReadOutcome, ShortRead};
use softplug_link::{Link, LinkFault};

/// Most bytes that a received one becomes: a line end can be LF CR CR.
const GROWTH: u32 = 3;
/// Bytes that are read at once where nothing is delivered.
const READ_UNDELIVERED: usize = 256;
/// Most reads before a timer that is due: a partner that never pauses must not
/// keep it back.
const READS: usize = 8;

/// How a read ended.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Drained {
    /// There was no more when it began, and no room to read it.
    Yes,
    /// There may be more.
    No,
}

impl<I: Instance> Channel<I> {
    /// Reads once, and again as long as a timer is due that might be stopped by
    /// what has come. Gives the time up to which all is known that came: timers
    /// up to it may run out.
    pub(super) fn take_in(
        &mut self,
        clock: Clock,
        host: &mut dyn ChannelHost,
    ) -> Result<Micros, ChannelError<I::Fault>> {
        let mut before = clock.now().max(self.link.now());
        for _ in 0..READS {
            if self.gone.is_some() {
                break;
            }
            // Nobody may have told yet of what came in time.
            self.readable |= self.is_due(before);
            if !self.readable {
                break;
            }
            let drained = self.read(clock, host)?;
            let latest = self.link.now();
            let is_missed = self.is_due(latest) && !self.is_due(before);
            if self.gone.is_some() || (drained == Drained::Yes && !is_missed) {
                break;
            }
            if drained == Drained::No && !self.is_due(latest) {
                // Others have their say, and our own stop its turn to leave.
                return Ok(latest);
            }
            before = clock.now().max(latest);
        }
        Ok(before.max(self.link.now()))
    }

    fn is_due(&self, now: Micros) -> bool {
        self.link.poll_timeout().is_some_and(|at| at <= now)
    }

    /// A time for what is not from the line: now, but before any timer that has
    /// not run out yet. What may stop it is perhaps not read.
    pub(super) fn before_timers(&self, now: Micros) -> Micros {
        let latest = self.link.now();
        let bound = self.link.poll_timeout().map_or(now, |at| now.min(at - Micros(1)));
        bound.max(latest)
    }

    /// Reads once.
    fn read(
        &mut self,
        clock: Clock,
        host: &mut dyn ChannelHost,
    ) -> Result<Drained, ChannelError<I::Fault>> {
        let most = self.readable_bytes();
        let Some(port) = self.port.as_mut().filter(|_| most > 0) else { return Ok(Drained::Yes) };
        let mut input = LinkInput {
            clock,
            at: None,
            link: &mut self.link,
            departures: &mut self.departures,
            tap: Tap::new(host, &mut self.counters, &self.pacer),
            fault: None,
        };
        let outcome = port.read_to(most, &mut input)?;
        let LinkInput { tap, fault, .. } = input;
        let has_failed = tap.has_failed;
        let lines = tap.modem_lines;
        self.set_modem_lines(lines)?;
        self.calls_back(has_failed);
        if let Some(fault) = fault {
            return Err(fault.into());
        }
        match outcome {
            ReadOutcome::Read(count) => {
                let is_short = count < most.min(READ_BYTES);
                let rest = self.port.as_ref().map(Port::short_read).filter(|_| is_short);
                self.readable = rest != Some(ShortRead::Empty);
                Ok(match rest {
                    Some(ShortRead::Empty | ShortRead::Taken) => Drained::Yes,
                    Some(ShortRead::KeptBack) | None => Drained::No,
                })
            }
            ReadOutcome::Empty => {
                self.readable = false;
                Ok(Drained::Yes)
            }
            ReadOutcome::Gone(reason) => {
                self.lose(clock.now(), reason, host)?;
                Ok(Drained::Yes)
            }
        }
    }

    /// Whether there is something to read and room for it, which may have come
    /// only after a look that found none.
    pub(super) fn may_read(&self) -> bool {
        self.readable && self.gone.is_none() && self.readable_bytes() > 0
    }

    /// How many bytes may be read: what finds no room for delivery stays with
    /// the kernel, which loses nothing as long as the partner obeys. Where nothing is delivered
    /// ever, nothing waits for room.
    pub(super) fn readable_bytes(&self) -> usize {
        if self.takes_deliveries {
            (self.link.known_delivery_room() / GROWTH) as usize
        } else {
            READ_UNDELIVERED
        }
    }

    /// Whether nobody tells of modem lines, so that they are looked at again and
    /// again.
    pub(super) fn looks_for_modem_lines(&self) -> bool {
        let tells = self.port.as_ref().is_some_and(Port::tells_modem_lines);
        self.modem_lines.is_some() && !tells
    }

    pub(super) fn look_at_modem_lines(
        &mut self,
        clock: Clock,
        host: &mut dyn ChannelHost,
    ) -> Result<(), ChannelError<I::Fault>> {
        let now = clock.now();
        if self.looks_for_modem_lines() && now < self.modem_lines_at {
            return Ok(());
        }
        self.modem_lines_at = now + MODEM_LINES_EVERY;
        let Some(port) = &self.port else { return Ok(()) };
        if self.modem_lines.is_none() && !port.tells_modem_lines() {
            return Ok(());
        }
        let lines = port.modem_lines();
        if lines == self.modem_lines {
            return Ok(());
        }
        self.modem_lines = lines;
        let (known, on) = lines.unwrap_or_default();
        let at = input_time(&self.link, clock.now());
        self.note_departures(at);
        host.modem_lines(at, known, on);
        self.ask_at(at, host, |link, at, host| link.modem_lines(at, known, on, host))??;
        Ok(())
    }
}

/// A time for what came from the line: later than that at which the plug-in was
/// last told of what has left, so that it is told first of what has left since.
pub(super) fn input_time<I: Instance>(link: &Link<I>, now: Micros) -> Micros {
    if link.awaits_departures() { now.max(link.now() + Micros(1)) } else { now.max(link.now()) }
}

/// Gives on to the link what a port heard.
struct LinkInput<'a, I: Instance> {
    clock: Clock,
    /// When it was read.
    at: Option<Micros>,
    link: &'a mut Link<I>,
    departures: &'a mut Departures,
    tap: Tap<'a>,
    fault: Option<LinkFault<I::Fault>>,
}

impl<I: Instance> InputSink for LinkInput<'_, I> {
    fn came(&mut self, backlog: impl FnOnce() -> Backlog) {
        let now = self.clock.now();
        let at = input_time(self.link, now);
        self.at = Some(at);
        if self.link.awaits_departures() {
            self.departures.looked(now, backlog());
            let (maybe, surely) = self.departures.places(at);
            self.link.left(maybe, surely);
        }
    }

    fn heard(&mut self, input: Input<'_>) {
        if self.fault.is_some() {
            return;
        }
        let at = self.at.unwrap_or_else(|| self.link.now());
        self.tap.heard(at, &input);
        let told = match input {
            Input::Bytes(bytes) => self.link.received(at, bytes, &mut self.tap),
            Input::LineError { kind, byte, span } => {
                self.link.line_error(at, kind, byte, span, &mut self.tap)
            }
        };
        self.fault = told.err();
    }
}
