//! `softplug gateway`: the service for a shop floor.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;

use std::path::PathBuf;

use clap::{Args, Subcommand, ValueEnum};

/// Drives many links from one configuration: jobs, receptions, plug-ins swapped live, HTTP.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug gateway check gateway.toml
  softplug gateway run gateway.toml
  softplug gateway token --name page --role operator >> tokens.toml

SIGTERM and SIGINT stop it: jobs are parked or finished, as the configuration says, and what
machines sent is put away. Said again, what is being finished is parked, then what cannot be put
away is given up; one more ends it at once. SIGHUP reads the configuration again. SIGUSR2 puts a
newer command in its place, unless a link is busy or what it received is not put away yet.")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    /// Runs the gateway until it is told to stop
    #[command(after_help = "Example:
  softplug gateway run gateway.toml")]
    Run(Configured),
    /// Checks a configuration, with its plug-ins and their settings
    #[command(after_help = "Examples:
  softplug gateway check gateway.toml
  softplug gateway check gateway.toml --json")]
    Check(Configured),
    #[command(after_help = "Examples:
  softplug gateway token --name anna >> tokens.toml
  softplug gateway token --name backup --role admin >> tokens.toml")]
    Token(Token),
}

// The configuration; the verb says what for.
#[derive(Debug, Args)]
pub(crate) struct Configured {
    /// The configuration
    #[arg(value_name = "FILE", default_value = "gateway.toml")]
    pub(crate) file: PathBuf,
}

/// Makes a token for the API: its text goes to standard error, the entry for the tokens file to
/// standard output
#[derive(Debug, Args)]
pub(crate) struct Token {
    /// Whose it is
    #[arg(long, value_name = "NAME")]
    pub(crate) name: String,
    /// What its holder may do
    #[arg(long, value_enum, default_value_t)]
    pub(crate) role: Role,
}

/// What the holder of a token may do.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default, ValueEnum)]
pub(crate) enum Role {
    /// See everything, change nothing: for a screen in the shop
    Viewer,
    /// See everything, send and receive programs
    #[default]
    Operator,
    /// Plug-ins, swaps and the configuration too
    Admin,
}

impl Arguments {
    /// Whether the gateway runs: then its configuration says how it logs.
    pub(crate) fn runs(&self) -> bool {
        matches!(self.verb, Verb::Run(_))
    }
}
