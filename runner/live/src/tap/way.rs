//! One direction: read from one port, queued, paced, written to the other.

use softplug_abi::{LineErrorKind, LinkDownReason, Micros};

use super::queue::{First, Queue};
use super::{Event, Side};
use crate::clock::Clock;
use crate::error::PortError;
use crate::pacer::Pacer;
use crate::port::{Input, Port, ReadOutcome};

/// Bytes held where neither port keeps a rate.
const FAST_ROOM: usize = 4_096;
/// Bytes held where one does: what is held goes out even after an XOFF of the
/// receiver has passed the other way.
const PACED_ROOM: usize = 64;
/// A break passes as one of this length: how long it was is not told.
const BREAK: Micros = Micros::from_millis(250);

/// What a read found.
pub(super) enum Read {
    Some,
    Nothing,
    Gone(LinkDownReason),
}

/// From one port to the other.
#[derive(Debug)]
pub(super) struct Way {
    from: Side,
    queue: Queue,
    room: usize,
    /// Where the port that is written to keeps a rate.
    pacer: Option<Pacer>,
    /// The port took nothing: wait until it does.
    is_stuck: bool,
    break_until: Option<Micros>,
    told_break: bool,
}

impl Way {
    pub(super) fn new(from: Side, from_keeps_rate: bool, to: &Port, depth: u32) -> Self {
        let is_paced = to.rate_known() || from_keeps_rate;
        Self {
            from,
            queue: Queue::default(),
            room: if is_paced { PACED_ROOM } else { FAST_ROOM },
            pacer: to.rate_known().then(|| Pacer::new(to.line(), depth)),
            is_stuck: false,
            break_until: None,
            told_break: false,
        }
    }

    pub(super) fn from(&self) -> Side {
        self.from
    }

    pub(super) fn held(&self) -> usize {
        self.queue.len()
    }

    pub(super) fn has_room(&self) -> bool {
        self.queue.len() < self.room
    }

    /// Reads once, no more than there is room for.
    pub(super) fn read(
        &mut self,
        port: &mut Port,
        clock: Clock,
        sink: &mut dyn FnMut(Micros, Event<'_>),
    ) -> Result<Read, PortError> {
        let most = self.room.saturating_sub(self.queue.len());
        if most == 0 {
            return Ok(Read::Nothing);
        }
        let (queue, from) = (&mut self.queue, self.from);
        let outcome = port.read(most, &mut |input| {
            queue.put(&input);
            sink(clock.now(), Event::Heard { from, what: input });
        })?;
        Ok(match outcome {
            ReadOutcome::Read(_) => Read::Some,
            ReadOutcome::Empty => Read::Nothing,
            ReadOutcome::Gone(reason) => Read::Gone(reason),
        })
    }

    /// Writes once what the port may have now; whether something was passed on.
    pub(super) fn write(
        &mut self,
        port: &mut Port,
        clock: Clock,
        sink: &mut dyn FnMut(Micros, Event<'_>),
    ) -> Result<bool, PortError> {
        let now = clock.now();
        if let Some(until) = self.break_until {
            if now < until {
                return Ok(false);
            }
            self.end_break(port)?;
        }
        let to = self.from.other();
        match self.queue.first() {
            None => Ok(false),
            Some(First::Bytes(bytes)) => {
                let most = self.pacer.as_ref().map_or(usize::MAX, |pacer| pacer.available(now));
                let bytes = &bytes[..bytes.len().min(most)];
                let written = port.write(bytes)?;
                self.is_stuck = written == 0 && most > 0;
                if written == 0 {
                    return Ok(false);
                }
                sink(now, Event::Passed { to, what: Input::Bytes(&bytes[..written]) });
                self.took(now, written);
                self.queue.take_bytes(written);
                Ok(true)
            }
            Some(First::Mark(mark)) => {
                if let Some(byte) = mark.byte {
                    if self.pacer.as_ref().is_some_and(|pacer| pacer.available(now) == 0) {
                        return Ok(false);
                    }
                    self.is_stuck = port.write(&[byte])? == 0;
                    if self.is_stuck {
                        return Ok(false);
                    }
                    self.took(now, 1);
                } else if mark.kind == LineErrorKind::Break {
                    self.start_break(port, now, sink)?;
                }
                let what = Input::LineError { kind: mark.kind, byte: mark.byte, span: mark.span };
                sink(now, Event::Passed { to, what });
                self.queue.take_mark();
                Ok(true)
            }
        }
    }

    /// Whether something waits that the port did not take.
    pub(super) fn waits_for_port(&self, now: Micros) -> bool {
        let may_write = self.pacer.as_ref().is_none_or(|pacer| pacer.available(now) > 0);
        self.is_stuck && may_write && self.break_until.is_none()
    }

    /// When to write next, apart from when the port takes bytes again.
    pub(super) fn poll_timeout(&self, now: Micros) -> Option<Micros> {
        if self.break_until.is_some() {
            return self.break_until;
        }
        let waiting = self.queue.len();
        let pacer = self.pacer.as_ref().filter(|_| waiting > 0 && !self.is_stuck)?;
        Some(pacer.next(now, waiting))
    }

    /// Ends a break that is under way.
    pub(super) fn end_break(&mut self, port: &mut Port) -> Result<(), PortError> {
        match self.break_until.take() {
            Some(_) => port.stop_break(),
            None => Ok(()),
        }
    }

    fn took(&mut self, now: Micros, count: usize) {
        if let Some(pacer) = &mut self.pacer {
            pacer.took(now, count);
        }
    }

    fn start_break(
        &mut self,
        port: &mut Port,
        now: Micros,
        sink: &mut dyn FnMut(Micros, Event<'_>),
    ) -> Result<(), PortError> {
        match port.start_break() {
            Ok(()) => {
                self.break_until = Some(now + BREAK);
                if let Some(pacer) = &mut self.pacer {
                    pacer.busy_until(now + BREAK);
                }
                Ok(())
            }
            Err(PortError::Unsupported { what }) => {
                if !std::mem::replace(&mut self.told_break, true) {
                    sink(now, Event::Cannot { side: self.from.other(), what });
                }
                Ok(())
            }
            Err(error) => Err(error),
        }
    }
}
