//! `softplug simulate`: machines to try a set-up on.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use softplug_abi::{LineParameters, Micros};
use softplug_conformance::partners::xon_xoff::ControlOptions;

use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::live;
use crate::screen::Screen;

/// Simulates a machine on a pseudo-terminal, in real time.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    machine: Machine,
}

#[derive(Debug, Subcommand)]
enum Machine {
    XonXoff(Box<XonXoff>),
}

/// A control with a receive buffer that holds the line with XOFF.
///
/// Prints the path to connect to, runs until Ctrl-C, then reports: bytes, alarms, holds, and how
/// many characters came after each XOFF. Ends with 1 if the control raised an alarm or did not get
/// what was expected.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug simulate xon-xoff --rate 500
  softplug simulate xon-xoff --baud 115200 --rate 8000 --once --expect O0001.nc
  softplug simulate xon-xoff --punch O0001.nc --once")]
pub(crate) struct XonXoff {
    /// Baud rate; it paces what the control itself sends
    #[arg(long, default_value_t = 9_600, value_parser = clap::value_parser!(u32).range(50..=16_000_000))]
    baud: u32,
    /// Bytes in the receive buffer
    #[arg(long, default_value_t = 512, value_name = "BYTES")]
    buffer: usize,
    /// XOFF is sent when fewer bytes than this are free
    #[arg(long, default_value_t = 128, value_name = "BYTES")]
    low: usize,
    /// XON is sent when more bytes than this are free
    #[arg(long, default_value_t = 256, value_name = "BYTES")]
    high: usize,
    /// Depth of the transmit FIFO: what is in it leaves in spite of an XOFF
    #[arg(long, default_value_t = 1, value_name = "CHARACTERS")]
    fifo: usize,
    /// How long the control takes to react
    #[arg(long, default_value_t = 0, value_name = "MICROSECONDS", value_parser = clap::value_parser!(i64).range(0..=10_000_000))]
    latency: i64,
    /// Bytes per second that the program's execution takes; 0: as fast as they come
    #[arg(long, default_value_t = 0, value_name = "BYTES")]
    rate: u32,
    /// Repeat XON after so many milliseconds of silence
    #[arg(long, value_name = "MILLISECONDS", value_parser = clap::value_parser!(i64).range(1..=600_000))]
    repeat_xon: Option<i64>,
    /// Send an XON after so many milliseconds
    #[arg(long, value_name = "MILLISECONDS", value_parser = clap::value_parser!(i64).range(0..=600_000))]
    xon_at_start: Option<i64>,
    /// Send every byte of data back
    #[arg(long)]
    echo: bool,
    /// Send this file, from the other side's first XON on, at the latest after --punch-after
    #[arg(long, value_name = "FILE")]
    punch: Option<PathBuf>,
    /// Seconds after which sending the file begins without an XON
    #[arg(long, value_name = "SECONDS", default_value_t = 2.0, requires = "punch", value_parser = seconds)]
    punch_after: f64,
    /// Compare what was received with this file
    #[arg(long, value_name = "FILE")]
    expect: Option<PathBuf>,
    /// Write what was received into this file
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// End after one transfer, when nothing has moved for --quiet-time
    #[arg(long)]
    once: bool,
    /// Seconds without a byte after which a transfer has ended [default: 2; with --punch 5, because
    /// a receiver may wait for silence, and would lose its port]
    #[arg(long, value_name = "SECONDS", requires = "once", value_parser = seconds)]
    quiet_time: Option<f64>,
}

/// A simulation that was checked.
pub(crate) struct Simulation {
    pub(crate) control: ControlOptions,
    pub(crate) punch: Option<Vec<u8>>,
    pub(crate) punch_after: Micros,
    pub(crate) expect: Option<Vec<u8>>,
    pub(crate) out: Option<PathBuf>,
    /// End when nothing has moved for so long.
    pub(crate) quiet_time: Option<Micros>,
}

pub(crate) fn run(arguments: Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let Machine::XonXoff(machine) = arguments.machine;
    live::simulate(&prepare(*machine)?, screen)
}

fn prepare(machine: XonXoff) -> Result<Simulation, Failure> {
    let control = ControlOptions {
        line: LineParameters::new(machine.baud),
        buffer: machine.buffer,
        low: machine.low,
        high: machine.high,
        rate: machine.rate,
        latency: Micros(machine.latency),
        transmit_fifo: machine.fifo,
        repeat_xon: machine.repeat_xon.map(Micros::from_millis),
        xon_at_start: machine.xon_at_start.map(Micros::from_millis),
        echo: machine.echo,
        ..ControlOptions::default()
    };
    control.check().map_err(Failure::usage)?;
    let quiet_time = machine.quiet_time.unwrap_or(if machine.punch.is_some() { 5.0 } else { 2.0 });
    Ok(Simulation {
        control,
        punch: machine.punch.as_deref().map(files::read).transpose()?,
        punch_after: micros(machine.punch_after),
        expect: machine.expect.as_deref().map(files::read).transpose()?,
        out: machine.out,
        quiet_time: machine.once.then(|| micros(quiet_time)),
    })
}

fn seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| (0.0..=86_400.0).contains(seconds));
    seconds.ok_or_else(|| "give seconds, 0 to 86400".to_owned())
}

fn micros(seconds: f64) -> Micros {
    Micros((seconds * 1e6) as i64)
}
