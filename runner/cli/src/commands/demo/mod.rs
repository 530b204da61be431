//! `softplug demo`: the whole way, without a machine.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;

use clap::Args;

use crate::plugin::Library;

/// Shows every plug-in at work without a machine, in about a minute.
///
/// Simulated machines sit on pseudo-terminals. A program goes to a control that holds the line with
/// XOFF, and comes back; blocks go both ways over a faulty line by 3964R and by simplified 3964R; a
/// FANUC control is drip-fed, punches, and asks for a program from its panel. All is compared. Two
/// lathes and a loader wait for each other; then the recorded traces are replayed.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug demo
  softplug demo --bytes 100000 --json")]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) library: Library,
    /// Size of the program that is sent by XON/XOFF
    #[arg(long, default_value_t = 200_000, value_parser = clap::value_parser!(u32).range(1_000..=16_000_000))]
    pub(crate) bytes: u32,
    /// Folder with traces to replay; left out where it is not there
    #[arg(long, value_name = "DIR", default_value = "fixtures/traces")]
    pub(crate) traces: std::path::PathBuf,
}
