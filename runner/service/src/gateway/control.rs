//! The control loop: one thread that owns what is decided about links.
//!
//! It hears of what happened from the reactor, is asked by handles, and tells the
//! reactor what to do. It writes down what must be known after a crash; it never
//! compiles, never reads programs and never waits for a machine.

use std::fmt;
use std::os::fd::OwnedFd;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::link::Link;
use super::{Control, Message, Parts, Shared};
use crate::Refusal;
use crate::jobs::{Job, JobsError};
use crate::view::Change;

/// How long a handle waits for the loop: it answers in microseconds, a disk that
/// stands still may hold it up.
const PATIENCE: Duration = Duration::from_secs(10);
/// How often what nobody tells is looked at, and shown.
const TICK: Duration = Duration::from_millis(250);
/// How often snapshots are removed that no job needs any more.
pub(super) const SWEEP: Duration = Duration::from_hours(1);

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
