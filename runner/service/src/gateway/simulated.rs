//! Simulated machines, so that a set-up can be tried without one.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};

use softplug_abi::{LineErrorKind, LineParameters, Micros};
use softplug_live::poll::Waker;
use softplug_live::simulator::Simulator;
use softplug_live::{PortError, PortSpec};
use softplug_machines::kept::Keep;
use softplug_machines::pulse_lathe::LatheOptionsError;
use softplug_machines::{
    Clocked, Partner, Signal, fanuc, kermit, pulse_lathe, r3964, xmodem, xon_xoff,
};
use thiserror::Error;

use crate::view::LatheView;

/// Why there is no simulated machine.
#[derive(Debug, Error)]
pub(crate) enum NoMachine {
    #[error("there is no simulated machine \"{0}\"")]
    Unknown(String),
    #[error(transparent)]
    Lathe(#[from] LatheOptionsError),
    #[error(transparent)]
    XonXoff(#[from] xon_xoff::ControlOptionsError),
    #[error(transparent)]
    R3964(#[from] r3964::OptionsError),
    #[error(transparent)]
    Fanuc(#[from] fanuc::OptionsError),
    #[error(transparent)]
    Port(#[from] PortError),
    #[error(transparent)]
    Thread(io::Error),
}

/// A simulated machine on a pty; it ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Simulated {
    port: PortSpec,
    stop: Arc<AtomicBool>,
    waker: Waker,
    thread: Option<JoinHandle<()>>,
    lathe: Option<SimulatedLathe>,
}

impl Simulated {
    /// A machine that speaks `protocol` at this line's rate.
    pub(crate) fn start(protocol: &str, line: LineParameters) -> Result<Self, NoMachine> {
        let lathe = (protocol == LATHE).then(SimulatedLathe::new).transpose()?;
        let machine = match &lathe {
            Some(lathe) => Machine(Box::new(lathe.clone())),
            None => machine(protocol, line)?,
        };
        let mut simulator: Simulator<Machine> = Simulator::new(machine)?;
        let (port, waker) = (simulator.port(), simulator.waker());
        let stop = Arc::new(AtomicBool::new(false));
        let is_stopped = Arc::clone(&stop);
        let thread = thread::Builder::new()
            .name(format!("simulated-{protocol}"))
            .spawn(move || {
                while !is_stopped.load(Ordering::Relaxed) {
                    let until = simulator.now() + Micros::from_millis(60_000);
                    if let Err(error) = simulator.turn(until) {
                        tracing::warn!(%error, "a simulated machine has ended");
                        return;
                    }
                }
            })
            .map_err(NoMachine::Thread)?;
        Ok(Self { port, stop, waker, thread: Some(thread), lathe })
    }

    /// Where it is to be reached.
    pub(crate) fn port(&self) -> &PortSpec {
        &self.port
    }

    /// The lathe, if it is one: what it has cut can be seen.
    pub(crate) fn lathe(&self) -> Option<SimulatedLathe> {
        self.lathe.clone()
    }
}

impl Drop for Simulated {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        self.waker.wake();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

const LATHE: &str = "pulse-lathe";

/// A lathe behind its port, which its own thread drives and others look at.
#[derive(Clone, Debug)]
pub(crate) struct SimulatedLathe(Arc<Mutex<Clocked<pulse_lathe::Lathe>>>);

impl SimulatedLathe {
    fn new() -> Result<Self, LatheOptionsError> {
        let lathe = pulse_lathe::Lathe::new(pulse_lathe::LatheOptions::default())?;
        Ok(Self(Arc::new(Mutex::new(Clocked::new(lathe, pulse_lathe::PERIOD)))))
    }

    fn port(&self) -> MutexGuard<'_, Clocked<pulse_lathe::Lathe>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// What it has cut so far, and where it stands.
    pub(crate) fn view(&self) -> LatheView {
        let port = self.port();
        let lathe = port.machine();
        let report = lathe.report();
        LatheView {
            picture: lathe.picture(),
            x_mm: report.x_millimetres(),
            z_mm: report.z_millimetres(),
            pulses: report.x_pulses + report.z_pulses,
            gaps: report.gaps,
            lost_pulses: report.lost_pulses,
            programs: report.programs,
        }
    }
}

impl Partner for SimulatedLathe {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.port().receive(now, byte);
    }

    fn next_event(&self) -> Option<Micros> {
        self.port().next_event()
    }

    fn advance(&mut self, now: Micros) {
        self.port().advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.port().poll_transmit(now)
    }
}

/// A machine of any protocol.
struct Machine(Box<dyn Partner + Send>);

fn machine(protocol: &str, line: LineParameters) -> Result<Machine, NoMachine> {
    let line = if line.baud == 0 { LineParameters { baud: 9_600, ..line } } else { line };
    // Whoever looks for the next program or sends the next one waits as long.
    let rest = Some(Micros::from_secs(3));
    let r3964 = |options: r3964::Options| -> Result<Machine, NoMachine> {
        let station = r3964::Station::new(r3964::Options { line, ..options });
        Ok(Machine(Box::new(station?)))
    };
    match protocol {
        "xon-xoff" => {
            let keep = Keep::Digest;
            let options = xon_xoff::ControlOptions { line, keep, ..Default::default() };
            let control = xon_xoff::Control::new(options)?;
            Ok(Machine(Box::new(control)))
        }
        "r3964" => r3964(r3964::Options::default()),
        "r3964-simplified" => r3964(r3964::Options::simplified()),
        "fanuc-rs232" => {
            let options = fanuc::Options { line, ..fanuc::Options::default() };
            let control = fanuc::Control::new(options)?;
            Ok(Machine(Box::new(control)))
        }
        "kermit" => {
            let options = kermit::Options { line, rest, ..kermit::Options::default() };
            Ok(Machine(Box::new(kermit::Machine::new(options))))
        }
        "xmodem" => {
            let options = xmodem::Options { line, rest, ..xmodem::Options::default() };
            Ok(Machine(Box::new(xmodem::Control::new(options))))
        }
        other => Err(NoMachine::Unknown(other.to_owned())),
    }
}

impl Partner for Machine {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.0.receive(now, byte);
    }

    fn receive_damaged(&mut self, now: Micros, kind: LineErrorKind, byte: Option<u8>) {
        self.0.receive_damaged(now, kind, byte);
    }

    fn next_event(&self) -> Option<Micros> {
        self.0.next_event()
    }

    fn advance(&mut self, now: Micros) {
        self.0.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.0.poll_transmit(now)
    }

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        self.0.poll_signal(now)
    }
}
