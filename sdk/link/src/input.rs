//! What comes from the line.

use crate::fault::LinkFault;
use crate::{Link, Outside};
use softplug_abi::{Event, Instance, LineErrorKind, LinkDownReason, Micros, ModemLines};

impl<I: Instance> Link<I> {
    /// Bytes from the line, all at this time. They may be cut anywhere.
    pub fn received(
        &mut self,
        now: Micros,
        bytes: &[u8],
        outside: &mut dyn Outside,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_input(now, outside)?;
        let mut rest = bytes;
        while !rest.is_empty() {
            let (piece, later) = rest.split_at(rest.len().min(self.capacity()));
            rest = later;
            self.steps = 0;
            self.step(&Event::Received(piece), outside)?;
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
        outside: &mut dyn Outside,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_input(now, outside)?;
        self.step(&Event::LineError { kind, byte, span }, outside)
    }

    /// The modem lines have changed.
    pub fn modem_lines(
        &mut self,
        now: Micros,
        known: ModemLines,
        on: ModemLines,
        outside: &mut dyn Outside,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_input(now, outside)?;
        self.options.modem_lines = Some((known, on));
        self.step(&Event::ModemLines { known, on }, outside)
    }

    /// The port is gone: nothing is sent until it is back. A port that is gone
    /// already is not told of again.
    pub fn link_down(
        &mut self,
        now: Micros,
        reason: LinkDownReason,
        outside: &mut dyn Outside,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_input(now, outside)?;
        if self.down.replace(reason).is_some() {
            return Ok(());
        }
        self.step(&Event::LinkDown(reason), outside)
    }

    /// The port is back; the modem lines are told again.
    pub fn link_up(
        &mut self,
        now: Micros,
        outside: &mut dyn Outside,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.begin_input(now, outside)?;
        if self.down.take().is_none() {
            return Ok(());
        }
        self.step(&Event::LinkUp, outside)?;
        self.tell_modem_lines(outside)
    }

    /// Line input of a later instant comes after the marks of an earlier one.
    fn begin_input(
        &mut self,
        now: Micros,
        outside: &mut dyn Outside,
    ) -> Result<(), LinkFault<I::Fault>> {
        let is_later = now > self.now;
        self.begin_instant(now);
        while let Some((mark, state)) = is_later.then(|| self.core.queue.next_mark()).flatten() {
            self.step(&Event::Mark { mark, state }, outside)?;
        }
        self.steps = 0;
        Ok(())
    }
}
