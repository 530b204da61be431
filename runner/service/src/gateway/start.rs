//! Starting a gateway: folders, library, journal, links, one after the other,
//! and what went wrong by blame.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Write as _;
use std::io;
use std::os::fd::OwnedFd;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::channel;
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Instant;

use softplug_host::compiler::CompilerProcess;
use softplug_host::{Host, HostOptions, LoadError};
use softplug_live::PortError;
use softplug_live::reactor::ReactorOptions;
use thiserror::Error;
use tokio::sync::broadcast;

use super::block_finder::BlockFinder;
use super::cells::Cells;
use super::control::SWEEP;
use super::drivers::Drivers;
use super::drops::Drops;
use super::history::STEP;
use super::journal_writer::JournalWriter;
use super::loading::Loader;
use super::reload::prepare;
use super::results::Results;
use super::worker::Worker;
use super::{Control, Gateway, Message, Parts, Shared};
use crate::config::{Config, ConfigError, ConfigFinding, LinkConfig, PortConfig};
use crate::disk::DiskError;
use crate::feeder::Feeder;
use crate::jobs::{Job, Jobs, JobsError, Keep, Kind, Note, Recovery, Subject, Weight};
use crate::library::{Library, LibraryError, Watch};
use crate::programs::{Programs, Quotas, Receptions, Snapshots};
use crate::reception_writer::ReceptionWriter;
use crate::view::now_ms;

/// Changes that a reader who is slow may fall behind.
const CHANGES: usize = 4_096;
/// How long work that was begun is waited for at the end: a disk may stand still.
const CATCHING_UP: std::time::Duration = std::time::Duration::from_secs(5);
/// How often it is looked whether the end has come.
const LOOK: std::time::Duration = std::time::Duration::from_millis(20);
/// Instances of plug-ins: the one that runs, a successor, one to go back to, and one
/// that is not dropped yet.
const INSTANCES_A_LINK: usize = 4;

