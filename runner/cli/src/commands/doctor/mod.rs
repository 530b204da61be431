//! `softplug doctor`: what ails a port.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;

use std::path::PathBuf;

use clap::Args;

use crate::line::FlowBy;

/// Examines a serial port: rights, who has it, driver, latency, modem lines, and what is heard.
///
/// A device server is connected to; of one that speaks RFC 2217 its settings and modem lines are told.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug doctor /dev/ttyUSB0
  softplug doctor /dev/ttyUSB0 --listen 3     let the machine send meanwhile
  softplug doctor /dev/ttyUSB0 --flow rts-cts
  softplug doctor /dev/ttyUSB0 --listen 5 --baud 4800 --baud 9600
  softplug doctor rfc2217://10.0.0.7:4001

Ends with 6 if the port cannot be used.")]
pub(crate) struct Arguments {
    /// The port: /dev/ttyUSB0, tcp://HOST:PORT or rfc2217://HOST:PORT
    #[arg(value_name = "PORT")]
    pub(crate) port: PathBuf,
    /// Listen for so many seconds at each baud rate, and say which rate and parity it sounds like
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..=3600))]
    pub(crate) listen: Option<u32>,
    /// A baud rate to listen at; may be repeated [default: the common ones]
    #[arg(long, value_parser = clap::value_parser!(u32).range(50..=16_000_000))]
    pub(crate) baud: Vec<u32>,
    /// What the port is to do by itself: rts-cts tells whether CTS stops everything
    #[arg(long, value_enum, default_value_t, value_name = "WHO")]
    pub(crate) flow: FlowBy,
}
