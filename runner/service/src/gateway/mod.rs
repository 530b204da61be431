//! The gateway that runs: the one handle for whoever wants something of it.
//!
//! [`Gateway`] is a handle that can be cloned and shared. Its calls block, but
//! never for long: what takes time goes on by itself and is seen in views and in
//! the stream of changes. Behind it one thread, the control loop, owns all
//! that is decided; bytes pass on the reactor's threads and never wait for it.

mod block_finder;
mod buses;
mod calls;
mod cells;
mod checks;
mod control;
mod drivers;
mod drops;
pub(crate) mod evidence;
mod faults;
mod history;
mod jobs;
mod journal_writer;
mod lanes;
mod link;
mod loading;
mod rate;
mod reload;
mod reports;
mod requests;
mod results;
mod show;
mod simulated;
mod start;
mod stop;
mod store;
mod swaps;
mod watching;
mod worker;

pub use start::{Running, StartError, check, start};
pub use watching::{Next, Watching};

use std::fs::File;
use std::sync::Arc;

use control::Shared;

/// A running gateway.
#[derive(Clone, Debug)]
pub struct Gateway {
    shared: Arc<Shared>,
}

/// A file to be read to its end.
#[derive(Debug)]
pub struct Download {
    /// Its name, without folders.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// The file, at its beginning.
    pub file: File,
}
