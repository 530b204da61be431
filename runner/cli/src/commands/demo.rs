//! `softplug demo`: the whole way, without a machine.

use clap::Args;

use crate::plugin::Library;

/// Shows the whole way without a machine, in under a minute.
///
/// A simulated control sits on a pseudo-terminal and holds the line again and again. A program of
/// 1 MB goes to it through the sandboxed XON/XOFF plug-in, comes back, and is compared; then the
/// recorded traces are replayed.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug demo
  softplug demo --bytes 100000 --json")]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) library: Library,
    /// Size of the program that is sent
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u32).range(1_000..=16_000_000))]
    pub(crate) bytes: u32,
    /// Folder with traces to replay; left out where it is not there
    #[arg(long, value_name = "DIR", default_value = "fixtures/traces")]
    pub(crate) traces: std::path::PathBuf,
}
