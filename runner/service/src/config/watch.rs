//! Notices when the configuration's file is changed, or another put in its place.

use std::ffi::OsString;
use std::path::Path;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use notify::{Event, EventKind, RecommendedWatcher, RecursiveMode, Watcher};

/// Editors write in several steps: the file is read when it has been left alone
/// for so long.
const SETTLED: Duration = Duration::from_millis(300);

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
            let is_change = !matches!(event.kind, EventKind::Access(_));
            let is_it = event.paths.iter().any(|path| path.file_name() == Some(&name));
            if is_change && is_it {
                // The thread ends only with this sender.
                let _ = to.send(());
            }
        })?;
        // The folder, not the file: editors put another file in its place.
        let folder = file.parent().filter(|folder| !folder.as_os_str().is_empty());
        watcher.watch(folder.unwrap_or(Path::new(".")), RecursiveMode::NonRecursive)?;
        thread::Builder::new()
            .name("config-watch".to_owned())
            .spawn(move || settle(&changes, changed))
            .map_err(notify::Error::io)?;
        Ok(Self { _watcher: watcher })
    }
}

fn settle(changes: &Receiver<()>, changed: impl Fn()) {
    while changes.recv().is_ok() {
        while changes.recv_timeout(SETTLED).is_ok() {}
        changed();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

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
