//! What a score is asked for, and why there may be none.

use crate::random::WHOLE;
use std::thread;

/// What is asked for.
///
/// ```
/// use softplug_conformance::score::ScoreOptions;
///
/// let ScoreOptions { sample, seed, sessions, permutations, crossed, .. } = ScoreOptions::default();
/// assert_eq!((sample, seed, sessions, permutations, crossed), (Some(300), 1, 2_000, 400, 1_000));
/// ```
#[derive(Clone, Debug)]
pub struct ScoreOptions {
    /// So many changes, drawn at random; `None`: all of them.
    pub sample: Option<u32>,
    /// What they are drawn from.
    pub seed: u64,
    /// Random sessions of each profile.
    pub sessions: u32,
    /// Permutations that a change is run against at most, spread over all that reach it.
    pub permutations: usize,
    /// Crossed traces of each profile that show whether what nothing noticed can be told.
    pub crossed: u32,
    /// Changes that are looked into at a time.
    pub threads: usize,
}

impl Default for ScoreOptions {
    fn default() -> Self {
        let threads = thread::available_parallelism().map_or(1, usize::from);
        // More permutations hardly notice more, and are what a change that nothing notices costs.
        Self {
            sample: Some(300),
            seed: 1,
            sessions: WHOLE,
            permutations: 400,
            crossed: 1_000,
            threads,
        }
    }
}

/// A module that cannot be scored.
///
/// ```
/// use softplug_conformance::Corpus;
/// use softplug_conformance::score::{ScoreError, ScoreOptions, score};
///
/// let stop = std::sync::atomic::AtomicBool::new(false);
/// let error = score(b"no module", &Corpus::embedded(), &ScoreOptions::default(), &|_, _| {}, &stop);
/// assert!(matches!(error, Err(ScoreError::Module(_))));
/// ```
#[derive(Debug, thiserror::Error)]
pub enum ScoreError {
    /// It is no plug-in.
    #[error("{0}")]
    Module(String),
    /// Unchanged, it fails already: then no failure says anything.
    #[error("{run} fails without any change; a plug-in is scored when it is conformant")]
    Fails {
        /// The case.
        run: String,
    },
    /// It claims no profile of the corpus.
    #[error("the plug-in claims no profile that the corpus has")]
    NoProfile,
    /// It was ended from outside.
    #[error("ended before every change was tried")]
    Stopped,
}
