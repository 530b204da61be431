//! `softplug dev`: on each save builds, replays, and swaps.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;

use std::path::PathBuf;

use clap::Args;
use softplug_live::PortSpec;

use super::remote::Remote;
use crate::assignment::Assignment;
use crate::line::{AskedLine, port};

/// On each save builds the plug-in, replays its traces, and swaps it into a live link.
///
/// The first trace that it does not fulfil is shown. A plug-in that does not build, or does
/// something else than its traces demand, stays out, and the one before goes on. The new one takes
/// over in the middle of a job, with the state, if the formats match, else as new. Then it is held
/// against the ABI's own cases and its profiles, what no case executes is told, and a profile that
/// can be explored is, for five seconds; the next save breaks that off. Ctrl-C ends it.
///
/// With --port the link runs in this process, on a port or on the pty of `softplug simulate`; with
/// --link it is one of a running gateway, whose library gets the plug-in.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug dev
  softplug dev --port /dev/pts/5 --send program.nc
  softplug dev --link lathe-1 --gateway http://127.0.0.1:8117 --token-file token")]
pub(crate) struct Arguments {
    /// Folder of the project: with a Cargo.toml, or with manifest.json and src/*.c
    #[arg(value_name = "DIR", default_value = ".")]
    pub(crate) project: PathBuf,
    /// Link of a running gateway to swap the plug-in into
    #[arg(long, value_name = "LINK", conflicts_with = "port")]
    pub(crate) link: Option<String>,
    /// Port to run the plug-in on: /dev/ttyUSB0, a pty, tcp://HOST:PORT or rfc2217://HOST:PORT
    #[arg(long, short, value_parser = port)]
    pub(crate) port: Option<PortSpec>,
    /// The line: baud rate and form of a character, such as "4800 7E2" [default: the plug-in's, or
    /// 9600 8N1]
    #[arg(long, value_name = "LINE")]
    pub(crate) line: Option<AskedLine>,
    /// A setting of the plug-in on the port or link; may be repeated
    #[arg(long = "set", short = 's', value_name = "NAME=VALUE")]
    pub(crate) settings: Vec<Assignment>,
    /// File to send on the port, anew after each swap
    #[arg(long, value_name = "FILE", requires = "port")]
    pub(crate) send: Option<PathBuf>,
    /// Keep what comes on the port in this folder; without it only its beginning is shown
    #[arg(long, value_name = "DIR", requires = "port")]
    pub(crate) keep: Option<PathBuf>,
    /// Swap also what does something else than its traces demand
    #[arg(long)]
    pub(crate) anyway: bool,
    #[command(flatten)]
    pub(crate) remote: Remote,
}
