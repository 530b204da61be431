//! A simulated machine on a pty or a TCP port, in real time.

mod wire;

use std::collections::VecDeque;
use std::net::SocketAddr;

use softplug_abi::Micros;
use softplug_machines::{Partner, Signal};

use crate::PortSpec;
use crate::clock::Clock;
use crate::error::PortError;
use crate::poll::{Interest, Poller, Waker};
use wire::Wire;

/// Bytes read at once.
const CHUNK: usize = 4_096;
/// How often it is looked whether somebody connects.
const LOOK_EVERY: Micros = Micros::from_millis(20);

/// Drives a [`Partner`] at the master end of a pty, or at a TCP port that one program at a time
/// is connected to; whoever opens [`port`](Self::port) is connected to it.
///
/// Neither has a rate of its own: characters reach the machine when they are
/// read, and those that it sends are written when its model of the UART lets
/// them leave. What it sends while nobody is connected to a TCP port is lost, as on a cable that
/// is not plugged in.
#[derive(Debug)]
pub struct Simulator<P> {
    /// The machine, to look at between turns.
    pub partner: P,
    wire: Wire,
    poller: Poller,
    buffer: Box<[u8]>,
    unwritten: VecDeque<u8>,
}

impl<P: Partner> Simulator<P> {
    /// A machine on a new pty; its clock starts now.
    pub fn new(partner: P) -> Result<Self, PortError> {
        Self::on(Wire::pty()?, partner)
    }

    /// A machine behind a TCP port; its clock starts now. With port 0 the system chooses one.
    ///
    /// # Errors
    /// [`PortError::Listen`]: the address is not to be had.
    pub fn listen(address: SocketAddr, partner: P) -> Result<Self, PortError> {
        Self::on(Wire::tcp(address)?, partner)
    }

    fn on(wire: Wire, partner: P) -> Result<Self, PortError> {
        Ok(Self {
            partner,
            wire,
            poller: Poller::new(Clock::start())?,
            buffer: vec![0; CHUNK].into(),
            unwritten: VecDeque::new(),
        })
    }

    /// The port that whoever is to connect opens.
    pub fn port(&self) -> PortSpec {
        self.wire.port()
    }

    /// Whether somebody is connected to its TCP port; true of a pty, which does not tell.
    pub fn is_connected(&self) -> bool {
        self.wire.is_connected()
    }

    /// Characters that the machine has sent and nobody has taken.
    pub fn unwritten(&self) -> usize {
        self.unwritten.len()
    }

    /// Time on the machine's clock.
    pub fn now(&self) -> Micros {
        self.poller.clock().now()
    }

    /// Ends a turn that waits, from another thread.
    pub fn waker(&self) -> Waker {
        self.poller.waker()
    }

    /// Takes what came, does what is due, then waits until there is more to do
    /// or `until` has come.
    pub fn turn(&mut self, until: Micros) -> Result<(), PortError> {
        self.read()?;
        let now = self.now();
        self.partner.advance(now);
        while let Some(signal) = self.partner.poll_signal(now) {
            self.unwritten.extend(on_the_wire(signal));
        }
        if !self.unwritten.is_empty() {
            let written = self.wire.write(self.unwritten.as_slices().0)?;
            self.unwritten.drain(..written);
        }
        let source = self.wire.source();
        let until = if source.is_none() { until.min(now + LOOK_EVERY) } else { until };
        let deadline = self.partner.next_event().map_or(until, |next| next.min(until));
        let interest = if self.unwritten.is_empty() { Interest::READ } else { Interest::BOTH };
        self.poller.wait(source, interest, Some(deadline))?;
        Ok(())
    }

    fn read(&mut self) -> Result<(), PortError> {
        loop {
            let count = self.wire.read(&mut self.buffer)?;
            if count == 0 {
                return Ok(());
            }
            let now = self.now();
            for byte in &self.buffer[..count] {
                self.partner.receive(now, *byte);
            }
        }
    }
}

/// Neither a pty nor TCP shows damage, a break or modem lines: a damaged character is
/// what it was read as.
fn on_the_wire(signal: Signal) -> Option<u8> {
    match signal {
        Signal::Character(byte) => Some(byte),
        Signal::LineError { byte, .. } => byte,
        Signal::ModemLines { .. } => None,
    }
}
