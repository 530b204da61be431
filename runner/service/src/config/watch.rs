//! Notices when the configuration's file is changed, or another put in its place.

use std::ffi::OsString;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread;
use std::time::{Duration, Instant};

use notify::event::{AccessKind, AccessMode, ModifyKind};
use notify::{Event, EventKind, RecommendedWatcher, RecursiveMode, Watcher};
use softplug_live::store::{FileState, is_open_for_writing};

use crate::disk;

/// Editors write in several steps: the file is read when it has been left alone
/// for so long.
const SETTLED: Duration = Duration::from_millis(300);
/// Somebody has written into it and not closed it: it is not whole, unless the system does not tell.
const UNCLOSED: Duration =
    if cfg!(target_os = "linux") { Duration::from_secs(30) } else { SETTLED };
/// How often it is looked at if nothing is told of it.
const LOOK: Duration = Duration::from_secs(2);

/// What was seen of the file.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Seen {
    /// Somebody writes into it.
    Written,
    /// Whoever wrote into it is done, or another file was put in its place.
    Whole,
}

impl Seen {
    fn of(kind: EventKind) -> Option<Self> {
        match kind {
            EventKind::Access(AccessKind::Close(AccessMode::Write)) => Some(Self::Whole),
            EventKind::Access(_) => None,
            EventKind::Modify(ModifyKind::Data(_)) => Some(Self::Written),
            EventKind::Any
            | EventKind::Create(_)
            | EventKind::Modify(_)
            | EventKind::Remove(_)
            | EventKind::Other => Some(Self::Whole),
        }
    }
}

/// Watches a file until it is dropped.
#[derive(Debug)]
pub struct FileWatch {
    _watcher: RecommendedWatcher,
}

impl FileWatch {
    /// Calls `changed` on a thread of its own after each change.
    ///
    /// # Errors
    /// The system cannot watch its folder.
    pub fn start(file: &Path, changed: impl Fn() + Send + 'static) -> Result<Self, notify::Error> {
        let name = file.file_name().map(OsString::from).unwrap_or_default();
        let (to, changes) = channel();
        let mut watcher = notify::recommended_watcher(move |event: notify::Result<Event>| {
            let Ok(event) = event else { return };
            let is_it = event.paths.iter().any(|path| path.file_name() == Some(&name));
            if let Some(seen) = Seen::of(event.kind).filter(|_| is_it) {
                // The thread ends only with this sender.
                let _ = to.send(seen);
            }
        })?;
        // The folder, not the file: editors put another file in its place.
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
        watcher.watch(folder.unwrap_or(Path::new(".")), RecursiveMode::NonRecursive)?;
        let (file, known) = (file.to_owned(), state(file));
        thread::Builder::new()
            .name("config-watch".to_owned())
            .spawn(move || settle(&file, known, &changes, changed))
            .map_err(notify::Error::io)?;
        Ok(Self { _watcher: watcher })
    }
}

