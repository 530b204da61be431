//! The control loop: one thread that owns what is decided about links.
//!
//! It hears of what happened from the reactor, is asked by handles, and tells the
//! reactor what to do. It writes down what must be known after a crash; it never
//! compiles, never reads programs and never waits for a machine.

use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use softplug_gateway::reactor::{LaneId, Report};
use tokio::sync::broadcast;

use super::block_finder::BlockFinder;
use super::cells::Cells;
use super::drivers::Drivers;
use super::drops::Drops;
use super::journal_writer::JournalWriter;
use super::link::Link;
use super::loading::Loader;
use super::results::Results;
use super::watching::Audiences;
use super::worker::Worker;
use crate::config::Config;
use crate::feeder::Feeder;
use crate::jobs::{Job, Jobs, JobsError};
use crate::programs::{Programs, Quotas, Receptions, Snapshots};
use crate::reception_writer::ReceptionWriter;
use crate::view::{Change, JobView, LinkView, StopHow, TimeMs};
use crate::{Refusal, library};

/// How long a handle waits for the loop: it answers in microseconds, a disk that
/// stands still may hold it up.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often what nobody tells is looked at, and shown.
const TICK: Duration = Duration::from_millis(250);
/// How often snapshots are removed that no job needs any more.
pub(super) const SWEEP: Duration = Duration::from_hours(1);

/// What the loop is told.
pub(crate) enum Message {
    /// By the reactor.
    Report(LaneId, Report),
    /// By a handle, or by work that was done elsewhere.
    Do(Box<dyn FnOnce(&mut Control) + Send>),
    /// By the library.
    Library(library::LibraryNews),
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
    pub(super) shared: Arc<Shared>,
    pub(super) config: Config,
    pub(super) drivers: Drivers,
    pub(super) feeder: Feeder,
    pub(super) reception_writer: ReceptionWriter,
    pub(super) links: BTreeMap<String, Link>,
    pub(super) lanes: HashMap<LaneId, String>,
    pub(super) cells: Cells,
    pub(super) drops: Drops,
    pub(super) audiences: Audiences,
    /// Links as they were last shown.
    pub(super) shown: HashMap<String, LinkView>,
    /// Jobs under way as they were last shown, by link.
    pub(super) shown_jobs: HashMap<String, JobView>,
    pub(super) results: Results,
    pub(super) next_lane: u32,
    pub(super) began: Instant,
    pub(super) next_sweep: Instant,
    pub(super) next_sample: Instant,
    pub(super) block_finder: BlockFinder,
    pub(super) stopping: Option<Stopping>,
    /// What a disk or a database last refused.
    pub(super) trouble: Option<String>,
    /// Why a changed configuration was not taken.
    pub(super) config_trouble: Option<String>,
}

/// A stop under way.
#[derive(Debug)]
pub(super) struct Stopping {
    pub(super) how: StopHow,
    /// When jobs are no longer waited for.
    pub(super) until: Option<Instant>,
    /// Lanes are told to close; until then they may.
    pub(super) closing: Option<Instant>,
    /// Another gateway takes the place of this one: devices stay open.
    pub(super) hands_over: bool,
}

