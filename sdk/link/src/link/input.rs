//! What comes from the line.

use super::Link;
use crate::LinkHost;
use crate::fault::LinkFault;
use softplug_abi::{Event, Instance, LineErrorKind, LinkDownReason, Micros, ModemLines};

impl<I: Instance> Link<I> {
    /// Bytes from the line, all at this time. They may be cut anywhere.
    pub fn received(
        &mut self,
        now: Micros,
        bytes: &[u8],
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_input(now, host)?;
        let mut rest = bytes;
        while !rest.is_empty() {
            let (piece, later) = rest.split_at(rest.len().min(self.capacity()));
            rest = later;
            self.steps = 0;
            self.step(&Event::Received(piece), host)?;
        }
        Ok(())
    }

    /// A damaged character, an overrun or a break. `span` 0: exactly here; n: one
    /// of the last n bytes.
    pub fn line_error(
        &mut self,
        now: Micros,
        kind: LineErrorKind,
        byte: Option<u8>,
        span: u32,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_input(now, host)?;
        self.step(&Event::LineError { kind, byte, span }, host)
    }

    /// The modem lines have changed.
    pub fn modem_lines(
        &mut self,
        now: Micros,
        known: ModemLines,
        on: ModemLines,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_input(now, host)?;
        self.options.modem_lines = Some((known, on));
        self.step(&Event::ModemLines { known, on }, host)
    }

    /// The port is gone: nothing is sent until it is back. A port that is gone
    /// already is not told of again.
    pub fn link_down(
        &mut self,
        now: Micros,
        reason: LinkDownReason,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_input(now, host)?;
        if self.down.replace(reason).is_some() {
            return Ok(());
        }
        self.step(&Event::LinkDown(reason), host)
    }

    /// The port is back; the modem lines are told again.
    pub fn link_up(
        &mut self,
        now: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_input(now, host)?;
        if self.down.take().is_none() {
            return Ok(());
        }
        self.step(&Event::LinkUp, host)?;
        self.tell_modem_lines(host)
    }

    /// Line input of a later instant comes after the marks of an earlier one.
    fn begin_input(
        &mut self,
        now: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        let is_later = now > self.now;
        self.begin_instant(now);
        while let Some((mark, state)) = is_later.then(|| self.core.queue.next_mark()).flatten() {
            self.step(&Event::Mark { mark, state }, host)?;
        }
        self.steps = 0;
        Ok(())
    }
}
