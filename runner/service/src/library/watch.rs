//! Watches the library: what is put into `incoming/` is taken, what is new is told
//! at once.

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs::{self, Metadata};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime};

use notify::event::{AccessKind, AccessMode, ModifyKind, RenameMode};
use notify::{EventKind, RecommendedWatcher, RecursiveMode, Watcher};
use softplug_host::Digest;

use super::{Entry, Library, LibraryError, Reference, Which};
use crate::disk::{self, DiskError};

/// A file that nobody has written to for so long is whole, also if its closing was not seen.
const SETTLED: Duration = Duration::from_secs(2);
/// Several changes are looked at together.
const GATHER: Duration = Duration::from_millis(20);

/// What happened in the library.
#[derive(Debug)]
pub enum LibraryNews {
    /// A name and version mean this module from now on.
    Available(Box<Entry>),
    /// A name and version mean nothing any more.
    Gone {
        /// The plug-in's name.
        name: String,
        /// Its version.
        version: String,
    },
    /// A file in `incoming/` was not taken; it stays there.
    Refused {
        /// The file.
        file: PathBuf,
        /// Why.
        error: LibraryError,
    },
}

/// Watches until it is dropped.
#[derive(Debug)]
pub struct Watch {
    watcher: Option<RecommendedWatcher>,
    thread: Option<JoinHandle<()>>,
    /// Closed when the thread ends. Locked by nobody: it lets a watch be shared.
    ended: Mutex<Receiver<()>>,
}

/// How long the thread is waited for when it is to end: a disk may stand still.
const PATIENCE: Duration = Duration::from_secs(5);

impl Library {
    /// Tells, on a thread of its own, what becomes available from now on. What lies in `incoming/`
    /// already is taken first.
    ///
    /// # Errors
    /// The system cannot watch the folder.
    pub fn watch(
        &self,
        tell: impl FnMut(LibraryNews) + Send + 'static,
    ) -> Result<Watch, LibraryError> {
        let (signals, changes) = channel();
        let watcher = self.start_watching(signals)?;
        let worker = Worker {
            library: self.clone(),
            known: meanings(self)?,
            refused: HashMap::new(),
            closed: BTreeSet::new(),
            tell,
        };
        let thread = thread::Builder::new().name("library".to_owned());
        let (end, ended) = channel();
        let thread = thread
            .spawn(move || {
                let _end: Sender<()> = end;
                worker.run(&changes);
            })
            .map_err(DiskError::when("watch", &self.folder))?;
        Ok(Watch { watcher: Some(watcher), thread: Some(thread), ended: Mutex::new(ended) })
    }

    fn start_watching(&self, signals: Sender<Signal>) -> Result<RecommendedWatcher, LibraryError> {
        let failed = |error: notify::Error| {
            let source = match error.kind {
                notify::ErrorKind::Io(error) => error,
                _ => std::io::Error::other(error.to_string()),
            };
            DiskError { what: "watch", path: self.folder.clone(), source }
        };
        let mut watcher =
            notify::recommended_watcher(move |event: notify::Result<notify::Event>| {
                // Nobody listens any more: the watch is ending.
                let _ = signals.send(match event {
                    Ok(event) if is_whole(event.kind) => Signal::Closed(event.paths),
                    Ok(event) if matches!(event.kind, EventKind::Access(_)) => return,
                    _ => Signal::Changed,
                });
            })
            .map_err(failed)?;
        for part in ["names", "incoming"] {
            watcher.watch(&self.folder.join(part), RecursiveMode::Recursive).map_err(failed)?;
        }
        Ok(watcher)
    }
}

impl Drop for Watch {
    fn drop(&mut self) {
        // It holds the other end of the thread's channel.
        drop(self.watcher.take());
        if let Some(thread) = self.thread.take() {
            let ended = self.ended.get_mut().unwrap_or_else(PoisonError::into_inner);
            if ended.recv_timeout(PATIENCE) == Err(RecvTimeoutError::Timeout) {
                tracing::warn!("what is put into the library does not end and is left behind");
                return;
            }
            // It has panicked, which was told then.
            let _ = thread.join();
        }
    }
}

