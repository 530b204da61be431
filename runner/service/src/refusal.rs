//! Why the gateway does not do what it was asked for, grouped by who can mend it.

use softplug_abi::JobId;
use thiserror::Error;

/// A refusal, as one clear sentence.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum Refusal {
    /// There is no such link, job, program, plug-in.
    #[error("{0}")]
    NotFound(String),
    /// It exists, but is in a state in which this cannot be done.
    #[error("{0}")]
    Conflict(String),
    /// What was given cannot be used.
    #[error("{field}: {reason}")]
    Invalid {
        /// Where it was given: a field of the order, or a setting.
        field: String,
        /// What is wrong with it, and what would be right.
        reason: String,
    },
    /// More than the limit allows.
    #[error("{0}")]
    TooLarge(String),
    /// The asker, or the set-up, does not allow it.
    #[error("{0}")]
    Forbidden(String),
    /// Not now: the gateway starts, stops, or its disk is full.
    #[error("{0}")]
    Unavailable(String),
    /// A bug of ours.
    #[error("{0}")]
    Internal(String),
}

impl Refusal {
    /// There is no link of this name.
    pub fn no_link(name: &str) -> Self {
        Self::NotFound(format!("there is no link \"{}\"", name.escape_debug()))
    }

    /// There is no job of this number.
    pub fn no_job(id: JobId) -> Self {
        Self::NotFound(format!("there is no job {id}"))
    }

    /// A field that cannot be used.
    pub fn invalid(field: impl Into<String>, reason: impl std::fmt::Display) -> Self {
        Self::Invalid { field: field.into(), reason: reason.to_string() }
    }
}
