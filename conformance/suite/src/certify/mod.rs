//! One certification: one plug-in, one profile, every case in every permutation.
//!
//! [`certify()`] has an example.

mod baseline;
mod coverage;
mod engines;
mod error;
mod execute;
mod glob;
mod observe;
mod options;
mod plan;
pub(crate) mod reach;
mod rows;

pub use baseline::{Baseline, BaselineError, Expected};
pub use engines::Loaded;
pub use error::CertifyError;
pub(crate) use execute::shuffled;
pub use glob::matches;
pub use observe::{ObservedRun, observe};
pub use options::{CertifyOptions, Progress};
pub use plan::ABI;

use crate::corpus::Corpus;
use coverage::{Measured, Measuring};
use plan::Plan;
use rows::Results;
use softplug_report::Report;
use std::sync::atomic::AtomicBool;

/// Judges a module by a profile. `progress` is told after each case; a `stop` that becomes
/// true ends the run, and the report says so. The report depends on module, corpus, profile,
/// revision, `strict`, patterns, baseline and sessions alone; what it says is executed also on
/// `cut_seed`.
///
/// ```
/// use softplug_conformance::Corpus;
/// use softplug_conformance::certify::{CertifyOptions, Loaded, Progress, certify};
/// use std::sync::Mutex;
/// use std::sync::atomic::AtomicBool;
///
/// # let module = wat::parse_file("../../fixtures/abi/echo.wat")?;
/// let options = CertifyOptions { cases: vec!["abi.settings.*".to_owned()], ..CertifyOptions::new("abi") };
/// let last = Mutex::new(None);
/// let progress = |so_far: Progress| {
///     *last.lock().unwrap() = Some((so_far.cases, so_far.failed));
/// };
/// let report =
///     certify(&Loaded::new(&module)?, &Corpus::embedded(), &options, &progress, &AtomicBool::new(false))?;
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
    loaded: &Loaded<'_>,
    corpus: &Corpus,
    options: &CertifyOptions,
    progress: &(dyn Fn(Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Report, CertifyError> {
    let plan = Plan::new(corpus, options, loaded.manifest())?;
    let mut unfit = loaded.unfit();
    if unfit.is_empty() {
        unfit = plan.unfit(loaded.manifest());
    }
    let mut measuring = None;
    let ran = match loaded.subjects() {
        Some(subjects) if unfit.is_empty() => {
            measuring = Measuring::new(loaded)?;
            let watched = measuring.as_mut().map(Measuring::watched);
            execute::run(&plan, loaded, subjects, watched, options, progress, stop)?
        }
        _ => plan.cases.iter().map(|_| None).collect(),
    };
    let plan = &plan;
    let mut results = Results { loaded, corpus, options, plan, unfit, ran, measured: None };
    if results.report().verdict.is_conformant() {
        results.measured = Some(match measuring {
            Some(measuring) => measuring.coverage(corpus, options, progress, stop)?,
            None => Measured::Unknown,
        });
    }
    Ok(results.report())
}
