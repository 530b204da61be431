//! Writes into the journal what may be written a moment later, and shows what
//! was written.

use std::io;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use tokio::sync::broadcast;

use crate::jobs::{Entry, EntryFilter, Jobs, Note, Subject, Weight};
use crate::view::Change;
use std::sync::Arc;

/// Entries are looked for a little later, several at once.
const GATHER: Duration = Duration::from_millis(20);
/// Entries that are read at once.
const READ: usize = 200;
/// Notes that wait; beyond that they are in the log only.
const WAITING: usize = 10_000;

/// Writes into the journal.
#[derive(Debug)]
pub(crate) struct JournalWriter {
    to: Option<Sender<Option<Note>>>,
    thread: Option<JoinHandle<()>>,
}

/// What it was given is written before it ends.
impl Drop for JournalWriter {
    fn drop(&mut self) {
        drop(self.to.take());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl JournalWriter {
    pub(crate) fn start(jobs: Jobs, changes: broadcast::Sender<Arc<Change>>) -> io::Result<Self> {
        let (to, notes) = channel();
        let thread = thread::Builder::new()
            .name("journal".to_owned())
            .spawn(move || write(&jobs, &changes, &notes))?;
        Ok(Self { to: Some(to), thread: Some(thread) })
    }

    /// Something happened to a link.
    pub(crate) fn link(
        &self,
        subject: Subject,
        weight: Weight,
        link: &str,
        text: impl Into<String>,
    ) {
        let note = Note::new(subject, text).of_link(link).weighing(weight);
        self.note(note);
    }

    pub(crate) fn note(&self, note: Note) {
        let job = note.job.map(|job| job.0);
        if note.weight == Weight::Normal {
            tracing::info!(link = note.link, job, "{}", note.text);
        } else {
            tracing::warn!(link = note.link, job, "{}", note.text);
        }
        self.send(Some(note));
    }

    /// Something was written by somebody else.
    pub(crate) fn look(&self) {
        self.send(None);
    }

    fn send(&self, note: Option<Note>) {
        if let Some(to) = &self.to {
            let _ = to.send(note);
        }
    }
}

fn write(jobs: &Jobs, changes: &broadcast::Sender<Arc<Change>>, notes: &Receiver<Option<Note>>) {
    let mut shown = newest(jobs);
    while let Ok(first) = notes.recv() {
        thread::sleep(GATHER);
        for (count, note) in std::iter::once(first).chain(notes.try_iter()).flatten().enumerate() {
            if count >= WAITING {
                continue;
            }
            if let Err(error) = jobs.note(note) {
                tracing::error!(%error, "an entry of the journal is lost");
            }
        }
        let fresh = match shown {
            Some(shown) if changes.receiver_count() > 0 => behind(jobs, shown),
            _ => Vec::new(),
        };
        shown = fresh.first().map(|entry| entry.number).or_else(|| newest(jobs));
        for entry in fresh.into_iter().rev() {
            let _ = changes.send(Arc::new(Change::Journal(entry.into())));
        }
    }
}

/// The number of the newest entry; 0 where there is none, `None` if it cannot be read.
fn newest(jobs: &Jobs) -> Option<u64> {
    let entries = jobs.reader().journal(&EntryFilter { most: 1, ..EntryFilter::default() }).ok()?;
    Some(entries.first().map_or(0, |entry| entry.number))
}

/// All entries behind the one of this number, the newest first.
fn behind(jobs: &Jobs, number: u64) -> Vec<Entry> {
    let mut all: Vec<Entry> = Vec::new();
    loop {
        let before = all.last().map(|entry| entry.number);
        let filter = EntryFilter { before, most: READ, ..EntryFilter::default() };
        let Ok(entries) = jobs.reader().journal(&filter) else { return all };
        let is_full = entries.len() == READ;
        let known = entries.iter().position(|entry| entry.number <= number);
        all.extend(entries.into_iter().take(known.unwrap_or(READ)));
        if known.is_some() || !is_full || all.len() >= WAITING {
            return all;
        }
    }
}
