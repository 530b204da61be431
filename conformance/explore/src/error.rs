//! Why nothing can be explored.

use softplug_host::LoadError;
use std::path::PathBuf;
use thiserror::Error;

/// Why a plug-in cannot be explored.
///
/// ```
/// use softplug_explore::{ExploreError, plans};
///
/// let error = plans("punch-card").unwrap_err();
/// assert!(matches!(error, ExploreError::NoPlan { .. }));
/// ```
#[derive(Debug, Error)]
pub enum ExploreError {
    /// The module is no plug-in.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The module cannot be opened for exploring.
    #[error("the module cannot be explored: {reason}")]
    Module {
        /// What is in the way.
        reason: String,
    },
    /// Nothing is known of how this profile is explored.
    #[error("profile \"{profile}\" cannot be explored; these can: {known}")]
    NoPlan {
        /// As it was asked for.
        profile: String,
        /// Those that can.
        known: String,
    },
    /// A setting is not the plug-in's, or its value is none.
    #[error("{0}")]
    Setting(String),
    /// There are jobs to give, and the plug-in has no kind of job.
    #[error("the plug-in has no kind of job")]
    NoJob,
    /// Something is asked of a second plug-in where there is none.
    #[error("the partner in configuration \"{name}\" is no plug-in: it has no settings and jobs")]
    NoPeer {
        /// The configuration.
        name: &'static str,
    },
    /// The link did not open.
    #[error("the link does not open: {reason}")]
    Open {
        /// What the plug-in did.
        reason: String,
    },
    /// A way that was kept leads elsewhere now.
    #[error("the states that were kept are not those of this version: explore anew")]
    Differs,
    /// What an earlier exploration left cannot be used.
    #[error("{path}: {reason}", path = path.display())]
    Kept {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}