/// Why a gateway does not start.
#[derive(Debug, Error)]
pub enum StartError {
    /// What the configuration asks for cannot be had.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// A folder cannot be used.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// The library cannot be used.
    #[error(transparent)]
    Library(#[from] LibraryError),
    /// The jobs and the journal cannot be used.
    #[error(transparent)]
    Jobs(#[from] JobsError),
    /// No plug-in can run on this machine.
    #[error(transparent)]
    Host(#[from] LoadError),
    /// The reactor cannot be started.
    #[error(transparent)]
    Reactor(#[from] PortError),
    /// The system gives no thread.
    #[error("no thread can be started: {0}")]
    Thread(#[from] io::Error),
}

/// A gateway that runs, and the thread that it runs on.
#[derive(Debug)]
pub struct Running {
    gateway: Gateway,
    thread: JoinHandle<()>,
    _library: Option<Watch>,
}

impl Running {
    /// The handle.
    pub fn gateway(&self) -> &Gateway {
        &self.gateway
    }

    /// Waits until the links are closed and what was received is put away; the handle still answers
    /// for the rest.
    pub fn wait_for_stop(&self) {
        while !self.thread.is_finished() {
            thread::sleep(LOOK);
        }
    }

    /// Devices that stay open for the gateway that takes the place of this one, once that was
    /// [asked for](Gateway::make_way) and the links are closed.
    pub fn kept(&self) -> Vec<OwnedFd> {
        std::mem::take(&mut *self.gateway.shared.kept())
    }

    /// How many bytes of receptions were given up by a stop that was [said again](Gateway::stop), once
    /// it has stopped.
    pub fn lost(&self) -> u64 {
        self.gateway.shared.lost.load(Ordering::Relaxed)
    }

    /// Waits until it has stopped. If there is no other handle any more, its database is
    /// closed when this returns, unless work that was begun does not end.
    pub fn wait(self) {
        if self.thread.join().is_err() {
            tracing::error!("the control loop has met a state that it should not");
        }
        let Parts { worker, requests, loading, .. } = &self.gateway.shared.parts;
        let until = Instant::now() + CATCHING_UP;
        let workers = [(worker, "journal"), (requests, "requests"), (loading, "loading")];
        for (worker, what) in workers {
            if !worker.catch_up(until.saturating_duration_since(Instant::now())) {
                tracing::warn!(what, "work that does not end is left behind");
            }
        }
    }
}

/// Checks what only the library can tell: that plug-ins are there and take
/// their settings. Nothing is started or written. What works and may be meant
/// otherwise is given: lines that are not the protocol's.
pub fn check(config: &Config) -> Result<Vec<ConfigFinding>, StartError> {
    let library = Library::existing(&config.gateway.library)?;
    let loader = Loader::new(Host::new(HostOptions::default())?, library);
    let (mut problems, mut remarks) = (Vec::new(), Vec::new());
    for mut link in config.links.clone() {
        match prepare(&loader, &mut link) {
            Ok(prepared) => remarks.extend(link.line_remark(prepared.line())),
            Err(problem) => problems.push(problem),
        }
    }
    if problems.is_empty() { Ok(remarks) } else { Err(ConfigError::Wrong(problems).into()) }
}

/// Starts what a configuration describes.
pub fn start(config: Config) -> Result<Running, StartError> {
    let state = &config.gateway.state;
    let keep = Keep { entries: config.gateway.journal, ..Keep::default() };
    let (jobs, recovery) = Jobs::open(state, keep)?;
    let snapshots = Snapshots::open_folder(&state.join("snapshots"))?;
    snapshots.collect_garbage(|| jobs.reader().needed_data())?;
    let receptions = Receptions::open(&config.gateway.receptions)?;
    let received = recover_receptions(&config, &jobs, &receptions, &recovery)?;
    let quotas = Quotas::new(&config.gateway.receptions, config.gateway.free_space);
    let programs = Programs::open(&config.gateway.programs)?;
    let library = Library::open(&config.gateway.library)?;
    let instances = (config.links.len() * INSTANCES_A_LINK + 64).max(1_024) as u32;
    let cache = Some(state.join("cache"));
    let compiler = CompilerProcess::installed().map(CompilerProcess::in_background);
    let options = HostOptions { cache, compiler, instances, ..HostOptions::default() };
    let host = Host::new(options)?;
    let (changes, _) = broadcast::channel(CHANGES);
    let (inbox, messages) = channel();
    let journal_writer = JournalWriter::start(jobs.clone(), changes.clone())?;
    let worker = Worker::start("softplug-worker")?;
    let requests = Worker::start("softplug-panel")?;
    let loading = Worker::start("softplug-load")?;
    let library = library.checking(loads(&host));
    let loader = Loader::new(host, library.clone());
    let shared = Arc::new(Shared {
        inbox: inbox.clone(),
        changes,
        started_ms: now_ms(),
        traces: config.gateway.traces.clone(),
        upload_bytes: config.http.as_ref().map_or(u64::MAX, |http| http.limits.upload_bytes),
        parts: Parts {
            loader,
            jobs,
            programs,
            snapshots,
            receptions,
            quotas,
            journal_writer,
            worker,
            requests,
            loading,
        },
        is_stopping: AtomicBool::new(false),
        lost: AtomicU64::new(0),
        kept: Mutex::default(),
    });
    let ready = shared.make_ready(config)?;
    tell_recovery(&shared.parts.journal_writer, &recovery, received);
    let options = ReactorOptions {
        threads: ready.config.gateway.threads,
        links_per_thread: ready.config.gateway.links_per_thread,
        real_time_priority: ready.config.gateway.real_time_priority,
    };
    let reports = inbox.clone();
    let drivers = Drivers::start(options, move |lane, report| {
        // Nobody listens only while the gateway is being taken down.
        let _ = reports.send(Message::Report(lane, report));
    })?;
    let news = inbox;
    let watch = library.watch(move |entry| {
        let _ = news.send(Message::Library(entry));
    });
    let watch = watch.map_err(|error| tracing::warn!(%error, "the library is not watched")).ok();
    let (jobs, snapshots) = (shared.parts.jobs.clone(), shared.parts.snapshots.clone());
    let to = Arc::clone(&shared);
    let feeder = Feeder::start(jobs.clone(), snapshots.clone(), move |news| {
        to.tell(move |control| control.feeder_news(news));
    })?;
    let (to, receptions) = (Arc::clone(&shared), shared.parts.receptions.clone());
    let quotas = shared.parts.quotas.clone();
    let reception_writer =
        ReceptionWriter::start(jobs, receptions, snapshots, quotas, move |news| {
            to.tell(move |control| control.reception_writer_news(news));
        })?;
    let mut control = Control {
        shared: Arc::clone(&shared),
        config: ready.config.clone(),
        drivers,
        feeder,
        reception_writer,
        to_put_away: BTreeMap::new(),
        links: BTreeMap::new(),
        lanes: HashMap::new(),
        cells: Cells::default(),
        drops: Drops::default(),
        audiences: HashMap::new(),
        shown: HashMap::new(),
        shown_jobs: HashMap::new(),
        results: Results::of(&shared.parts.jobs)?,
        next_lane: 1,
        began: Instant::now(),
        next_sweep: Instant::now() + SWEEP,
        next_sample: Instant::now() + STEP,
        block_finder: BlockFinder::default(),
        stopping: None,
        trouble: None,
        config_trouble: None,
    };
    let thread = thread::Builder::new().name("softplug-control".to_owned()).spawn(move || {
        control.apply(ready);
        control.run(&messages);
    })?;
    Ok(Running { gateway: Gateway { shared }, thread, _library: watch })
}

/// Whether a module can be loaded and started, as a check of the library: what takes too much compiling
/// is refused where it comes in, and not where it is swapped onto a link. One at a time, so that
/// many at once take no more memory than one.
fn loads(host: &Host) -> impl Fn(&[u8]) -> Result<(), LibraryError> + Send + Sync + 'static {
    let (host, one) = (host.clone(), Mutex::new(()));
    move |wasm| {
        let _one = one.lock();
        let loaded = host.load_bytes(wasm).and_then(|plugin| plugin.instantiate().map(drop));
        loaded.map_err(|error| match error {
            LoadError::CompilerProcess(_) | LoadError::TooManyInstances { .. } => {
                LibraryError::Unchecked(error.to_string())
            }
            error => LibraryError::Unfit(error.to_string()),
        })
    }
}

/// Receptions that were under way when the last gateway ended.
#[derive(Copy, Clone, Default)]
struct RecoveredReceptions {
    kept: usize,
    lost: usize,
}

/// What the last gateway left behind of receptions is kept as failed, and belongs to its job. Of a
/// job without a file nothing is there any more: that is said.
fn recover_receptions(
    config: &Config,
    jobs: &Jobs,
    receptions: &Receptions,
    recovery: &Recovery,
) -> Result<RecoveredReceptions, StartError> {
    let mut recovered = RecoveredReceptions::default();
    let left_over = receptions.recover()?;
    for left in &left_over {
        let mut links = config.links.iter();
        let link = links.find(|link| link.receive == left.place).map(|link| &*link.name);
        if let Some(file) = left.arrived.file() {
            jobs.recovered(left.job, link, file, left.arrived.bytes)?;
            recovered.kept += 1;
        }
    }
    for job in &recovery.interrupted {
        let is_received = job.spec.kind == Kind::Receive;
        if !is_received && !left_over.iter().any(|left| left.job == job.id) {
            continue;
        }
        if jobs.reader().job(job.id).is_ok_and(|job| job.reception.is_some()) {
            continue;
        }
        let link = config.links.iter().find(|link| link.name == job.spec.link);
        // A unit says again what it was not told to be stored.
        let is_in_unit = link.is_some_and(|link| matches!(link.port, PortConfig::Unit(_)));
        if is_in_unit || link.is_some_and(|link| may_be_there(link, job, jobs, receptions)) {
            continue;
        }
        jobs.lost(job.id)?;
        recovered.lost += 1;
    }
    Ok(recovered)
}

/// Whether a file came after this job had begun and belongs to none: the gateway may have ended
/// between the two.
fn may_be_there(link: &LinkConfig, job: &Job, jobs: &Jobs, receptions: &Receptions) -> bool {
    let Ok(files) = receptions.list(&link.receive) else { return true };
    let later = files.iter().take_while(|file| file.modified >= job.created);
    let names: Vec<&str> = later.map(|file| &*file.name).collect();
    let known = jobs.reader().of_receptions(&link.name, names.iter().copied());
    known.map_or(true, |known| names.iter().any(|name| !known.contains_key(name)))
}

fn tell_recovery(
    journal_writer: &JournalWriter,
    recovery: &Recovery,
    received: RecoveredReceptions,
) {
    let (interrupted, queued) = (recovery.interrupted.len(), recovery.queued);
    let RecoveredReceptions { kept, lost } = received;
    let mut text = format!(
        "the gateway starts; {interrupted} jobs were interrupted, {queued} wait, {kept} receptions \
         were kept as failed"
    );
    if lost > 0 {
        let _ = write!(text, ", {lost} were lost with the gateway: nothing of them is on the disk");
    }
    let weight = if interrupted + kept > 0 { Weight::Warning } else { Weight::Normal };
    journal_writer.note(Note::new(Subject::Gateway, text).weighing(weight));
}
