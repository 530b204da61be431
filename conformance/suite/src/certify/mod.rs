//! One certification: one plug-in, one profile, every case in every permutation.
//!
//! [`certify()`] has an example.

mod baseline;
mod engines;
mod execute;
mod glob;
mod observe;
mod plan;
mod rows;

pub use baseline::{Baseline, BaselineError, Expected};
pub use glob::matches;
pub use observe::{ObservedRun, observe};

use crate::Corpus;
use engines::Engines;
use plan::Plan;
use rows::Results;
use softplug_report::Report;
use std::sync::atomic::AtomicBool;

/// What is asked for.
///
/// ```
/// use softplug_conformance::certify::{Baseline, Order};
/// use std::path::Path;
///
/// let known = "[[expected]]\ncase = \"xon-xoff.tx.hold\"\nclass = \"diverged\"\nreason = \"Slow.\"";
/// let baseline = Some(Baseline::parse(Path::new("known.toml"), known)?);
/// let order = Order { strict: true, baseline, ..Order::new("xon-xoff") };
/// assert!(order.cases.is_empty() && order.threads > 0);
/// # Ok::<(), softplug_conformance::FileError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Order {
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
    /// Changes where random cuts fall.
    pub cut_seed: u64,
    /// Runs the cases in another order. The report does not depend on it.
    pub shuffle: Option<u64>,
}

impl Order {
    /// The whole newest revision of a profile, on all processors.
    pub fn new(profile: impl Into<String>) -> Self {
        Self {
            profile: profile.into(),
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
/// The example of [`certify()`] shows it.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Progress {
    /// Cases that are over.
    pub done: usize,
    /// Cases that are run in all.
    pub cases: usize,
    /// Cases of which a run failed.
    pub failed: usize,
}

/// There is no report.
///
/// ```
/// use softplug_conformance::Corpus;
/// use softplug_conformance::certify::{CertifyError, Order, certify};
/// use std::sync::atomic::AtomicBool;
///
/// let (corpus, order) = (Corpus::embedded(), Order::new("xon"));
/// let error = certify(b"", &corpus, &order, &|_| {}, &AtomicBool::new(false)).unwrap_err();
/// assert!(matches!(&error, CertifyError::UnknownProfile { name, .. } if name == "xon"));
/// assert!(error.to_string().starts_with("there is no profile \"xon\"; there are 3964, abi,"));
/// ```
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CertifyError {
    /// The corpus has no such profile.
    #[error("there is no profile \"{name}\"; there are {known}")]
    UnknownProfile {
        /// The name.
        name: String,
        /// All that there are.
        known: String,
    },
    /// The profile has no such revision.
    #[error("the profile \"{profile}\" has no revision {revision}; the newest is {newest}")]
    UnknownRevision {
        /// The profile.
        profile: String,
        /// The revision.
        revision: u32,
        /// The newest.
        newest: u32,
    },
    /// No case fits the patterns.
    #[error(
        "no case of the profile \"{profile}\" is selected; `softplug cases --profile {profile}` lists them"
    )]
    NothingSelected {
        /// The profile.
        profile: String,
    },
    /// A case of the profile cites what its ledger does not have.
    #[error(
        "{case}: the ledger has no clause \"{clause}\"; `softplug cases --lint` lists all that is wrong with the corpus"
    )]
    UnknownClause {
        /// The case.
        case: String,
        /// The clause.
        clause: String,
    },
    /// The two engines show different things: a fault of the suite or of an engine.
    #[error(
        "{case}: the engines {first} and {second} do different things; this is no fault of the plug-in, report it"
    )]
    EnginesDiffer {
        /// The case.
        case: String,
        /// One engine.
        first: String,
        /// The other.
        second: String,
    },
    /// The suite failed.
    #[error("the suite failed, which is no fault of the plug-in: {0}")]
    Internal(String),
}

/// Judges a module by a profile. `progress` is told after each case; a `stop` that becomes
/// true ends the run, and the report says so. The report depends on module, corpus, profile,
/// revision, `strict`, patterns and baseline alone.
///
/// ```
/// use softplug_conformance::Corpus;
/// use softplug_conformance::certify::{Order, Progress, certify};
/// use std::sync::Mutex;
/// use std::sync::atomic::AtomicBool;
///
/// # let module = wat::parse_file("../../fixtures/abi/echo.wat")?;
/// let order = Order { cases: vec!["abi.settings.*".to_owned()], ..Order::new("abi") };
/// let last = Mutex::new(None);
/// let progress = |so_far: Progress| {
///     *last.lock().unwrap() = Some((so_far.cases, so_far.failed));
/// };
/// let report =
///     certify(&module, &Corpus::embedded(), &order, &progress, &AtomicBool::new(false))?;
/// // All that was asked for has passed, but not all of the profile was asked for.
/// assert_eq!(report.verdict.text(), "partial");
/// assert_eq!(*last.lock().unwrap(), Some((report.counts.executed as usize, 0)));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// There is nothing to report on; see [`CertifyError`]. A module that is no plug-in gives a
/// report with the verdict `not-judged`.
pub fn certify(
    module: &[u8],
    corpus: &Corpus,
    order: &Order,
    progress: &(dyn Fn(Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Report, CertifyError> {
    let engines = Engines::new()?;
    let judged = engines.load(module);
    let plan = Plan::new(corpus, order, judged.manifest())?;
    let mut unfit = judged.unfit();
    if unfit.is_empty() {
        unfit = plan.unfit(judged.manifest());
    }
    let ran = match judged.subjects() {
        Some(subjects) if unfit.is_empty() => execute::run(&plan, subjects, order, progress, stop)?,
        _ => plan.cases.iter().map(|_| None).collect(),
    };
    let (engines, judged, plan) = (&engines, &judged, &plan);
    Ok(Results { module, corpus, order, engines, judged, plan, unfit, ran }.report())
}