fn settle(file: &Path, mut known: Option<FileState>, changes: &Receiver<Seen>, changed: impl Fn()) {
    loop {
        let mut seen = match changes.recv_timeout(LOOK) {
            Ok(seen) => seen,
            Err(RecvTimeoutError::Timeout) if state(file) == known => continue,
            // Through a link, or by another name of it, it changes without a word.
            Err(RecvTimeoutError::Timeout) => Seen::Whole,
            Err(RecvTimeoutError::Disconnected) => return,
        };
        let mut since = Instant::now();
        known = state(file);
        loop {
            match changes.recv_timeout(SETTLED) {
                Ok(next) => (seen, since, known) = (next, Instant::now(), state(file)),
                Err(RecvTimeoutError::Timeout) => {
                    let now = state(file);
                    if now != known {
                        (since, known) = (Instant::now(), now);
                    } else if is_whole(file, seen) || since.elapsed() >= UNCLOSED {
                        break;
                    }
                }
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
        changed();
    }
}

/// `None`: there is no file, or it cannot be read.
fn state(file: &Path) -> Option<FileState> {
    FileState::of(&disk::open(file).ok()?).ok()
}

/// Whether nobody writes it, as far as the system tells.
fn is_whole(file: &Path, seen: Seen) -> bool {
    let opened = disk::open(file).ok();
    let is_open = opened.and_then(|file| is_open_for_writing(&file));
    is_open.map_or(seen == Seen::Whole, |is_open| !is_open)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{self, File};
    use std::io::Write as _;

    #[test]
    #[cfg(target_os = "linux")]
    fn a_file_that_is_being_written_is_not_told_before_it_is_closed() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("gateway.toml");
        fs::write(&file, "a").unwrap();
        let (to, told) = channel();
        let _watch = FileWatch::start(&file, move || to.send(()).unwrap()).unwrap();
        let mut writer = fs::File::create(&file).unwrap();
        assert!(told.recv_timeout(SETTLED * 3).is_err(), "it is empty");
        writer.write_all(b"half").unwrap();
        assert!(told.recv_timeout(SETTLED * 3).is_err(), "it is not whole");
        drop(writer);
        told.recv_timeout(Duration::from_mins(1)).unwrap();
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn what_others_do_to_a_file_that_is_being_written_does_not_make_it_whole() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("gateway.toml");
        let new = folder.path().join("new");
        fs::write(&file, "a").unwrap();
        let (to, told) = channel();
        let _watch = FileWatch::start(&file, move || to.send(()).unwrap()).unwrap();
        let mut writer = File::create(&new).unwrap();
        writer.write_all(b"half").unwrap();
        fs::rename(&new, &file).unwrap();
        if is_open_for_writing(&File::open(&file).unwrap()).is_some() {
            assert!(told.recv_timeout(SETTLED * 3).is_err(), "it came half");
            File::options().append(true).open(&file).unwrap();
            assert!(told.recv_timeout(SETTLED * 3).is_err(), "somebody else closed it");
        }
        drop(writer);
        told.recv_timeout(Duration::from_mins(1)).unwrap();
    }

    #[test]
    fn who_is_dropped_tells_nothing_any_more() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("gateway.toml");
        let (to, told) = channel();
        let watch = FileWatch::start(&file, move || to.send(()).unwrap()).unwrap();
        let mut writer = File::create(&file).unwrap();
        writer.write_all(b"half").unwrap();
        drop(watch);
        assert_eq!(told.recv_timeout(UNCLOSED * 2), Err(RecvTimeoutError::Disconnected));
    }

    #[test]
    #[cfg(unix)]
    fn a_file_behind_a_link_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let other = tempfile::tempdir().unwrap();
        let (file, target) = (folder.path().join("gateway.toml"), other.path().join("real.toml"));
        fs::write(&target, "a").unwrap();
        std::os::unix::fs::symlink(&target, &file).unwrap();
        let (to, told) = channel();
        let _watch = FileWatch::start(&file, move || to.send(()).unwrap()).unwrap();
        fs::write(&target, "bb").unwrap();
        told.recv_timeout(Duration::from_mins(1)).unwrap();
    }

    #[test]
    fn a_change_is_told_and_other_files_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("gateway.toml");
        fs::write(&file, "a").unwrap();
        let (to, told) = channel();
        let _watch = FileWatch::start(&file, move || to.send(()).unwrap()).unwrap();
        fs::write(folder.path().join("other.toml"), "x").unwrap();
        assert!(told.recv_timeout(SETTLED * 3).is_err());
        fs::write(&file, "b").unwrap();
        told.recv_timeout(Duration::from_mins(1)).unwrap();
        let new = folder.path().join("new");
        fs::write(&new, "c").unwrap();
        fs::rename(&new, &file).unwrap();
        told.recv_timeout(Duration::from_mins(1)).unwrap();
    }
}
