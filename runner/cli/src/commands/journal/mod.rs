//! `softplug journal`: what happened, in a running gateway.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;

use clap::Args;

use super::remote::{Remote, Within};

/// What the journal tells of.
const KINDS: [&str; 11] = [
    "gateway",
    "port",
    "job",
    "cell",
    "reception",
    "request",
    "swap",
    "fault",
    "alarm",
    "library",
    "note",
];

/// How much an entry matters.
const WEIGHTS: [&str; 3] = ["normal", "warning", "alarm"];

/// Lists what happened in a running gateway, the newest last
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug journal
  softplug journal --link lathe-1 --at-least alarm --since 8h
  softplug journal --job 42")]
pub(crate) struct Arguments {
    /// Of this link only
    #[arg(long, value_name = "LINK")]
    pub(crate) link: Option<String>,
    /// Of this kind only
    #[arg(long, value_name = "KIND", value_parser = KINDS)]
    pub(crate) kind: Option<String>,
    /// That matter at least so much, of any kind
    #[arg(long, value_name = "WEIGHT", value_parser = WEIGHTS)]
    pub(crate) at_least: Option<String>,
    /// Of this job only
    #[arg(long, value_name = "NUMBER")]
    pub(crate) job: Option<u32>,
    /// Only what has this in its text or its link's name
    #[arg(long, value_name = "TEXT")]
    pub(crate) find: Option<String>,
    #[command(flatten)]
    pub(crate) within: Within,
    /// At most so many
    #[arg(long, value_name = "N", default_value_t = 50)]
    pub(crate) limit: u32,
    #[command(flatten)]
    pub(crate) remote: Remote,
}
