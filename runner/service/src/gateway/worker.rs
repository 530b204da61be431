//! Work that takes time, away from the control loop, in the order in which it came.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

type Work = Box<dyn FnOnce() + Send>;

/// A thread for work that takes time.
#[derive(Debug)]
pub(crate) struct Worker {
    to: Sender<Work>,
}

impl Worker {
    pub(crate) fn start(name: &str) -> io::Result<Self> {
        let (to, work) = channel::<Work>();
        thread::Builder::new().name(name.to_owned()).spawn(move || {
            for work in work {
                // One piece of work that fails must not keep the others from being done.
                if catch_unwind(AssertUnwindSafe(work)).is_err() {
                    tracing::error!("a piece of work has met a state that it should not");
                }
            }
        })?;
        Ok(Self { to })
    }

    pub(crate) fn give(&self, work: impl FnOnce() + Send + 'static) {
        // The thread ends only with this sender.
        let _ = self.to.send(Box::new(work));
    }

    /// Waits until all that it was given before is done, and let go, but no longer than
    /// `patience`: whether it is.
    pub(crate) fn catch_up(&self, patience: Duration) -> bool {
        let (last, done) = channel::<()>();
        self.give(move || drop(last));
        !matches!(done.recv_timeout(patience), Err(RecvTimeoutError::Timeout))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_never_ends_is_not_waited_for() {
        let worker = Worker::start("test").unwrap();
        assert!(worker.catch_up(Duration::from_mins(1)));
        let (never, ends) = channel::<()>();
        worker.give(move || {
            let _ = ends.recv();
        });
        assert!(!worker.catch_up(Duration::from_millis(10)));
        drop(never);
        assert!(worker.catch_up(Duration::from_mins(1)));
    }
}
