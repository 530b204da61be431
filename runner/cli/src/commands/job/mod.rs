//! `softplug job`: the jobs of a running gateway.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::remote::{Remote, Within};
use crate::assignment::{Assignment, field};

/// Orders jobs of a running gateway, and steers them.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) verb: Verb,
    #[command(flatten)]
    pub(crate) remote: Remote,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    #[command(after_help = "Examples:
  softplug job list
  softplug job list --link lathe-1 --state failed --limit 10
  softplug job list --find O1234 --since 8h")]
    List(List),
    /// Shows all that is known of a job
    #[command(after_help = "Example:
  softplug job show 42")]
    Show(Numbered),
    Submit(Submit),
    #[command(after_help = "Examples:
  softplug job feed lathe-1 O1234.nc
  postprocessor part.cl | softplug job feed lathe-1 -")]
    Feed(Feed),
    /// Waits until a job has ended; the exit code tells how
    #[command(after_help = "Example:
  softplug job wait 42")]
    Wait(Numbered),
    /// Pauses a job
    #[command(after_help = "Example:
  softplug job pause 42")]
    Pause(Numbered),
    /// Ends a job's pause
    #[command(after_help = "Example:
  softplug job resume 42")]
    Resume(Numbered),
    /// Aborts a job, or takes it out of the queue
    #[command(after_help = "Example:
  softplug job abort 42")]
    Abort(Numbered),
    /// Says that somebody has seen how a job ended, and those of its link before it
    #[command(after_help = "Example:
  softplug job acknowledge 42")]
    Acknowledge(Numbered),
    #[command(after_help = "Example:
  softplug job restart 42 --from-block 120")]
    Restart(Restart),
    #[command(after_help = "Example:
  softplug job priority 42 5")]
    Priority(Rank),
}

/// What a job can be.
const STATES: [&str; 7] =
    ["queued", "running", "paused", "done", "failed", "aborted", "interrupted"];

/// Lists jobs, the newest first
#[derive(Debug, Args)]
pub(crate) struct List {
    /// Of this link only
    #[arg(long, value_name = "LINK")]
    pub(crate) link: Option<String>,
    /// In this state only
    #[arg(long, value_name = "STATE", value_parser = STATES)]
    pub(crate) state: Option<String>,
    /// Of this kind only, such as send or receive
    #[arg(long, value_name = "KIND")]
    pub(crate) kind: Option<String>,
    /// Only jobs whose program has this in its name
    #[arg(long, value_name = "TEXT")]
    pub(crate) find: Option<String>,
    #[command(flatten)]
    pub(crate) within: Within,
    /// At most so many
    #[arg(long, value_name = "N", default_value_t = 50)]
    pub(crate) limit: u32,
}

// A job by its number; the verb says what for.
#[derive(Debug, Args)]
pub(crate) struct Numbered {
    /// Number of the job
    pub(crate) id: u32,
}

/// Puts a job into a link's queue
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug job submit lathe-1 O1234.nc --wait
  softplug job submit press-2 --kind read --field area=DB --field block=5 --field count=7")]
pub(crate) struct Submit {
    /// Name of the link
    pub(crate) link: String,
    /// The program, for kinds that send one
    pub(crate) program: Option<String>,
    /// The kind, as the plug-in's manifest names it
    #[arg(long, value_name = "KIND")]
    pub(crate) kind: Option<String>,
    /// A field of the job; may be repeated
    #[arg(long = "field", value_name = "NAME=VALUE", value_parser = field)]
    pub(crate) fields: Vec<Assignment>,
    /// Jobs of a higher priority come first
    #[arg(long, value_name = "N", default_value_t = 0, allow_negative_numbers = true)]
    pub(crate) priority: i32,
    /// Begin at this block of the program, counted from 1
    #[arg(long, value_name = "N")]
    pub(crate) from_block: Option<u64>,
    /// Wait until it has ended; then the exit code tells how
    #[arg(long)]
    pub(crate) wait: bool,
}

/// Sends a file or standard input to a machine as it comes; where the plug-in looks at a program
/// first, once all of it has come
#[derive(Debug, Args)]
pub(crate) struct Feed {
    /// Name of the link, which must be free
    pub(crate) link: String,
    /// The file; - is standard input
    pub(crate) file: PathBuf,
    /// What the program is called; the file's name if nothing is said
    #[arg(long, value_name = "NAME")]
    pub(crate) program: Option<String>,
    /// The kind, as the plug-in's manifest names it
    #[arg(long, value_name = "KIND")]
    pub(crate) kind: Option<String>,
    /// A field of the job; may be repeated
    #[arg(long = "field", value_name = "NAME=VALUE", value_parser = field)]
    pub(crate) fields: Vec<Assignment>,
    /// Wait until the last bit has left; then the exit code tells how it ended
    #[arg(long)]
    pub(crate) wait: bool,
}

/// Puts a job that has ended into the queue again, as a new one
#[derive(Debug, Args)]
pub(crate) struct Restart {
    /// Number of the job
    pub(crate) id: u32,
    /// Begin at this block of the program, counted from 1
    #[arg(long, value_name = "N")]
    pub(crate) from_block: Option<u64>,
    /// Leave out so many bytes of the program
    #[arg(long, value_name = "BYTES", conflicts_with = "from_block")]
    pub(crate) from_byte: Option<u64>,
}

/// Gives a job that waits another priority
#[derive(Debug, Args)]
pub(crate) struct Rank {
    /// Number of the job
    pub(crate) id: u32,
    /// Jobs of a higher priority come first
    #[arg(allow_negative_numbers = true)]
    pub(crate) priority: i32,
}
