//! From the link to the port: what may leave now, and breaks between.

use softplug_abi::{Instance, Micros};
use softplug_link::Taken;

use super::{CHUNK, Channel, ChannelError, Surroundings};
use crate::due::Due;
use crate::error::PortError;
use crate::port::Port;

impl<I: Instance> Channel<I> {
    /// Gives the port what it may have now; whether something was given.
    pub(super) fn send_some(
        &mut self,
        now: Micros,
        outside: &mut dyn Surroundings,
    ) -> Result<bool, ChannelError<I::Fault>> {
        if self.breaks(now)? {
            return Ok(false);
        }
        if self.pending_from == self.pending_to && !self.link.has_to_send() {
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
        let Some(port) = &mut self.port else { return Ok(false) };
        let written = match port.write(&self.pending[self.pending_from..end]) {
            Ok(written) => written,
            Err(PortError::Gone(reason)) => {
                self.lose(now, reason, outside)?;
                return Ok(false);
            }
            Err(error) => return Err(error.into()),
        };
        if written > 0 {
            outside.wrote(now, &self.pending[self.pending_from..self.pending_from + written]);
            self.pending_from += written;
            self.counters.bytes_out += written as u64;
            let run = self.pacer.took(now, written);
            self.departures.took(now, run);
        }
        Ok(written > 0)
    }

    /// Gives the port what it may have now, and nothing else: when there is to be
    /// more. `None` if there is more to do than to write, which [`work`](Self::work)
    /// does.
    pub fn write_on(
        &mut self,
        now: Micros,
        outside: &mut dyn Surroundings,
    ) -> Result<Option<Due>, ChannelError<I::Fault>> {
        if self.gone.is_some() || self.may_read() || self.link.has_reports() {
            return Ok(None);
        }
        self.send_some(now, outside)?;
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
