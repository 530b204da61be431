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
mod sampling;
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

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs::File;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::mpsc::Sender;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use softplug_live::reactor::{LaneId, Report};
use tokio::sync::broadcast;

use crate::config::Config;
use crate::feeder::Feeder;
use crate::jobs::Jobs;
use crate::library::LibraryNews;
use crate::programs::{Programs, Quotas, Receptions, Snapshots};
use crate::reception_writer::ReceptionWriter;
use crate::view::{Change, JobView, LinkView, StopHow, TimeMs};
use block_finder::BlockFinder;
use cells::Cells;
use drivers::Drivers;
use drops::Drops;
use journal_writer::JournalWriter;
use link::Link;
use loading::Loader;
use results::Results;
use watching::Audiences;
use worker::Worker;

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

/// What the loop is told.
pub(crate) enum Message {
    /// By the reactor.
    Report(LaneId, Report),
    /// By a handle, or by work that was done elsewhere.
    Do(Box<dyn FnOnce(&mut Control) + Send>),
    /// By the library.
    Library(LibraryNews),
}

/// What can be used from every thread.
pub(crate) struct Shared {
    pub(crate) inbox: Sender<Message>,
    pub(crate) changes: broadcast::Sender<Arc<Change>>,
    pub(crate) started_ms: TimeMs,
    pub(crate) traces: PathBuf,
    pub(crate) upload_bytes: u64,
    pub(crate) parts: Parts,
    pub(crate) is_stopping: AtomicBool,
    /// Bytes of receptions that were given up at the end.
    pub(crate) lost: AtomicU64,
    /// Devices that stay open for the gateway that takes the place of this one.
    pub(crate) kept: Mutex<Vec<OwnedFd>>,
}

/// The parts that guard themselves.
pub(crate) struct Parts {
    pub(crate) loader: Loader,
    pub(crate) jobs: Jobs,
    pub(crate) programs: Programs,
    pub(crate) snapshots: Snapshots,
    pub(crate) receptions: Receptions,
    pub(crate) quotas: Quotas,
    pub(crate) journal_writer: JournalWriter,
    /// For what is written down and cleared away, and takes time.
    pub(crate) worker: Worker,
    /// For what machines ask for: a panel waits only for other panels.
    pub(crate) requests: Worker,
    /// For plug-ins that are compiled, of which one may take seconds.
    pub(crate) loading: Worker,
}

/// What the loop owns.
pub(crate) struct Control {
    shared: Arc<Shared>,
    config: Config,
    drivers: Drivers,
    feeder: Feeder,
    reception_writer: ReceptionWriter,
    /// Deliveries that the writer of receptions has to do with, by link.
    to_put_away: BTreeMap<String, u32>,
    links: BTreeMap<String, Link>,
    lanes: HashMap<LaneId, String>,
    cells: Cells,
    drops: Drops,
    audiences: Audiences,
    /// Links as they were last shown.
    shown: HashMap<String, LinkView>,
    /// Jobs under way as they were last shown, by link.
    shown_jobs: HashMap<String, JobView>,
    results: Results,
    next_lane: u32,
    began: Instant,
    next_sweep: Instant,
    next_sample: Instant,
    block_finder: BlockFinder,
    stopping: Option<Stopping>,
    /// What a disk or a database last refused.
    trouble: Option<String>,
    /// Why a changed configuration was not taken.
    config_trouble: Option<String>,
}

/// A stop under way.
#[derive(Debug)]
struct Stopping {
    how: StopHow,
    /// When jobs are no longer waited for.
    until: Option<Instant>,
    /// Lanes are told to close; until then they may.
    closing: Option<Instant>,
    /// No lane is left; what was received is put away.
    is_clearing: bool,
    /// What cannot be put away is given up.
    gives_up: bool,
    /// Links of which it was said that the stop waits for them.
    told: BTreeSet<String>,
    /// Another gateway takes the place of this one: devices stay open.
    hands_over: bool,
}
