//! `softplug program`: the programs of a running gateway.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(crate) use run::run;

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::remote::Remote;

/// Brings programs to a running gateway, and fetches them.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) verb: Verb,
    #[command(flatten)]
    pub(crate) remote: Remote,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    /// Lists the programs
    #[command(after_help = "Example:
  softplug program list")]
    List,
    #[command(after_help = "Examples:
  softplug program upload O1234.nc
  softplug program upload *.nc --folder lathe-1 --overwrite")]
    Upload(Upload),
    #[command(after_help = "Examples:
  softplug program download O1234.nc
  softplug program download O1234.nc --out was.nc --force")]
    Download(Download),
    #[command(after_help = "Example:
  softplug program delete O1234.nc")]
    Delete(Delete),
}

/// Stores files as programs: each whole, or not at all
#[derive(Debug, Args)]
pub(crate) struct Upload {
    /// The files
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<PathBuf>,
    /// Into this folder
    #[arg(long, value_name = "FOLDER")]
    pub(crate) folder: Option<String>,
    /// Replace programs that are there
    #[arg(long)]
    pub(crate) overwrite: bool,
}

/// Fetches a program
#[derive(Debug, Args)]
pub(crate) struct Download {
    /// Name of the program
    pub(crate) name: String,
    /// Where to put it; its own name here if nothing is said
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Replace a file that is there
    #[arg(long)]
    pub(crate) force: bool,
}

/// Deletes a program; jobs that send it have a copy
#[derive(Debug, Args)]
pub(crate) struct Delete {
    /// Name of the program
    pub(crate) name: String,
}