impl Shared {
    /// Has the loop do something, and waits for what comes of it.
    pub(crate) fn ask<T: Send + 'static>(
        &self,
        what: impl FnOnce(&mut Control) -> Result<T, Refusal> + Send + 'static,
    ) -> Result<T, Refusal> {
        let (to, answer) = sync_channel(1);
        let asked = self.inbox.send(Message::Do(Box::new(move |control| {
            // Who asked may have gone away meanwhile.
            let _ = to.send(what(control));
        })));
        if asked.is_err() {
            return Err(Refusal::Unavailable("the gateway has stopped".to_owned()));
        }
        answer.recv_timeout(PATIENCE).map_err(|error| {
            Refusal::Unavailable(match error {
                RecvTimeoutError::Timeout => "the gateway is too busy to answer".to_owned(),
                RecvTimeoutError::Disconnected => "the gateway stops".to_owned(),
            })
        })?
    }

    /// Has the loop do something later.
    pub(crate) fn tell(&self, what: impl FnOnce(&mut Control) + Send + 'static) {
        // After its end there is nothing to be done.
        let _ = self.inbox.send(Message::Do(Box::new(what)));
    }

    /// Tells whoever listens.
    pub(crate) fn changed(&self, change: Change) {
        // Nobody need listen.
        let _ = self.changes.send(Arc::new(change));
    }

    pub(crate) fn kept(&self) -> MutexGuard<'_, Vec<OwnedFd>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Removes snapshots that no job needs any more.
    fn sweep(&self) {
        let Parts { jobs, snapshots, .. } = &self.parts;
        match snapshots.collect_garbage(|| jobs.reader().needed_data()) {
            Ok(freed) => tracing::debug!(freed, "snapshots that nobody needs were removed"),
            Err(error) => tracing::warn!(%error, "snapshots that nobody needs are not removed"),
        }
    }

    pub(crate) fn is_stopping(&self) -> bool {
        self.is_stopping.load(Ordering::Relaxed)
    }
}

impl Control {
    /// Runs until the gateway has stopped.
    pub(super) fn run(mut self, inbox: &Receiver<Message>) {
        let mut next_tick = Instant::now();
        loop {
            let now = Instant::now();
            if now >= next_tick {
                next_tick = now + TICK;
                self.tick();
            }
            if self.has_stopped() {
                break;
            }
            let until = self.next_start().map_or(next_tick, |start| start.min(next_tick));
            match inbox.recv_timeout(until.saturating_duration_since(Instant::now())) {
                Ok(message) => self.take(message),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => break,
            }
            self.start_again();
        }
        self.end();
    }

    fn take(&mut self, message: Message) {
        match message {
            Message::Report(lane, report) => self.hear(lane, report),
            Message::Do(what) => what(self),
            Message::Library(news) => self.library_news(news),
        }
    }

    /// What nobody tells.
    fn tick(&mut self) {
        self.tend_changes();
        self.tend_cells();
        self.begin_where_possible();
        self.tend_stop();
        if Instant::now() >= self.next_sweep {
            self.next_sweep = Instant::now() + SWEEP;
            let shared = Arc::clone(&self.shared);
            self.shared.parts.worker.give(move || shared.sweep());
        }
        self.sample();
        if self.shared.changes.receiver_count() > 0 {
            self.show_links();
        }
    }

    /// Time since the gateway began, as the supervisors count it.
    pub(super) fn time(&self) -> Duration {
        self.began.elapsed()
    }

    pub(super) fn link(&mut self, name: &str) -> Result<&mut Link, Refusal> {
        self.links.get_mut(name).ok_or_else(|| Refusal::no_link(name))
    }

    /// What could not be written down is told once, until it can be again.
    pub(super) fn wrote<T>(&mut self, result: Result<T, JobsError>) -> Option<T> {
        match result {
            Ok(value) => {
                self.trouble = None;
                Some(value)
            }
            Err(error) => {
                let text = error.to_string();
                if self.trouble.as_ref() != Some(&text) {
                    tracing::error!(%error, "the journal of jobs cannot be written");
                }
                self.trouble = Some(text);
                None
            }
        }
    }

    /// Shows a job to whoever listens.
    pub(super) fn show_job(&mut self, job: &Job) {
        self.results.take(job);
        if job.state.is_final() {
            self.left_cell(job);
        }
        let view = self.job_view(job);
        self.shared.changed(Change::Job(Box::new(view)));
        self.shared.parts.journal_writer.look();
    }
}

impl fmt::Debug for Shared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shared").field("started_ms", &self.started_ms).finish_non_exhaustive()
    }
}
