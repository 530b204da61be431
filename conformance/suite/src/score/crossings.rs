//! Whether a change that nothing noticed can be told at all: by runs of crossed traces.

use super::crossed::Stock;
use super::effects::Effects;
use super::hunt::{ScoreError, ScoreOptions};
use crate::corpus::{Listed, Source};
use crate::module::executed::{Executed, Watcher};
use crate::run::permute::Permutation;
use crate::run::replay::run;
use crate::run::subject::{Sandboxed, Subject};
use std::collections::BTreeSet;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// Runs of crossed traces, with what the module as it is showed in each.
pub(super) struct Crossings<'a> {
    stocks: Vec<Stock<'a>>,
    seed: u64,
    runs: Vec<Crossing>,
}

struct Crossing {
    stock: usize,
    number: u64,
    executed: Executed,
    effects: Effects,
}

impl<'a> Crossings<'a> {
    /// Runs them once. None: it was stopped.
    pub(super) fn new(
        watcher: &Watcher,
        cases: &[Listed<'a>],
        options: &ScoreOptions,
        stop: &AtomicBool,
    ) -> Option<Self> {
        let profiles: BTreeSet<&str> = cases.iter().map(|case| case.profile).collect();
        let of_profile = |profile: &'a str| {
            let cases = cases.iter().filter(|case| case.profile == profile);
            let traces = cases.filter_map(|case| match case.source {
                Source::Trace(case) => Some(case),
                _ => None,
            });
            Stock::new(profile, traces, watcher.manifest())
        };
        let stocks: Vec<Stock<'a>> = profiles.into_iter().filter_map(of_profile).collect();
        let mut crossings = Self { stocks, seed: options.seed, runs: Vec::new() };
        crossings.runs = crossings.first_runs(watcher, options, stop)?;
        Some(crossings)
    }

    /// What faults of the module as it is says nothing of a change.
    fn first_runs(
        &self,
        watcher: &Watcher,
        options: &ScoreOptions,
        stop: &AtomicBool,
    ) -> Option<Vec<Crossing>> {
        let count = options.crossed as usize;
        let next = AtomicUsize::new(0);
        let all = Mutex::new(Vec::new());
        let is_over = || stop.load(Ordering::Relaxed);
        thread::scope(|scope| {
            for _ in 0..options.threads.max(1) {
                scope.spawn(|| {
                    let watcher = watcher.another();
                    while !is_over() {
                        let place = next.fetch_add(1, Ordering::Relaxed);
                        if place >= count * self.stocks.len() {
                            break;
                        }
                        let (stock, number) = (place / count, (place % count) as u64);
                        let effects = self.effects(&watcher, stock, number);
                        let executed = watcher.take();
                        if let (Some(effects), Ok(mut all)) = (effects, all.lock()) {
                            all.push(Crossing { stock, number, executed, effects });
                        }
                    }
                });
            }
        });
        let mut all = all.into_inner().ok().filter(|_| !is_over())?;
        all.sort_unstable_by_key(|crossing| (crossing.stock, crossing.number));
        Some(all)
    }

    /// Whether a changed module shows something else in any run that reaches the change.
    pub(super) fn tell(
        &self,
        changed: &Sandboxed,
        reaches: &dyn Fn(&Executed) -> bool,
        is_over: &dyn Fn() -> bool,
    ) -> Result<bool, ScoreError> {
        for crossing in self.runs.iter().filter(|crossing| reaches(&crossing.executed)) {
            if is_over() {
                return Err(ScoreError::Stopped);
            }
            let effects = self.effects(changed, crossing.stock, crossing.number);
            if effects != Some(crossing.effects) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    /// None: it faults.
    fn effects<S: Subject>(&self, subject: &S, stock: usize, number: u64) -> Option<Effects> {
        let crossed = self.stocks[stock].crossed(self.seed, number);
        let outcome = run(subject, crossed, &Permutation::Uncut);
        outcome.fault.is_none().then(|| Effects::of(&outcome.seen))
    }
}
