//! Notices when a file of a project is saved.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use notify::{Event, EventKind, RecommendedWatcher, RecursiveMode, Watcher};

use super::next;
use crate::commands::build::Project;
use crate::failure::Failure;

/// Editors write in several steps: files are read when they have been left alone for so long.
const SETTLED: Duration = Duration::from_millis(50);
/// But not for ever.
const STEPS: usize = 20;

/// Watches a project until it is dropped.
pub(super) struct Changes {
    saves: Receiver<Instant>,
    /// Something was saved, and [`next`](Self::next) has not told it yet.
    news: Arc<AtomicBool>,
    _watcher: RecommendedWatcher,
}

impl Changes {
    pub(super) fn watch(project: &Project) -> Result<Self, Failure> {
        let root = project.root();
        let root = if root.as_os_str().is_empty() { Path::new(".") } else { root };
        let fail = |error: &dyn std::fmt::Display| {
            Failure::usage(format_args!("{} cannot be watched: {error}", root.display()))
        };
        let root = root.canonicalize().map_err(|error| fail(&error))?;
        let parts: Vec<PathBuf> = project.sources().map(|name| root.join(name)).collect();
        let folders: Vec<_> = parts.iter().filter(|part| part.is_dir()).cloned().collect();
        let (to, saves) = channel();
        let news = Arc::new(AtomicBool::new(false));
        let has_come = Arc::clone(&news);
        let mut watcher = notify::recommended_watcher(move |event: notify::Result<Event>| {
            let Ok(event) = event else { return };
            let is_change = !matches!(event.kind, EventKind::Access(_));
            if is_change && event.paths.iter().any(|path| is_source(&parts, path)) {
                has_come.store(true, Ordering::Relaxed);
                // Nobody listens any more: it is ending.
                let _ = to.send(Instant::now());
            }
        })
        .map_err(|error| fail(&error))?;
        // The folder of files, not the files: editors put others in their place.
        let top = watcher.watch(&root, RecursiveMode::NonRecursive);
        let below = folders.iter().map(|folder| watcher.watch(folder, RecursiveMode::Recursive));
        let watched = std::iter::once(top).chain(below).collect::<Result<(), _>>();
        watched.map_err(|error| fail(&error))?;
        Ok(Self { saves, news, _watcher: watcher })
    }

    /// True as soon as something is saved; whoever sets it breaks off what waits for that.
    pub(super) fn news(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.news)
    }

    /// When the next save began; none when it is time to end.
    pub(super) fn next(&self, stop: &AtomicBool) -> Option<Instant> {
        let first = next(&self.saves, stop)?;
        let mut steps = 0..STEPS;
        while steps.next().is_some() && self.saves.recv_timeout(SETTLED).is_ok() {}
        if !stop.load(Ordering::Relaxed) {
            self.news.store(false, Ordering::Relaxed);
        }
        Some(first)
    }
}

/// Whether it is a file that the plug-in is made of or held against, and not an editor's own.
fn is_source(parts: &[PathBuf], path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let is_editors = name.starts_with('.') || name.ends_with('~') || name.ends_with(".swp");
    !is_editors && parts.iter().any(|part| path.starts_with(part))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_sources_count() {
        let parts = ["/p/Cargo.toml", "/p/src", "/p/traces"].map(PathBuf::from);
        for path in ["/p/Cargo.toml", "/p/src/lib.rs", "/p/traces/x/x.a.spt"] {
            assert!(is_source(&parts, Path::new(path)), "{path}");
        }
        for path in
            ["/p/Cargo.lock", "/p/target", "/p/src/.lib.rs.swx", "/p/src/lib.rs~", "/q/src/x"]
        {
            assert!(!is_source(&parts, Path::new(path)), "{path}");
        }
    }
}
