//! `softplug link`: the links of a running gateway.

#[cfg(target_os = "linux")]
mod check;
#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;
#[cfg(target_os = "linux")]
pub(super) use run::swap_in;

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

use super::remote::Remote;
use crate::assignment::{Assignment, field};

/// Shows the links of a running gateway, swaps their plug-ins, and brings them back to work.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) verb: Verb,
    #[command(flatten)]
    pub(crate) remote: Remote,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    /// Lists the links: state, job, buffer, what is wrong
    #[command(after_help = "Examples:
  softplug link list
  softplug link list --json")]
    List,
    /// Shows all that is known of a link
    #[command(after_help = "Example:
  softplug link show lathe-1")]
    Show(Named),
    /// Closes a link's port and opens it again
    #[command(after_help = "Example:
  softplug link reopen lathe-1")]
    Reopen(Named),
    /// Goes on although the machine holds the line
    #[command(after_help = "Example:
  softplug link force-resume lathe-1")]
    ForceResume(Named),
    /// Stops a link's plug-in at once, whatever it is doing; an admin's
    #[command(after_help = "Example:
  softplug link quarantine lathe-1")]
    Quarantine(Named),
    /// Lets a link out of quarantine: its plug-in is started again
    #[command(after_help = "Example:
  softplug link release lathe-1")]
    Release(Named),
    #[command(after_help = "Examples:
  softplug link check lathe-1 O1234.nc
  softplug link check lathe-1 lathes/O1234.nc --strict --json")]
    Check(Check),
    Swap(Swap),
    #[command(after_help = "Examples:
  softplug link watch lathe-1
  softplug link watch lathe-1 --count 100")]
    Watch(Watch),
    #[command(after_help = "Examples:
  softplug link received lathe-1
  softplug link received lathe-1 O1234.nc --out back.nc")]
    Received(Received),
}

// A link by its name; the verb says what for.
#[derive(Debug, Args)]
pub(crate) struct Named {
    /// Name of the link
    pub(crate) link: String,
}

/// Tells what would not arrive of a program at a link's machine; nothing is sent
#[derive(Debug, Args)]
pub(crate) struct Check {
    /// Name of the link
    pub(crate) link: String,
    /// Name of the program, which the gateway has
    pub(crate) program: String,
    /// A field of the job; may be repeated
    #[arg(long = "field", value_name = "NAME=VALUE", value_parser = field)]
    pub(crate) fields: Vec<Assignment>,
    /// End with 1 also if something is left out or replaced
    #[arg(long)]
    pub(crate) strict: bool,
}

/// Swaps a link's plug-in while the machine goes on
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug link swap lathe-1 xon-xoff@0.2
  softplug link swap lathe-1 fanuc-rs232 --when idle --set code=eia")]
pub(crate) struct Swap {
    /// Name of the link
    pub(crate) link: String,
    /// The plug-in: NAME, NAME@VERSION or NAME@sha256:DIGEST
    pub(crate) plugin: String,
    /// When
    #[arg(long, value_enum, value_name = "WHEN", default_value_t)]
    pub(crate) when: When,
    /// A setting of the new one, instead of those that the link has; may be repeated
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub(crate) settings: Vec<Assignment>,
}

/// When to swap.
#[derive(Copy, Clone, Debug, Default, ValueEnum)]
pub(crate) enum When {
    /// At once with the state carried over, or not at all
    Now,
    /// When nothing is under way
    Idle,
    /// At once if the states fit, else when nothing is under way
    #[default]
    NowOrIdle,
}

/// Shows what passes on a link's line, until Ctrl-C
#[derive(Debug, Args)]
pub(crate) struct Watch {
    /// Name of the link
    pub(crate) link: String,
    /// End after so many things seen
    #[arg(long, value_name = "N")]
    pub(crate) count: Option<u64>,
}

/// Lists what a link has received, or fetches one of it
#[derive(Debug, Args)]
pub(crate) struct Received {
    /// Name of the link
    pub(crate) link: String,
    /// The file to fetch
    pub(crate) file: Option<String>,
    /// Where to put it; its own name here if nothing is said
    #[arg(long, short, value_name = "FILE", requires = "file")]
    pub(crate) out: Option<PathBuf>,
    /// Replace a file that is there
    #[arg(long, requires = "file")]
    pub(crate) force: bool,
}
