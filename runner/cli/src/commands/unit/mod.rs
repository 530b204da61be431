//! `softplug unit`: front-end units, at either end of the bus.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;

use std::path::PathBuf;

use clap::{Args, Subcommand};

/// Front-end units: small computers at machines, each with the plug-in that its machine needs.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug unit check unit.toml
  softplug unit run unit.toml
  softplug unit list 10.0.0.17:7640 10.0.0.18:7640
  softplug unit list can0
  softplug unit key unit.key
  softplug unit list 10.0.0.17:7640 --key gateway.key --unit-key MCowBQYDK2VwAyEAGb9E…
  softplug unit sign xon-xoff.wasm --key works.pem --output xon-xoff.sig
  softplug unit flash unit://10.0.0.17:7640/mill-7 xon-xoff.wasm --signature xon-xoff.sig

A unit is driven by a gateway whose link has `port = \"unit://10.0.0.17:7640/mill-7\"`. list and
flash are for units that no gateway drives at the time. SIGTERM and SIGINT end `run`.")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    /// Runs this computer as a unit until it is told to stop
    #[command(after_help = "Example:
  softplug unit run unit.toml")]
    Run(Configured),
    /// Checks a configuration
    #[command(after_help = "Example:
  softplug unit check unit.toml --json")]
    Check(Configured),
    #[command(after_help = "Examples:
  softplug unit list 10.0.0.7:7640
  softplug unit list can0
  softplug unit list can0/17 --json")]
    List(List),
    #[command(after_help = "Examples:
  softplug unit flash unit://10.0.0.7:7640/lathe fanuc-rs232.wasm --set code=eia
  softplug unit flash unit://can0/17/lathe xon-xoff.wasm --signature xon-xoff.sig")]
    Flash(Flash),
    #[command(after_help = "Example:
  softplug unit sign xon-xoff.wasm --key key.pem --output xon-xoff.sig")]
    Sign(Sign),
    #[command(after_help = "Examples:
  softplug unit key unit.key
  softplug unit key --show unit.key")]
    Key(Key),
}

// The configuration; the verb says what for.
#[derive(Debug, Args)]
pub(crate) struct Configured {
    /// The configuration
    #[arg(value_name = "FILE", default_value = "unit.toml")]
    pub(crate) file: PathBuf,
}

/// Asks units what they are, run and hold
#[derive(Debug, Args)]
pub(crate) struct List {
    /// Where they listen, their numbers on a CAN bus (can0/17), or a bus for all on it (can0)
    #[arg(value_name = "UNIT", required = true)]
    pub(crate) units: Vec<String>,
    #[command(flatten)]
    pub(crate) keys: Keys,
}

/// Downloads a plug-in into a unit, and has it run there
#[derive(Debug, Args)]
pub(crate) struct Flash {
    /// The unit's link: unit://host:port/link or unit://can0/17/link
    #[arg(value_name = "UNIT")]
    pub(crate) unit: String,
    /// The plug-in's file
    #[arg(value_name = "PLUGIN")]
    pub(crate) plugin: PathBuf,
    /// Its signature, as `softplug unit sign` writes it
    #[arg(long, value_name = "FILE")]
    pub(crate) signature: Option<PathBuf>,
    /// A setting of the plug-in
    #[arg(long = "set", value_name = "NAME=VALUE")]
    pub(crate) settings: Vec<String>,
    #[command(flatten)]
    pub(crate) keys: Keys,
}

// Keys for units that want TLS.
#[derive(Debug, Args)]
pub(crate) struct Keys {
    /// The private key of this side, which the unit has among its `gateways`: then TLS it is
    #[arg(long, value_name = "FILE", requires = "unit_keys")]
    pub(crate) key: Option<PathBuf>,
    /// The unit's public key; of several units, each in an option of its own
    #[arg(long = "unit-key", value_name = "KEY", requires = "key")]
    pub(crate) unit_keys: Vec<String>,
}

/// Signs a plug-in for units that know the key
#[derive(Debug, Args)]
pub(crate) struct Sign {
    /// The plug-in's file
    #[arg(value_name = "PLUGIN")]
    pub(crate) plugin: PathBuf,
    /// The private Ed25519 key, as `openssl genpkey -algorithm ed25519` writes it
    #[arg(long, value_name = "FILE")]
    pub(crate) key: PathBuf,
    /// Where to write the signature
    #[arg(long, value_name = "FILE", required_unless_present = "library")]
    pub(crate) output: Option<PathBuf>,
    /// A gateway's library that holds the plug-in: the signature is kept there, too
    #[arg(long, value_name = "FOLDER")]
    pub(crate) library: Option<PathBuf>,
}

/// Makes a private key for TLS between gateway and unit, and prints its public key
#[derive(Debug, Args)]
pub(crate) struct Key {
    /// The file with the private key; it must not be there yet
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// Make none: print the public key of this one
    #[arg(long)]
    pub(crate) show: bool,
}

impl Arguments {
    /// Whether the unit runs: then it logs as a service does.
    pub(crate) fn runs(&self) -> bool {
        matches!(self.verb, Verb::Run(_))
    }
}
