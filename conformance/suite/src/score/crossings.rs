//! Whether a change that nothing noticed can be told at all: by runs of crossed traces.

use super::crossed::Stock;
use super::effects::Effects;
use super::options::{ScoreError, ScoreOptions};
use crate::corpus::{Listed, Source};
use crate::module::executed::{Executed, Watcher};
use crate::run::outcome::Outcome;
use crate::run::permute::Permutation;
use crate::run::replay::run;
use crate::run::subject::{Sandboxed, Subject};
use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread;

/// Runs between two looks at how much fuel they took.
const BATCH: u64 = 32;

/// What a run may take in the mean.
const FUEL: u64 = 20_000_000;

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

    /// Where the module as it is faults, nothing is said of a change. A plug-in that computes very
    /// much is crossed less often: how often depends on its fuel, not on the computer.
    fn first_runs(
        &self,
        watcher: &Watcher,
        options: &ScoreOptions,
        stop: &AtomicBool,
    ) -> Option<Vec<Crossing>> {
        let count = u64::from(options.crossed);
        let mut all = Vec::new();
        for stock in 0..self.stocks.len() {
            let (mut next, mut fuel) = (0, 0);
            while next < count && fuel < count.saturating_mul(FUEL) {
                let batch = next..count.min(next + BATCH);
                next = batch.end;
                for (crossing, used) in self.batch(watcher, stock, batch, options.threads, stop)? {
                    fuel = used.saturating_add(fuel);
                    all.extend(crossing);
                }
            }
        }
        Some(all)
    }

    /// Runs some of a stock, with the fuel of each. None: it was stopped.
    fn batch(
        &self,
        watcher: &Watcher,
        stock: usize,
        numbers: Range<u64>,
        threads: usize,
        stop: &AtomicBool,
    ) -> Option<Vec<(Option<Crossing>, u64)>> {
        let next = AtomicU64::new(numbers.start);
        let all = Mutex::new(Vec::new());
        let is_over = || stop.load(Ordering::Relaxed);
        thread::scope(|scope| {
            for _ in 0..threads.max(1) {
                scope.spawn(|| {
                    let watcher = watcher.another();
                    while !is_over() {
                        let number = next.fetch_add(1, Ordering::Relaxed);
                        if !numbers.contains(&number) {
                            break;
                        }
                        let outcome = self.run(&watcher, stock, number);
                        let executed = watcher.take();
                        let crossing = effects(&outcome).map(|effects| Crossing {
                            stock,
                            number,
                            executed,
                            effects,
                        });
                        if let Ok(mut all) = all.lock() {
                            all.push((number, (crossing, outcome.fuel.total)));
                        }
                    }
                });
            }
        });
        let mut all = all.into_inner().ok().filter(|_| !is_over())?;
        all.sort_unstable_by_key(|(number, _)| *number);
        Some(all.into_iter().map(|(_, ran)| ran).collect())
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
            let outcome = self.run(changed, crossing.stock, crossing.number);
            if effects(&outcome) != Some(crossing.effects) {
                return Ok(true);
            }
        }
        Ok(false)
    }

    fn run<S: Subject>(&self, subject: &S, stock: usize, number: u64) -> Outcome {
        let crossed = self.stocks[stock].crossed(self.seed, number);
        run(subject, crossed, &Permutation::Uncut)
    }
}

/// None: it faults.
fn effects(outcome: &Outcome) -> Option<Effects> {
    outcome.fault.is_none().then(|| Effects::of(&outcome.seen))
}
