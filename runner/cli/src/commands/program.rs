//! `softplug program`: the programs of a running gateway.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::remote::Remote;

/// Brings programs to a running gateway, and fetches them.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

#[derive(Debug, Subcommand)]
pub(crate) enum Verb {
    List(List),
    Upload(Upload),
    Download(Download),
    Delete(Delete),
}

impl Verb {
    pub(crate) fn remote(&self) -> &Remote {
        match self {
            Self::List(of) => &of.remote,
            Self::Upload(of) => &of.remote,
            Self::Download(of) => &of.remote,
            Self::Delete(of) => &of.remote,
        }
    }
}

/// Lists the programs
#[derive(Debug, Args)]
pub(crate) struct List {
    #[command(flatten)]
    pub(crate) remote: Remote,
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
    #[command(flatten)]
    pub(crate) remote: Remote,
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
    #[command(flatten)]
    pub(crate) remote: Remote,
}

/// Deletes a program; jobs that send it have a copy
#[derive(Debug, Args)]
pub(crate) struct Delete {
    /// Name of the program
    pub(crate) name: String,
    #[command(flatten)]
    pub(crate) remote: Remote,
}
