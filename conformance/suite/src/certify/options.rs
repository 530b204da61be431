//! What is asked for, and how far it is.

use super::baseline::Baseline;
use crate::random::Sessions;

/// What is asked for.
///
/// ```
/// use softplug_conformance::certify::{Baseline, CertifyOptions};
/// use std::path::Path;
///
/// let known = "[[expected]]\ncase = \"xon-xoff.tx.hold\"\nclass = \"diverged\"\nreason = \"Slow.\"";
/// let baseline = Some(Baseline::parse(Path::new("known.toml"), known)?);
/// let options = CertifyOptions { strict: true, baseline, ..CertifyOptions::new("xon-xoff") };
/// assert!(options.cases.is_empty() && options.threads > 0);
/// # Ok::<(), softplug_conformance::FileError>(())
/// ```
#[derive(Clone, Debug)]
pub struct CertifyOptions {
    /// The profile.
    pub profile: String,
    /// The revision whose cases are scored; none: the newest.
    pub revision: Option<u32>,
    /// A failed SHOULD counts as a failed MUST.
    pub strict: bool,
    /// Patterns of case ids, with `*` for any characters and `?` for one; empty: all.
    /// They make a run partial.
    pub cases: Vec<String>,
    /// Failures that are expected.
    pub baseline: Option<Baseline>,
    /// How many cases run at a time. The report does not depend on it.
    pub threads: usize,
    /// Random sessions. Fewer than a whole verdict needs make a run partial.
    pub sessions: Sessions,
    /// Changes where random cuts fall, and so maybe what is executed.
    pub cut_seed: u64,
    /// Runs the cases in another order. The report does not depend on it.
    pub shuffle: Option<u64>,
}

impl CertifyOptions {
    /// The whole newest revision of a profile, on all processors.
    pub fn new(profile: impl Into<String>) -> Self {
        let profile = profile.into();
        Self {
            sessions: Sessions::whole(&profile),
            profile,
            revision: None,
            strict: false,
            cases: Vec::new(),
            baseline: None,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            cut_seed: 0,
            shuffle: None,
        }
    }
}

/// How far a certification is; told after each case, from any thread.
///
/// The example of [`certify()`](super::certify()) shows it.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Progress {
    /// Cases that are over.
    pub done: usize,
    /// Cases that are run in all.
    pub cases: usize,
    /// Cases of which a run failed.
    pub failed: usize,
}
