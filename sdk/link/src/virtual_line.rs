//! A link in virtual time: the clock is a number, the port a model of a UART.

use crate::{Link, LinkFault, LinkHost, LinkOptions, Taken, Wire, WireHost};
use core::hash::{Hash, Hasher};
use softplug_abi::{Action, Instance, Micros};

/// A [`Link`] on a [`Wire`].
///
/// At each instant, in this order: what came from the line (through
/// [`link`](Self::link)), [`handle_timeout`](Self::handle_timeout), host requests (again
/// through `link`), [`transmit`](Self::transmit).
///
/// The [crate's page](crate) has an example.
#[derive(Debug)]
pub struct VirtualLine<I: Instance> {
    /// The link; give it events and requests between the other calls.
    pub link: Link<I>,
    wire: Wire,
    break_until: Option<Micros>,
}

impl<I: Instance> VirtualLine<I> {
    /// A line on which at most `depth` characters are in flight.
    pub fn new(instance: I, options: LinkOptions, depth: usize) -> Self {
        let wire = Wire::new(options.line, depth);
        Self { link: Link::new(instance, options), wire, break_until: None }
    }

    /// A second line in the same state, with [`Link::fork`] of the link.
    #[must_use]
    pub fn fork(&self) -> Self
    where
        I: Clone,
    {
        let Self { link, wire, break_until } = self;
        Self { link: link.fork(), wire: wire.clone(), break_until: *break_until }
    }

    /// As [`Link::hash_ahead`], with what is on the wire.
    pub fn hash_ahead(&self, now: Micros, state: &mut impl Hasher) {
        self.link.hash_ahead(now, state);
        self.wire.hash_ahead(now, state);
        self.break_until.map(|until| until.0 - now.0).hash(state);
    }

    /// When something happens next without anything from outside.
    pub fn poll_timeout(&self) -> Option<Micros> {
        [self.link.poll_timeout(), self.wire.poll_timeout(), self.break_until]
            .into_iter()
            .flatten()
            .min()
    }

    /// Reports what has left the wire, then [`Link::handle_timeout`].
    ///
    /// # Errors
    /// The plug-in fails.
    pub fn handle_timeout(
        &mut self,
        now: Micros,
        host: &mut dyn LinkHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        self.wire.handle_timeout(now);
        self.break_until = self.break_until.filter(|until| *until > now);
        self.link.left(self.wire.left(), self.wire.left());
        self.link.handle_timeout(now, host)
    }

    /// [`handle_timeout`](Self::handle_timeout), then lets the transmitter take what it may, until
    /// nothing more happens at this instant: all of an instant to which nothing comes from outside.
    ///
    /// # Errors
    /// The plug-in fails.
    pub fn transmit(
        &mut self,
        now: Micros,
        host: &mut dyn WireHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        loop {
            self.handle_timeout(now, host)?;
            if self.break_until.is_some() {
                return Ok(());
            }
            let mut buffer = [0; 64];
            let space = self.wire.space().min(buffer.len());
            match self.link.take(&mut buffer[..space]) {
                Taken::Nothing => return Ok(()),
                Taken::Bytes(count) => {
                    for byte in &buffer[..count] {
                        let start = self.wire.give(now);
                        host.on_wire(start, *byte);
                        host.off_wire(self.wire.free_at(), *byte);
                    }
                }
                Taken::Break(micros) => {
                    let start = self.wire.give_break(now, Micros(i64::from(micros)));
                    self.break_until = Some(start + Micros(i64::from(micros)));
                    host.handle(start, &Action::Break { micros });
                }
            }
        }
    }

    /// Lets time go on to `until`, through every instant at which something
    /// happens by itself.
    ///
    /// # Errors
    /// The plug-in fails.
    pub fn run_until(
        &mut self,
        until: Micros,
        host: &mut dyn WireHost,
    ) -> Result<(), LinkFault<I::Fault>> {
        while let Some(next) = self.poll_timeout().filter(|next| *next <= until) {
            self.transmit(next.max(self.link.now()), host)?;
        }
        self.transmit(until, host)
    }
}
