//! `softplug simulate xon-xoff`.

use std::path::PathBuf;

use clap::Args;
use softplug_abi::{LineParameters, Micros};
use softplug_machines::xon_xoff::ControlOptions;

use super::{Common, RunOptions, micros, seconds};
use crate::failure::Failure;
use crate::files;

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
pub(super) struct XonXoff {
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
    #[command(flatten)]
    common: Common,
}

/// A simulation that was checked.
pub(crate) struct XonXoffSimulation {
    pub(crate) control: ControlOptions,
    pub(crate) punch: Option<Vec<u8>>,
    pub(crate) punch_after: Micros,
    pub(crate) run: RunOptions,
}

impl XonXoff {
    pub(super) fn prepare(self) -> Result<XonXoffSimulation, Failure> {
        let control = ControlOptions {
            line: LineParameters::new(self.baud),
            buffer: self.buffer,
            low: self.low,
            high: self.high,
            rate: self.rate,
            latency: Micros(self.latency),
            transmit_fifo: self.fifo,
            repeat_xon: self.repeat_xon.map(Micros::from_millis),
            xon_at_start: self.xon_at_start.map(Micros::from_millis),
            echo: self.echo,
            ..ControlOptions::default()
        };
        control.check().map_err(Failure::usage)?;
        Ok(XonXoffSimulation {
            control,
            punch: self.punch.as_deref().map(files::read).transpose()?,
            punch_after: micros(self.punch_after),
            run: self.common.run_options(self.punch.is_some())?,
        })
    }
}
