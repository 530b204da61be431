//! What of the module is executed by all runs of the profiles that it claims.

use super::engines::Loaded;
use super::error::CertifyError;
use super::options::{CertifyOptions, Progress};
use super::plan::{ABI, Fate, Plan};
use super::reach::{Extent, each_run};
use crate::corpus::{Corpus, Listed};
use crate::module::executed::{Executed, MEASURING_FUEL, MeasureError, Places};
use crate::random::Sessions;
use softplug_abi::manifest::Manifest;
use softplug_host::{EngineKind, Host, HostOptions};
use softplug_report::Coverage;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// Random sessions of each other profile that the plug-in claims. What its own verdict runs
/// is run again whole: only so is it true that nothing executed a place.
const OTHERS: u32 = 200;

/// What is known of it.
pub(super) enum Measured {
    Known(Coverage),
    /// It was ended before.
    Stopped,
    /// The marked module does not load: marks make it larger.
    Unknown,
}

pub(super) fn coverage(
    loaded: &Loaded<'_>,
    corpus: &Corpus,
    options: &CertifyOptions,
    progress: &(dyn Fn(Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Measured, CertifyError> {
    let internal = |error: &dyn std::fmt::Display| CertifyError::Internal(error.to_string());
    let module = loaded.module;
    let Some(inspection) = loaded.inspection() else { return Ok(Measured::Unknown) };
    let measuring = HostOptions {
        engine: EngineKind::Wasmtime,
        fuel_per_event: MEASURING_FUEL,
        ..HostOptions::default()
    };
    let host = Host::new(measuring).map_err(|error| internal(&error))?;
    let places = Places::of(module).map_err(|error| internal(&error))?;
    let watcher = match places.watch(&host, module, inspection) {
        Ok(watcher) => watcher,
        Err(MeasureError::Host(_)) => return Ok(Measured::Unknown),
        Err(error) => return Err(internal(&error)),
    };
    let work = work(corpus, options, &inspection.manifest)?;
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let executed = Mutex::new(Executed::default());
    thread::scope(|scope| {
        for _ in 0..options.threads.clamp(1, work.len().max(1)) {
            scope.spawn(|| {
                let watcher = watcher.another();
                let mut own = Executed::default();
                let is_over = || stop.load(Ordering::Relaxed);
                while let Some((listed, extent, sessions)) =
                    work.get(next.fetch_add(1, Ordering::Relaxed))
                {
                    let mut add = |_, executed| own.add(&executed);
                    if is_over()
                        || !each_run(&watcher, listed, *extent, *sessions, &is_over, &mut add)
                    {
                        break;
                    }
                    let done = done.fetch_add(1, Ordering::Relaxed) + 1;
                    progress(Progress { done, cases: work.len(), failed: 0 });
                }
                if let Ok(mut executed) = executed.lock() {
                    executed.add(&own);
                }
            });
        }
    });
    if done.into_inner() < work.len() {
        return Ok(Measured::Stopped);
    }
    let executed = executed.into_inner().unwrap_or_default();
    Ok(Measured::Known(places.coverage(module, executed.words())))
}

/// The profile's own runs whole, of the other profiles that the plug-in is held to the cases as
/// they are written and the sessions.
fn work<'a>(
    corpus: &'a Corpus,
    options: &CertifyOptions,
    manifest: &Manifest,
) -> Result<Vec<(Listed<'a>, Extent, Sessions)>, CertifyError> {
    let claims = manifest.profiles.iter().map(|claim| claim.name.as_str());
    let mut profiles: Vec<&str> = claims.chain([ABI]).collect();
    profiles.retain(|name| *name != options.profile && corpus.ledger(name).is_some());
    let mut work = Vec::new();
    let mut add = |plan: Plan<'a>, extent, sessions| {
        let runs = plan
            .cases
            .into_iter()
            .filter(|planned| matches!(planned.fate, Fate::Runs | Fate::Filtered));
        work.extend(runs.map(|planned| (planned.case, extent, sessions)));
    };
    add(Plan::new(corpus, options, Some(manifest))?, Extent::Whole, options.sessions);
    for profile in profiles {
        let other = CertifyOptions::new(profile);
        let sessions = Sessions { count: other.sessions.count.min(OTHERS), ..other.sessions };
        // A corpus may have a profile's ledger and none of its cases.
        match Plan::new(corpus, &other, Some(manifest)) {
            Ok(plan) => add(plan, Extent::Uncut, sessions),
            Err(CertifyError::NothingSelected { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    Ok(work)
}
