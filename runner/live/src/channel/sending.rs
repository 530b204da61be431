//! From the link to the port: what may leave now, and breaks between.
//!
//! The pacer knows the line's rate, and not that somebody has stopped the line
//! below us: a kernel that obeys DC3, a clock that is slow. So a port that keeps
//! a rate is asked what it still holds before it is given more, and that counts
//! as in flight. What it holds of a job that has failed is called back, so that
//! it does not leave when the line is let go.

use softplug_abi::{Instance, Micros};
use softplug_link::Taken;

use super::{CHUNK, Channel, ChannelError, ChannelHost};
use crate::clock::Clock;
use crate::due::Due;
use crate::error::PortError;
use crate::port::{Backlog, CallsBack, Port};

/// How often a port is asked what it holds if nobody can stop it where it keeps
/// its rate: a slow clock makes it hold more only little by little.
const LOOK_EVERY: Micros = Micros::from_millis(16);
/// A port that has held the same for so long was stopped, unless its UART takes
/// longer for what it has taken.
const STOPPED: Micros = Micros::from_millis(20);
/// How often a port is asked that was stopped.
const WHILE_STOPPED: Micros = Micros::from_millis(10);

impl<I: Instance> Channel<I> {
    /// Gives the port what it may have now; whether something was given.
    pub(super) fn send_some(
        &mut self,
        now: Micros,
        clock: Clock,
        host: &mut dyn ChannelHost,
    ) -> Result<bool, ChannelError<I::Fault>> {
        if host.keeps_back() || self.call_back(now)? || self.breaks(now)? {
            return Ok(false);
        }
        if self.pending_from == self.pending_to && !self.link.has_to_send() {
            self.counters.nothing_to_send();
            return Ok(false);
        }
        self.look_below(now);
        let idle = self.pacer.idle(now);
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
        let Some(port) = &mut self.port else { return Ok(false) };
        let written = match port.write(&self.pending[self.pending_from..end]) {
            Ok(written) => written,
            Err(PortError::Gone(reason)) => {
                self.lose(now, reason, host)?;
                return Ok(false);
            }
            Err(error) => return Err(error.into()),
        };
        let after = clock.now();
        if written > 0 {
            host.wrote(now, &self.pending[self.pending_from..self.pending_from + written]);
            self.pending_from += written;
            let run = self.pacer.took_between(now, after, written);
            self.departures.took(now, run);
            let has_more = self.pending_from < self.pending_to || self.link.has_to_send();
            let character = self.pacer.line().characters(1);
            self.counters.wrote(written, idle, character, has_more);
        }
        Ok(written > 0)
    }

    /// What the port still holds counts as in flight.
    fn look_below(&mut self, now: Micros) {
        let Some(port) = self.port.as_ref().filter(|port| port.tells_backlog()) else { return };
        let is_watched = port.rate_known() && port.is_stoppable();
        if !is_watched && now < self.departures.looked_at() + LOOK_EVERY {
            return;
        }
        let backlog = Backlog { bytes: port.unsent(), is_empty: false };
        self.departures.looked(now, backlog);
        if !port.rate_known() {
            // What a server has not acknowledged is maybe only on its way.
            return;
        }
        self.pacer.holds(now, backlog.bytes);
        let is_stopped = self.departures.stuck_for(now) >= self.stopped_after();
        self.stopped_until = is_stopped.then_some(now + WHILE_STOPPED);
    }

    /// How long the port must have held the same to be taken for stopped.
    fn stopped_after(&self) -> Micros {
        let fifo = self.port.as_ref().and_then(Port::leaves_when_stopped).unwrap_or(0);
        STOPPED.max(self.pacer.line().characters(2 * u64::from(fifo)))
    }

    /// A job has failed: what the port has of it is called back, if the port allows it.
    pub(super) fn calls_back(&mut self, has_failed: bool) {
        let allows = |port: &Port| port.calls_back() != CallsBack::Never;
        let may = self.gone.is_none() && self.port.as_ref().is_some_and(allows);
        self.is_calling_back |= has_failed && may;
    }

    /// Calls back what the port holds of a job that has failed, if it does not
    /// leave by itself; whether the port is not to be given anything yet.
    fn call_back(&mut self, now: Micros) -> Result<bool, PortError> {
        if !self.is_calling_back {
            return Ok(false);
        }
        let stopped_after = self.stopped_after();
        let Some(port) = self.port.as_mut() else { return Ok(false) };
        match port.calls_back() {
            CallsBack::Stuck => {}
            CallsBack::AtOnce => {
                self.is_calling_back = false;
                self.departures.lost(now);
                return port.discard_output().map(|()| false);
            }
            CallsBack::Never => {
                self.is_calling_back = false;
                return Ok(false);
            }
        }
        let backlog = port.backlog();
        self.departures.looked(now, backlog);
        if backlog.bytes > 0 {
            if self.departures.stuck_for(now) < stopped_after {
                return Ok(true);
            }
            port.discard_output()?;
            self.departures.called_back();
            self.pacer.discarded(now);
        }
        self.is_calling_back = false;
        Ok(false)
    }

    /// Gives the port what it may have now, and nothing else: when there is to be
    /// more. `None` if there is more to do than to write, which [`work`](Self::work)
    /// does.
    pub fn write_on(
        &mut self,
        clock: Clock,
        host: &mut dyn ChannelHost,
    ) -> Result<Option<Due>, ChannelError<I::Fault>> {
        if self.gone.is_some() || self.may_read() || self.link.has_reports() {
            return Ok(None);
        }
        self.send_some(clock.now(), clock, host)?;
        let now = clock.now();
        let has_more = self.link.has_reports() || self.may_send(now);
        let may_wait = !has_more && self.wants_to_send(false);
        Ok(may_wait.then(|| self.next_write(now)))
    }

    /// Whether something waits and the line has room for it.
    pub(super) fn may_send(&self, now: Micros) -> bool {
        (self.pending_from < self.pending_to || self.link.has_to_send())
            && self.pacer.available(now) > 0
    }

    /// Whether the line has room for what waits and the port did not take it.
    pub(super) fn is_stuck(&self, now: Micros) -> bool {
        self.pending_from < self.pending_to && self.pacer.available(now) > 0
    }

    pub(super) fn wants_to_send(&self, is_stuck: bool) -> bool {
        let in_the_way = self.break_until.is_some() || self.break_next.is_some();
        !is_stuck && !in_the_way && (self.pending_from < self.pending_to || self.link.has_to_send())
    }

    /// Drives a break; whether one is in the way of bytes.
    fn breaks(&mut self, now: Micros) -> Result<bool, PortError> {
        let Some(port) = &mut self.port else { return Ok(true) };
        if let Some(until) = self.break_until {
            if now < until {
                return Ok(true);
            }
            self.break_until = None;
            port.stop_break()?;
        }
        let Some(micros) = self.break_next else { return Ok(false) };
        if self.pacer.in_flight(now) > 0 || port.unsent() > 0 {
            return Ok(true);
        }
        self.break_next = None;
        let is_sent = start_break(port)?;
        if is_sent {
            let until = now + Micros(i64::from(micros));
            self.pacer.busy_until(until);
            self.break_until = Some(until);
        }
        Ok(is_sent)
    }
}

/// Whether the port sends one.
fn start_break(port: &mut Port) -> Result<bool, PortError> {
    match port.start_break() {
        Ok(()) => Ok(true),
        Err(PortError::Unsupported { what }) => {
            tracing::warn!("this port cannot {what}; the plug-in asked for it");
            Ok(false)
        }
        Err(error) => Err(error),
    }
}
