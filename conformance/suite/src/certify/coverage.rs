//! What of the module is executed by all runs of the profiles that it claims.

use super::engines::Loaded;
use super::error::CertifyError;
use super::options::{CertifyOptions, Progress};
use super::plan::{ABI, Fate, Plan};
use super::reach::{Extent, each_run};
use crate::corpus::{Corpus, Listed};
use crate::module::executed::{Executed, MEASURING_FUEL, MeasureError, Places, Watcher};
use crate::random::Sessions;
use softplug_abi::manifest::Manifest;
use softplug_host::{EngineKind, Host, HostOptions};
use softplug_report::Coverage;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// Random sessions of each other profile that the plug-in claims.
const OTHERS: u32 = 200;

/// What is known of it.
pub(super) enum Measured {
    Known(Coverage),
    /// It was ended before.
    Stopped,
    /// The marked module does not load: marks make it larger.
    Unknown,
}

/// A module whose executed places are being found out.
pub(super) struct Measuring<'a> {
    module: &'a [u8],
    manifest: &'a Manifest,
    places: Places,
    watcher: Watcher,
    executed: Executed,
}

impl<'a> Measuring<'a> {
    /// None: the marked module does not load.
    pub(super) fn new(loaded: &'a Loaded<'a>) -> Result<Option<Self>, CertifyError> {
        let module = loaded.module;
        let Some(inspection) = loaded.inspection() else { return Ok(None) };
        let options = HostOptions {
            engine: EngineKind::Wasmtime,
            fuel_per_event: MEASURING_FUEL,
            ..HostOptions::default()
        };
        let host = Host::new(options).map_err(internal)?;
        let places = Places::of(module).map_err(internal)?;
        let watcher = match places.watch(&host, module, inspection) {
            Ok(watcher) => watcher,
            Err(MeasureError::Host(_)) => return Ok(None),
            Err(error) => return Err(internal(error)),
        };
        let manifest = &inspection.manifest;
        Ok(Some(Self { module, manifest, places, watcher, executed: Executed::default() }))
    }

    /// What watches the runs of the verdict, and where what they execute is added.
    pub(super) fn watched(&mut self) -> (&Watcher, &mut Executed) {
        (&self.watcher, &mut self.executed)
    }

    /// What the verdict's runs have executed, and what those of the other profiles do.
    pub(super) fn coverage(
        mut self,
        corpus: &Corpus,
        options: &CertifyOptions,
        progress: &(dyn Fn(Progress) + Sync),
        stop: &AtomicBool,
    ) -> Result<Measured, CertifyError> {
        let work = work(corpus, options, self.manifest)?;
        let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let executed = Mutex::new(&mut self.executed);
        thread::scope(|scope| {
            for _ in 0..options.threads.min(work.len()) {
                scope.spawn(|| {
                    let watcher = self.watcher.another();
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
        Ok(Measured::Known(self.places.coverage(self.module, self.executed.words())))
    }
}

fn internal(error: impl std::fmt::Display) -> CertifyError {
    CertifyError::Internal(error.to_string())
}

/// Of the other profiles that the plug-in is held to the cases as they are written and the
/// sessions.
fn work<'a>(
    corpus: &'a Corpus,
    options: &CertifyOptions,
    manifest: &Manifest,
) -> Result<Vec<(Listed<'a>, Extent, Sessions)>, CertifyError> {
    let claims = manifest.profiles.iter().map(|claim| claim.name.as_str());
    let mut profiles: Vec<&str> = claims.chain([ABI]).collect();
    profiles.retain(|name| *name != options.profile && corpus.ledger(name).is_some());
    let mut work = Vec::new();
    for profile in profiles {
        let other = CertifyOptions::new(profile);
        let sessions = Sessions { count: other.sessions.count.min(OTHERS), ..other.sessions };
        let plan = match Plan::new(corpus, &other, Some(manifest)) {
            Ok(plan) => plan,
            // A corpus may have a profile's ledger and none of its cases.
            Err(CertifyError::NothingSelected { .. }) => continue,
            Err(error) => return Err(error),
        };
        let runs = plan.cases.into_iter().filter(|planned| planned.fate == Fate::Runs);
        work.extend(runs.map(|planned| (planned.case, Extent::Uncut, sessions)));
    }
    Ok(work)
}
