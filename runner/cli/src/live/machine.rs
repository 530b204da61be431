//! A simulated control on a pty, driven until its transfer has ended.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use softplug_abi::Micros;
use softplug_conformance::partners::Partner;
use softplug_conformance::partners::xon_xoff::{Control, ControlReport};
use softplug_gateway::PortError;
use softplug_gateway::simulator::Simulator;

use crate::commands::simulate::Simulation;
use crate::failure::Failure;

/// How often a stop is looked for.
const TICK: Micros = Micros::from_millis(50);

/// A control at work.
pub(super) struct Machine {
    simulator: Simulator<Watched>,
    /// What it is to send, until it does.
    punch: Option<Vec<u8>>,
    punch_after: Micros,
    quiet_time: Option<Micros>,
}

impl Machine {
    pub(super) fn new(simulation: &Simulation) -> Result<Self, Failure> {
        let control = Control::new(simulation.control.clone()).map_err(Failure::usage)?;
        let control_bytes = [simulation.control.xon, simulation.control.xoff];
        let watched = Watched { control, control_bytes, moved_at: None, was_let_go: false };
        Ok(Self {
            simulator: Simulator::new(watched)?,
            punch: simulation.punch.clone(),
            punch_after: simulation.punch_after,
            quiet_time: simulation.quiet_time,
        })
    }

    /// The path to connect to.
    pub(super) fn path(&self) -> &Path {
        self.simulator.path()
    }

    /// Works until `stop`, or until a transfer has ended if only one is asked
    /// for.
    pub(super) fn run(&mut self, stop: &AtomicBool) -> Result<ControlReport, PortError> {
        while !stop.load(Ordering::Relaxed) {
            let now = self.simulator.now();
            self.simulator.turn(now + TICK)?;
            let now = self.simulator.now();
            let watched = &mut self.simulator.partner;
            if (watched.was_let_go || now >= self.punch_after)
                && let Some(program) = self.punch.take()
            {
                watched.control.punch(now, program);
            }
            let quiet = self.quiet_time.zip(watched.moved_at);
            // The report is a copy of all that came: only when it is quiet.
            if quiet.is_some_and(|(time, at)| now - at >= time) && !self.is_busy() {
                break;
            }
        }
        Ok(self.simulator.partner.control.report())
    }

    fn is_busy(&self) -> bool {
        let control = &self.simulator.partner.control;
        let report = control.report();
        self.punch.is_some()
            || report.punch_waiting > 0
            || report.consumed < report.received.count()
            || control.holds_line()
    }
}

/// A control whose data is seen to move.
#[derive(Debug)]
struct Watched {
    control: Control,
    /// XON and XOFF: they are no data.
    control_bytes: [u8; 2],
    moved_at: Option<Micros>,
    /// The other side has sent an XON.
    was_let_go: bool,
}

impl Watched {
    fn saw(&mut self, now: Micros, byte: u8) {
        if !self.control_bytes.contains(&byte) {
            self.moved_at = Some(now);
        }
    }
}

impl Partner for Watched {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.saw(now, byte);
        self.was_let_go |= byte == self.control_bytes[0];
        self.control.receive(now, byte);
    }

    fn next_event(&self) -> Option<Micros> {
        self.control.next_event()
    }

    fn advance(&mut self, now: Micros) {
        self.control.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        let byte = self.control.poll_transmit(now)?;
        self.saw(now, byte);
        Some(byte)
    }
}
