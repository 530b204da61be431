//! What can go wrong with the library, by blame.

use std::path::PathBuf;

use softplug_host::{Digest, LintError};
use thiserror::Error;

use super::Reference;
use crate::disk::DiskError;

/// Why the library cannot do it.
#[derive(Debug, Error)]
pub enum LibraryError {
    /// Our disk.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// The folder is no library.
    #[error("{} is no library of plug-ins: `softplug plugin add` makes one", .0.display())]
    NoLibrary(PathBuf),
    /// The module is no plug-in.
    #[error("it is not a plug-in: {0}")]
    NotAPlugin(#[from] LintError),
    /// The module cannot be loaded and started.
    #[error("it cannot be used: {0}")]
    Unfit(String),
    /// The module could not be looked at; it may be a plug-in.
    #[error("it cannot be checked now: {0}")]
    Unchecked(String),
    /// Its version cannot stand in a reference.
    #[error(
        "the plug-in calls its version \"{0}\", which nobody could ask for: a version is 1 to 64 of letters, digits, dots, hyphens, plus and underscore"
    )]
    Version(String),
    /// There is no such plug-in.
    #[error("the library has no plug-in \"{asked}\"{}", closing(hint))]
    NotFound {
        /// What was asked for.
        asked: Reference,
        /// What was probably meant, or what there is.
        hint: String,
    },
    /// More than one digest begins so.
    #[error("{count} plug-ins have a SHA-256 that begins as in \"{asked}\": give more digits")]
    Ambiguous {
        /// What was asked for.
        asked: Reference,
        /// How many there are.
        count: usize,
    },
    /// The file is not what its name says.
    #[error("{} is damaged, its content has another SHA-256: add the plug-in again", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What it should be.
        digest: Digest,
    },
    /// A signature for units has another length, in bytes.
    #[error("a signature for units has 96 bytes, and this {0}: make it with `softplug unit sign`")]
    Signature(usize),
    /// A link needs it.
    #[error("\"{asked}\" is used by {}: swap it there first, or force it", holders.join(", "))]
    InUse {
        /// What should go.
        asked: Reference,
        /// The links.
        holders: Vec<String>,
    },
}

fn closing(hint: &str) -> String {
    if hint.is_empty() { String::new() } else { format!("; {hint}") }
}
