//! A plug-in and a simulated partner on one line, in virtual time.

use std::collections::VecDeque;

use softplug_abi::{Action, Instance, Micros};
use softplug_link::{LinkFault, LinkOptions, Outside, Supply, VirtualLine};

use crate::partners::Partner;

/// Both ends of a line. Time goes from one instant at which something happens
/// to the next; nothing is ever late.
#[derive(Debug)]
pub struct ClosedLoop<I: Instance, P> {
    /// The plug-in's end.
    pub line: VirtualLine<I>,
    /// The machine's end.
    pub partner: P,
    /// Characters on the wire: when their stop bit ends.
    in_flight: VecDeque<(Micros, u8)>,
    now: Micros,
}

impl<I: Instance, P: Partner> ClosedLoop<I, P> {
    /// A line on which the plug-in's port holds at most `depth` characters. The
    /// link is not open yet.
    pub fn new(instance: I, options: LinkOptions, depth: usize, partner: P) -> Self {
        let line = VirtualLine::new(instance, options, depth);
        Self { line, partner, in_flight: VecDeque::new(), now: Micros::ZERO }
    }

    /// Time on the line.
    pub fn now(&self) -> Micros {
        self.now
    }

    /// When something happens next; `None` if all is at rest.
    pub fn next(&self) -> Option<Micros> {
        let arrival = self.in_flight.front().map(|(end, _)| *end);
        [self.line.next(), arrival, self.partner.next_event()].into_iter().flatten().min()
    }

    /// Does all that happens at the next instant. `false` if all is at rest, or
    /// nothing happens up to `until`.
    pub fn step(
        &mut self,
        until: Micros,
        outside: &mut dyn Outside,
    ) -> Result<bool, LinkFault<I::Fault>> {
        let Some(next) = self.next().filter(|next| *next <= until) else { return Ok(false) };
        self.now = self.now.max(next);
        let now = self.now;
        while let Some((_, byte)) = self.in_flight.pop_front_if(|(end, _)| *end <= now) {
            self.partner.receive(now, byte);
        }
        self.partner.advance(now);
        while let Some(byte) = self.partner.poll_transmit(now) {
            self.line.link.received(now, &[byte], outside)?;
        }
        self.settle(outside)?;
        Ok(true)
    }

    /// Delivers what is due now and lets the transmitter take what it may; to
    /// be called after a request of the host.
    pub fn settle(&mut self, outside: &mut dyn Outside) -> Result<(), LinkFault<I::Fault>> {
        let mut watch = Watch { outside, in_flight: &mut self.in_flight };
        self.line.tick(self.now, &mut watch)
    }

    /// Steps until `is_done`, all is at rest, or time has come to `until`.
    pub fn run_until<O: Outside>(
        &mut self,
        until: Micros,
        outside: &mut O,
        is_done: impl Fn(&O) -> bool,
    ) -> Result<(), LinkFault<I::Fault>> {
        while !is_done(outside) && self.step(until, outside)? {}
        Ok(())
    }
}

/// Sees what goes onto the wire.
struct Watch<'a> {
    outside: &'a mut dyn Outside,
    in_flight: &'a mut VecDeque<(Micros, u8)>,
}

impl Outside for Watch<'_> {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        self.outside.handle(now, action);
    }

    fn supply(&mut self, job: u32, buffer: &mut [u8]) -> Supply {
        self.outside.supply(job, buffer)
    }

    fn rewind(&mut self, job: u32) {
        self.outside.rewind(job);
    }

    fn drained(&mut self) -> u32 {
        self.outside.drained()
    }

    fn on_wire(&mut self, start: Micros, byte: u8) {
        self.outside.on_wire(start, byte);
    }

    fn off_wire(&mut self, end: Micros, byte: u8) {
        self.in_flight.push_back((end, byte));
        self.outside.off_wire(end, byte);
    }
}
