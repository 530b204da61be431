//! A simulated machine, driven until its work has ended.

use std::net::SocketAddr;
use std::sync::atomic::{AtomicBool, Ordering};

use softplug_abi::{LineErrorKind, Micros};
use softplug_live::simulator::Simulator;
use softplug_live::{PortError, PortSpec};
use softplug_machines::{Partner, Signal};

/// How often a stop is looked for.
const TICK: Micros = Micros::from_millis(50);

/// A machine with what it does by itself.
pub(crate) trait Simulated: Partner {
    /// Somebody is connected; said at every turn.
    fn connected(&mut self, now: Micros) {
        let _ = now;
    }

    /// Does what is due beside what the line asks for.
    fn tend(&mut self, now: Micros);

    /// Whether it still has something to do.
    fn is_busy(&self) -> bool;

    /// Whether this character is data, and not only flow control.
    fn is_data(&self, byte: u8) -> bool {
        let _ = byte;
        true
    }
}

/// A machine at work.
pub(crate) struct Machine<P> {
    simulator: Simulator<Watched<P>>,
    quiet_time: Option<Micros>,
    /// What waited to be taken at the last look.
    unwritten: usize,
}

impl<P: Simulated> Machine<P> {
    /// On a pty of its own; with a quiet time it ends when nothing has moved for
    /// so long and all is done.
    pub(crate) fn new(partner: P, quiet_time: Option<Micros>) -> Result<Self, PortError> {
        let simulator = Simulator::new(Watched { partner, moved_at: None })?;
        Ok(Self { simulator, quiet_time, unwritten: 0 })
    }

    /// Behind a TCP port.
    pub(crate) fn listen(
        address: SocketAddr,
        partner: P,
        quiet_time: Option<Micros>,
    ) -> Result<Self, PortError> {
        let simulator = Simulator::listen(address, Watched { partner, moved_at: None })?;
        Ok(Self { simulator, quiet_time, unwritten: 0 })
    }

    /// The port to open.
    pub(crate) fn port(&self) -> PortSpec {
        self.simulator.port()
    }

    /// Whether something that it has sent was not taken.
    pub(crate) fn has_unwritten(&self) -> bool {
        self.simulator.unwritten() > 0
    }

    /// The machine, to look at.
    pub(crate) fn partner(&self) -> &P {
        &self.simulator.partner.partner
    }

    /// Works until `stop`, or until a transfer has ended if only one is asked
    /// for.
    pub(crate) fn run(&mut self, stop: &AtomicBool) -> Result<(), PortError> {
        while !stop.load(Ordering::Relaxed) {
            let now = self.simulator.now();
            self.simulator.turn(now + TICK)?;
            let now = self.simulator.now();
            let is_connected = self.simulator.is_connected();
            let unwritten = self.simulator.unwritten();
            let watched = &mut self.simulator.partner;
            if is_connected {
                watched.partner.connected(now);
            }
            // What the machine has sent moves only when it is taken.
            if std::mem::replace(&mut self.unwritten, unwritten) != unwritten {
                watched.moved_at = Some(now);
            }
            watched.partner.tend(now);
            let quiet = self.quiet_time.zip(watched.moved_at);
            if quiet.is_some_and(|(time, at)| now - at >= time) && !watched.partner.is_busy() {
                break;
            }
        }
        Ok(())
    }
}

/// A machine whose data is seen to move.
#[derive(Debug)]
struct Watched<P> {
    partner: P,
    moved_at: Option<Micros>,
}

impl<P: Simulated> Watched<P> {
    fn saw(&mut self, now: Micros, byte: u8) {
        if self.partner.is_data(byte) {
            self.moved_at = Some(now);
        }
    }
}

impl<P: Simulated> Partner for Watched<P> {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.saw(now, byte);
        self.partner.receive(now, byte);
    }

    fn receive_damaged(&mut self, now: Micros, kind: LineErrorKind, byte: Option<u8>) {
        self.partner.receive_damaged(now, kind, byte);
    }

    fn next_event(&self) -> Option<Micros> {
        self.partner.next_event()
    }

    fn advance(&mut self, now: Micros) {
        self.partner.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        let byte = self.partner.poll_transmit(now)?;
        self.saw(now, byte);
        Some(byte)
    }

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        let signal = self.partner.poll_signal(now)?;
        if let Signal::Character(byte) = signal {
            self.saw(now, byte);
        }
        Some(signal)
    }
}
