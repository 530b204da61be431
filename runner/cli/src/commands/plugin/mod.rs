//! `softplug plugin`: a gateway's library of plug-ins.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;

use std::path::PathBuf;

use clap::{Args, Subcommand};

/// Keeps the library of plug-ins that gateways take theirs from.
///
/// It works on the library's folder, whether a gateway runs or not; a running one sees at once
/// what is new. A plug-in is named as in the configuration: `xon-xoff` is the newest
/// version, `xon-xoff@0.1` the newest that begins so, `xon-xoff@sha256:…` one module.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug plugin add target/plugins/xon-xoff.wasm --library /var/lib/softplug/plugins
  softplug plugin list
  softplug plugin show xon-xoff@0.1 --json
  softplug plugin remove xon-xoff@0.1.0
  softplug plugin gc --dry-run")]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) verb: Verb,
    /// The library's folder; `plugins` if nothing is said [env: SOFTPLUG_LIBRARY]
    #[arg(long, global = true, value_name = "DIR")]
    pub(crate) library: Option<PathBuf>,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    #[command(after_help = "Example:
  softplug plugin add target/plugins/xon-xoff.wasm")]
    Add(Add),
    #[command(after_help = "Examples:
  softplug plugin list
  softplug plugin list xon-xoff --all")]
    List(List),
    #[command(after_help = "Example:
  softplug plugin show xon-xoff@0.2")]
    Show(Show),
    #[command(after_help = "Example:
  softplug plugin remove xon-xoff@0.1")]
    Remove(Remove),
    #[command(after_help = "Example:
  softplug plugin gc --dry-run")]
    Gc(Gc),
}

/// Checks plug-ins and takes them in: each whole, or not at all
#[derive(Debug, Args)]
pub(crate) struct Add {
    /// The .wasm files
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
}

/// Lists the plug-ins, the newest version first
#[derive(Debug, Args)]
pub(crate) struct List {
    /// Only those with this name
    pub(crate) name: Option<String>,
    /// Those too that have no name any more, only a digest
    #[arg(long)]
    pub(crate) all: bool,
}

/// Shows one plug-in
#[derive(Debug, Args)]
pub(crate) struct Show {
    /// Which
    pub(crate) plugin: String,
}

/// Takes a plug-in's name and version away, or, named by its digest, the module itself
///
/// What a link uses, or would go back to, stays.
#[derive(Debug, Args)]
pub(crate) struct Remove {
    /// Which
    pub(crate) plugin: String,
    /// Also if a link uses it
    #[arg(long)]
    pub(crate) force: bool,
}

/// Removes the modules that have no name any more and that no link uses
#[derive(Debug, Args)]
pub(crate) struct Gc {
    /// Only tell which
    #[arg(long)]
    pub(crate) dry_run: bool,
}