enum Signal {
    Changed,
    /// These were written and closed, or moved here.
    Closed(Vec<PathBuf>),
}

fn is_whole(kind: EventKind) -> bool {
    matches!(
        kind,
        EventKind::Access(AccessKind::Close(AccessMode::Write))
            | EventKind::Modify(ModifyKind::Name(RenameMode::To | RenameMode::Both))
    )
}

type Meanings = BTreeMap<(String, String), Digest>;

fn meanings(library: &Library) -> Result<Meanings, LibraryError> {
    let named = library.index().all()?.into_iter();
    Ok(named.map(|named| ((named.name, named.version), named.digest)).collect())
}

struct Worker<T> {
    library: Library,
    known: Meanings,
    /// As they were when they were refused: they are tried again when they have changed.
    refused: HashMap<PathBuf, (u64, Option<SystemTime>)>,
    closed: BTreeSet<PathBuf>,
    tell: T,
}

impl<T: FnMut(LibraryNews)> Worker<T> {
    fn run(mut self, changes: &Receiver<Signal>) {
        let mut waits = self.take_incoming();
        self.compare();
        loop {
            let signal = if waits {
                changes.recv_timeout(SETTLED)
            } else {
                changes.recv().map_err(|_| RecvTimeoutError::Disconnected)
            };
            match signal {
                Ok(signal) => {
                    self.heed(signal);
                    thread::sleep(GATHER);
                    while let Ok(signal) = changes.try_recv() {
                        self.heed(signal);
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            waits = self.take_incoming();
            self.compare();
        }
    }

    fn heed(&mut self, signal: Signal) {
        if let Signal::Closed(paths) = signal {
            self.closed.extend(paths);
        }
    }

    /// Takes what is whole; tells whether something is still being written.
    fn take_incoming(&mut self) -> bool {
        let incoming = self.library.folder.join("incoming");
        let closed = std::mem::take(&mut self.closed);
        let names = disk::names_in(&incoming).unwrap_or_default();
        self.refused.retain(|path, _| path.exists());
        let mut waits = false;
        for name in
            names.iter().filter(|name| Path::new(name).extension().is_some_and(|end| end == "wasm"))
        {
            let path = incoming.join(name);
            let Ok(metadata) = fs::metadata(&path) else { continue };
            let state = (metadata.len(), metadata.modified().ok());
            if self.refused.get(&path) == Some(&state) {
                continue;
            }
            if closed.contains(&path) || is_settled(&metadata) {
                self.take(&path, state);
            } else {
                waits = true;
            }
        }
        waits
    }

    fn take(&mut self, path: &Path, state: (u64, Option<SystemTime>)) {
        let taken = self.library.add_file(path).and_then(|_| Ok(disk::remove(path)?));
        if let Err(error) = taken {
            self.refused.insert(path.to_owned(), state);
            (self.tell)(LibraryNews::Refused { file: path.to_owned(), error });
        }
    }

    /// Tells what means something else than before.
    fn compare(&mut self) {
        let now = match meanings(&self.library) {
            Ok(now) => now,
            Err(error) => {
                tracing::warn!(%error, "the library cannot be read");
                return;
            }
        };
        let before = std::mem::replace(&mut self.known, now);
        for ((name, version), digest) in &self.known {
            if before.get(&(name.clone(), version.clone())) == Some(digest) {
                continue;
            }
            let which = Which::Digest(digest.to_string());
            match self.library.resolve(&Reference { name: name.clone(), which }) {
                Ok(entry) => (self.tell)(LibraryNews::Available(Box::new(entry))),
                Err(error) => tracing::warn!(%error, "a new version cannot be used"),
            }
        }
        for (name, version) in before.into_keys() {
            if !self.known.contains_key(&(name.clone(), version.clone())) {
                (self.tell)(LibraryNews::Gone { name, version });
            }
        }
    }
}

fn is_settled(metadata: &Metadata) -> bool {
    let age = metadata.modified().ok().and_then(|modified| modified.elapsed().ok());
    age.is_some_and(|age| age >= SETTLED)
}
