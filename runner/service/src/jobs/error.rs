//! What can go wrong with jobs, by blame.

use softplug_abi::JobId;
use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::{State, Step};
use crate::disk::{self, DiskError};

/// Why it cannot be done.
#[derive(Debug, Error)]
pub enum JobsError {
    /// There is no such job, or it is too old to be known.
    #[error("there is no job {0}")]
    NotFound(JobId),
    /// The job is not in a state for it.
    #[error("job {id} is {}: it cannot be {step}{}", state.name(), hint(*state))]
    State {
        /// The job.
        id: JobId,
        /// Where it stands.
        state: State,
        /// What was asked for.
        step: Step,
    },
    /// The job has not ended.
    #[error("job {id} is {}: it can be restarted when it has ended", state.name())]
    NotEnded {
        /// The job.
        id: JobId,
        /// Where it stands.
        state: State,
    },
    /// What was asked for does not fit the job.
    #[error("{0}")]
    Spec(String),
    /// Too many jobs wait already.
    #[error("{waiting} jobs wait on \"{link}\", no more are taken: abort some, or wait")]
    QueueFull {
        /// The link.
        link: String,
        /// How many.
        waiting: usize,
    },
    /// Our disk.
    #[error(transparent)]
    Disk(#[from] DiskError),
    /// Our database.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl JobsError {
    /// There was no room on the disk.
    pub fn is_full(&self) -> bool {
        match self {
            Self::Disk(error) => error.is_full(),
            Self::Store(error) => error.is_full(),
            _ => false,
        }
    }
}

/// The database would not do it. What was to be written is not, as far as can be known.
#[derive(Debug, Error)]
#[error("the jobs and the journal in {} cannot be used: {}", path.display(), text(source))]
pub struct StoreError {
    /// The database.
    pub path: PathBuf,
    /// Why.
    pub source: Box<redb::Error>,
}

impl StoreError {
    /// There was no room on the disk.
    pub fn is_full(&self) -> bool {
        io_error(&self.source).is_some_and(disk::is_full)
    }
}

pub(super) fn io_error(error: &redb::Error) -> Option<&io::Error> {
    match error {
        redb::Error::Io(error) => Some(error),
        _ => None,
    }
}

fn text(error: &redb::Error) -> String {
    match error {
        redb::Error::DatabaseAlreadyOpen => {
            "another gateway uses them; each needs a state folder of its own".to_owned()
        }
        redb::Error::Io(error) if disk::is_full(error) => format!("{error}; make room on the disk"),
        error => error.to_string(),
    }
}

fn hint(state: State) -> &'static str {
    match state {
        State::Interrupted | State::Failed | State::Aborted => {
            "; restart it, from a block if need be"
        }
        _ => "",
    }
}
