//! `softplug simulate`: machines to try a set-up on.

mod fanuc;
mod faults;
mod kermit;
mod pulse_lathe;
mod r3964;
mod run;
mod script;
mod xmodem;
mod xon_xoff;

pub(crate) use fanuc::FanucSimulation;
pub(crate) use kermit::KermitSimulation;
pub(crate) use pulse_lathe::PulseLatheSimulation;
pub(crate) use r3964::R3964Simulation;
#[cfg(target_os = "linux")]
pub(super) use run::{Fanuc, R3964, XonXoff, difference};
pub(crate) use script::ScriptSimulation;
pub(crate) use xmodem::XmodemSimulation;
pub(crate) use xon_xoff::XonXoffSimulation;

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::{Args, Subcommand};
use softplug_abi::Micros;

use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::screen::Screen;

/// Simulates a machine on a pseudo-terminal or a TCP port, in real time.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    machine: Machine,
}

#[derive(Debug, Subcommand)]
enum Machine {
    XonXoff(Box<xon_xoff::XonXoff>),
    #[command(name = "r3964")]
    R3964(Box<r3964::R3964>),
    #[command(name = "r3964-simplified")]
    R3964Simplified(Box<r3964::R3964Simplified>),
    #[command(name = "fanuc-rs232")]
    Fanuc(Box<fanuc::Fanuc>),
    PulseLathe(Box<pulse_lathe::PulseLathe>),
    Kermit(Box<kermit::Kermit>),
    Xmodem(Box<xmodem::Xmodem>),
    Script(Box<script::Script>),
}

/// What every simulation takes.
#[derive(Debug, Args)]
struct Common {
    /// Wait for a connection at this TCP address instead of on a pseudo-terminal, one at a time;
    /// with port 0 the system chooses one
    #[arg(long, value_name = "ADDRESS:PORT")]
    listen: Option<SocketAddr>,
    /// Compare what was received with this file
    #[arg(long, value_name = "FILE")]
    expect: Option<PathBuf>,
    /// Write what was received into this file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// End when all is done and nothing has moved for --quiet-time
    #[arg(long)]
    once: bool,
    /// Seconds without a byte after which a transfer has ended [default: 2; 5 where the machine
    /// sends, because a receiver may wait for silence, and would lose its port]
    #[arg(long, value_name = "SECONDS", requires = "once", value_parser = seconds)]
    quiet_time: Option<f64>,
}

/// A simulation that was checked.
pub(crate) enum Simulation {
    XonXoff(Box<XonXoffSimulation>),
    R3964(Box<R3964Simulation>),
    Fanuc(Box<FanucSimulation>),
    PulseLathe(Box<PulseLatheSimulation>),
    Kermit(Box<KermitSimulation>),
    Xmodem(Box<XmodemSimulation>),
    Script(Box<ScriptSimulation>),
}

/// Where the machine is reached, what becomes of what it got, and when it ends.
#[derive(Default)]
pub(crate) struct RunOptions {
    /// A TCP port; `None`: a pty.
    pub(crate) listen: Option<SocketAddr>,
    pub(crate) expect: Option<Vec<u8>>,
    pub(crate) out: Option<PathBuf>,
    /// End when nothing has moved for so long.
    pub(crate) quiet_time: Option<Micros>,
}

impl Common {
    fn run_options(self, sends: bool) -> Result<RunOptions, Failure> {
        let quiet_time = self.quiet_time.unwrap_or(if sends { 5.0 } else { 2.0 });
        Ok(RunOptions {
            listen: self.listen,
            expect: self.expect.as_deref().map(files::read).transpose()?,
            out: self.out,
            quiet_time: self.once.then(|| micros(quiet_time)),
        })
    }
}

pub(crate) fn run(arguments: Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let simulation = match arguments.machine {
        Machine::XonXoff(machine) => Simulation::XonXoff(Box::new(machine.prepare()?)),
        Machine::R3964(machine) => Simulation::R3964(Box::new(machine.prepare()?)),
        Machine::R3964Simplified(machine) => Simulation::R3964(Box::new(machine.prepare()?)),
        Machine::Fanuc(machine) => Simulation::Fanuc(Box::new(machine.prepare()?)),
        Machine::PulseLathe(machine) => Simulation::PulseLathe(Box::new(machine.prepare()?)),
        Machine::Kermit(machine) => Simulation::Kermit(Box::new(machine.prepare()?)),
        Machine::Xmodem(machine) => Simulation::Xmodem(Box::new(machine.prepare()?)),
        Machine::Script(script) => Simulation::Script(Box::new(script.prepare()?)),
    };
    run::simulate(&simulation, screen)
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.0..=86_400.0).contains(seconds));
    seconds.ok_or_else(|| "give seconds, 0 to 86400".to_owned())
}

fn micros(seconds: f64) -> Micros {
    Micros((seconds * 1e6) as i64)
}
