//! A simulated machine on a pty, in real time.

use std::collections::VecDeque;
use std::os::fd::AsFd;
use std::path::Path;

use softplug_abi::Micros;
use softplug_machines::{Partner, Signal};

use crate::clock::Clock;
use crate::error::PortError;
use crate::poll::{Interest, Poller, Waker};
use crate::port::ReadOutcome;
use crate::pty::PtyPair;

/// Bytes read at once.
const CHUNK: usize = 4_096;

/// Drives a [`Partner`] at the master end of a pty; whoever opens
/// [`path`](Self::path) is connected to it.
///
/// A pty has no rate of its own: characters reach the machine when they are
/// read, and those that it sends are written when its model of the UART lets
/// them leave.
#[derive(Debug)]
pub struct Simulator<P> {
    /// The machine, to look at between turns.
    pub partner: P,
    pty: PtyPair,
    poller: Poller,
    buffer: Box<[u8]>,
    unwritten: VecDeque<u8>,
}

impl<P: Partner> Simulator<P> {
    /// A machine on a new pty; its clock starts now.
    pub fn new(partner: P) -> Result<Self, PortError> {
        Ok(Self {
            partner,
            pty: PtyPair::open()?,
            poller: Poller::new(Clock::start())?,
            buffer: vec![0; CHUNK].into(),
            unwritten: VecDeque::new(),
        })
    }

    /// The path to open.
    pub fn path(&self) -> &Path {
        self.pty.slave_path()
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
            self.unwritten.extend(on_a_pty(signal));
        }
        if !self.unwritten.is_empty() {
            let written = self.pty.write(self.unwritten.as_slices().0)?;
            self.unwritten.drain(..written);
        }
        let deadline = self.partner.next_event().map_or(until, |next| next.min(until));
        let interest = if self.unwritten.is_empty() { Interest::READ } else { Interest::BOTH };
        self.poller.wait(Some(self.pty.as_fd()), interest, Some(deadline))?;
        Ok(())
    }

    fn read(&mut self) -> Result<(), PortError> {
        while let ReadOutcome::Read(count) = self.pty.read(&mut self.buffer)? {
            let now = self.now();
            for byte in &self.buffer[..count] {
                self.partner.receive(now, *byte);
            }
        }
        Ok(())
    }
}

/// A pty shows no damage, no break and no modem lines: a damaged character is
/// what it was read as.
fn on_a_pty(signal: Signal) -> Option<u8> {
    match signal {
        Signal::Character(byte) => Some(byte),
        Signal::LineError { byte, .. } => byte,
        Signal::ModemLines { .. } => None,
    }
}
