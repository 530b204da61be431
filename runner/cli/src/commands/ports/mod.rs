//! `softplug ports`: which serial ports there are.

mod run;

#[cfg(target_os = "linux")]
pub(super) use run::HolderEntry;
pub(crate) use run::run;

use clap::Args;

/// Lists the serial ports of this machine.
///
/// No port is opened. The lasting name is the one to write into a set-up: it stays with the
/// socket that an adapter is plugged into.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug ports
  softplug ports --json")]
pub(crate) struct Arguments {}
