//! Simulated machines, so that a set-up can be tried without one.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use softplug_abi::{LineErrorKind, LineParameters, Micros};
use softplug_gateway::poll::Waker;
use softplug_gateway::simulator::Simulator;
use softplug_machines::kept::Keep;
use softplug_machines::{Partner, Signal, fanuc, pulse_lathe, r3964, xon_xoff};

/// A simulated machine on a pty; it ends when this is dropped.
#[derive(Debug)]
pub(crate) struct Simulated {
    path: PathBuf,
    stop: Arc<AtomicBool>,
    waker: Waker,
    thread: Option<JoinHandle<()>>,
}

impl Simulated {
    /// A machine that speaks `protocol` at this line's rate.
    pub(crate) fn start(protocol: &str, line: LineParameters) -> Result<Self, String> {
        let machine = machine(protocol, line)?;
        let mut simulator: Simulator<Machine> =
            Simulator::new(machine).map_err(|error| error.to_string())?;
        let (path, waker) = (simulator.path().to_owned(), simulator.waker());
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
            .map_err(|error| error.to_string())?;
        Ok(Self { path, stop, waker, thread: Some(thread) })
    }

    /// Where it is to be reached.
    pub(crate) fn path(&self) -> &Path {
        &self.path
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

/// A machine of any protocol.
struct Machine(Box<dyn Partner + Send>);

fn machine(protocol: &str, line: LineParameters) -> Result<Machine, String> {
    let line = if line.baud == 0 { LineParameters { baud: 9_600, ..line } } else { line };
    let r3964 = |options: r3964::Options| {
        let station = r3964::Station::new(r3964::Options { line, ..options });
        station.map(|station| Machine(Box::new(station))).map_err(|error| error.to_string())
    };
    match protocol {
        "xon-xoff" => {
            let keep = Keep::Digest;
            let options = xon_xoff::ControlOptions { line, keep, ..Default::default() };
            let control = xon_xoff::Control::new(options).map_err(|error| error.to_string())?;
            Ok(Machine(Box::new(control)))
        }
        "r3964" => r3964(r3964::Options::default()),
        "r3964-simplified" => r3964(r3964::Options::simplified()),
        "fanuc-rs232" => {
            let options = fanuc::Options { line, ..fanuc::Options::default() };
            let control = fanuc::Control::new(options).map_err(|error| error.to_string())?;
            Ok(Machine(Box::new(control)))
        }
        "pulse-lathe" => {
            // A pty keeps no rate to the microsecond.
            let jitter = Micros::from_millis(50);
            let options = pulse_lathe::LatheOptions { jitter, ..Default::default() };
            let lathe = pulse_lathe::Lathe::new(options).map_err(|error| error.to_string())?;
            Ok(Machine(Box::new(lathe)))
        }
        other => Err(format!("there is no simulated machine \"{other}\"")),
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
