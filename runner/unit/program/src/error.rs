//! Why a unit ends, or does not begin, by whom it is to blame.

use std::io;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

use softplug_host::LoadError;
use softplug_live::{PortError, plain_text};
use thiserror::Error;

/// Why a unit ends, or does not begin.
#[derive(Debug, Error)]
pub enum UnitError {
    /// Nobody could reach it.
    #[error("cannot listen on {address}: {source}; choose another `listen`")]
    Listen {
        /// Where.
        address: SocketAddr,
        /// What the system says.
        source: io::Error,
    },
    /// The memory of a link is no memory.
    #[error("the memory {} of link \"{link}\": {reason}", shown(path))]
    Memory {
        /// The link.
        link: String,
        /// Where.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// Settings cannot be kept in the folder of the unit's state.
    #[error("the state folder {}: {reason}", shown(path))]
    State {
        /// The folder.
        path: PathBuf,
        /// Why.
        reason: String,
    },
    /// The system below refuses.
    #[error("failed to {what}: {source}")]
    System {
        /// What was tried.
        what: &'static str,
        /// What it says.
        source: io::Error,
    },
    /// The threads for ports cannot be started.
    #[error(transparent)]
    Port(#[from] PortError),
    /// The sandbox cannot be set up.
    #[error(transparent)]
    Host(#[from] LoadError),
}

fn shown(path: &Path) -> String {
    plain_text(&path.display().to_string())
}
