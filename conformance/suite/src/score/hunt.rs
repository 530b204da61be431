//! Runs changed modules until a run fails.

use super::crossings::Crossings;
use super::effects::Effects;
use super::options::{ScoreError, ScoreOptions};
use crate::certify::reach::{Extent, Run, each_run};
use crate::certify::shuffled;
use crate::corpus::{Corpus, Listed, Source};
use crate::judge::run::{Judge, Start};
use crate::module::change::{Change, Changeable};
use crate::module::executed::{Executed, MEASURING_FUEL, Places, Watcher};
use crate::random::Sessions;
use crate::run::subject::Sandboxed;
use softplug_abi::limits::FUEL_PER_EVENT;
use softplug_host::{EngineKind, Host, HostOptions, Inspection, lint};
use softplug_report::{Score, Shown, Survivor};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// Runs of a changed module that are made before it is compiled.
const QUICK: usize = 40;

/// Changes a module, one instruction at a time, and says which changes the cases,
/// permutations and random sessions of its profiles notice. `progress` is told how
/// many of how many are over; a `stop` that becomes true ends it.
///
/// ```no_run
/// use softplug_conformance::Corpus;
/// use softplug_conformance::score::{ScoreOptions, score};
///
/// let module = std::fs::read("xon-xoff.wasm")?;
/// let stop = std::sync::atomic::AtomicBool::new(false);
/// let score = score(&module, &Corpus::embedded(), &ScoreOptions::default(), &|_, _| {}, &stop)?;
/// println!("{} of {} noticed by cases", score.noticed.cases, score.tried);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The module is no plug-in, claims no profile, or fails unchanged.
pub fn score(
    module: &[u8],
    corpus: &Corpus,
    options: &ScoreOptions,
    progress: &(dyn Fn(usize, usize) + Sync),
    stop: &AtomicBool,
) -> Result<Score, ScoreError> {
    let unfit = |error: &dyn std::fmt::Display| ScoreError::Module(error.to_string());
    let inspection = lint(module).map_err(|error| unfit(&error))?;
    let changeable = Changeable::new(module).map_err(|error| unfit(&error))?;
    let hunter = Hunter::new(module, corpus, &inspection, options, stop)?;
    let mut hunter = hunter.ok_or(ScoreError::Stopped)?;
    let sound = loaded(&hunter.compiled, module).ok_or_else(|| unfit(&"not loaded"))?;
    hunter.hold(&sound, options.threads, stop)?;
    let tried = draw(changeable.changes(), options);
    let (next, done) = (AtomicUsize::new(0), AtomicUsize::new(0));
    let total = Mutex::new(Score {
        seed: options.seed,
        sessions: options.sessions,
        changes: changeable.changes().len() as u32,
        tried: tried.len() as u32,
        ..Score::default()
    });
    thread::scope(|scope| {
        for _ in 0..options.threads.clamp(1, tried.len().max(1)) {
            scope.spawn(|| {
                while let Some(change) = tried.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let is_over = || stop.load(Ordering::Relaxed);
                    let Ok(fate) = hunter.fate(&changeable, change, &is_over) else { return };
                    if let Ok(mut total) = total.lock() {
                        add(&mut total, change, &fate);
                    }
                    progress(done.fetch_add(1, Ordering::Relaxed) + 1, tried.len());
                }
            });
        }
    });
    if stop.load(Ordering::Relaxed) {
        return Err(ScoreError::Stopped);
    }
    let mut total = total.into_inner().unwrap_or_default();
    total.survivors.sort();
    Ok(total)
}

/// All changes, or some of them in the order of the module.
fn draw<'a>(changes: &'a [Change], options: &ScoreOptions) -> Vec<&'a Change> {
    let sample = options.sample.map_or(changes.len(), |sample| sample as usize);
    let mut places = shuffled((0..changes.len()).collect(), options.seed);
    places.truncate(sample);
    places.sort_unstable();
    places.into_iter().map(|place| &changes[place]).collect()
}

/// What a change came to.
enum Fate {
    Invalid,
    Noticed(By),
    Survived(Shown),
}

/// What notices a change.
#[derive(Copy, Clone)]
enum By {
    Lint,
    Cases,
    Permutations,
    Sessions,
}

fn add(score: &mut Score, change: &Change, fate: &Fate) {
    let count = match fate {
        Fate::Invalid => &mut score.invalid,
        Fate::Noticed(By::Lint) => &mut score.noticed.lint,
        Fate::Noticed(By::Cases) => &mut score.noticed.cases,
        Fate::Noticed(By::Permutations) => &mut score.noticed.permutations,
        Fate::Noticed(By::Sessions) => &mut score.noticed.sessions,
        Fate::Survived(shown) => {
            let Change { function, at, what, .. } = change.clone();
            let survivor = Survivor { function, at: at as u64, change: what, shown: *shown };
            return score.survivors.push(survivor);
        }
    };
    *count += 1;
}

/// The runs by which changes are hunted.
struct Hunter<'a> {
    runs: Vec<Reaching<'a>>,
    crossings: Crossings<'a>,
    places: Places,
    seed: u64,
    permutations: usize,
    features: BTreeMap<&'a str, Vec<String>>,
    compiled: Host,
    interpreted: Host,
}

/// A run, and what it executes of the module as it is.
struct Reaching<'a> {
    case: Listed<'a>,
    run: Run,
    executed: Executed,
    /// Of the module as it is.
    effects: Option<Effects>,
}

/// What came of a run.
struct Ended {
    is_failed: bool,
    /// Permutations are compared with their case already.
    effects: Option<Effects>,
}

/// What came of some runs of a changed module.
enum Hunted<'r> {
    Failed(&'r Reaching<'r>),
    /// Whether any showed something else than the module as it is.
    Passed {
        is_different: bool,
    },
}

impl<'a> Hunter<'a> {
    /// Runs everything once. None: it was stopped.
    fn new(
        module: &[u8],
        corpus: &'a Corpus,
        inspection: &Inspection,
        options: &ScoreOptions,
        stop: &AtomicBool,
    ) -> Result<Option<Self>, ScoreError> {
        let unfit = |error: &dyn std::fmt::Display| ScoreError::Module(error.to_string());
        let host = |engine, fuel_per_event| {
            Host::new(HostOptions { engine, fuel_per_event, ..HostOptions::default() })
                .map_err(|error| unfit(&error))
        };
        let mut features = BTreeMap::new();
        for ledger in &corpus.ledgers {
            let claim =
                inspection.manifest.profiles.iter().find(|claim| claim.name == ledger.profile);
            if let Some(claim) = claim {
                features.insert(ledger.profile.as_str(), claim.features.clone());
            }
        }
        if features.is_empty() {
            return Err(ScoreError::NoProfile);
        }
        let counts = |case: &Listed<'_>| {
            let ledger = corpus.ledger(case.profile)?;
            let claimed = features.get(case.profile)?;
            let needed = ledger.features_of(case.clauses);
            Some(needed.iter().all(|feature| claimed.iter().any(|own| own == feature)))
        };
        let listed = corpus.list().into_iter();
        let cases: Vec<_> = listed.filter(|case| counts(case) == Some(true)).collect();
        let places = Places::of(module).map_err(|error| unfit(&error))?;
        let measuring = host(EngineKind::Wasmtime, MEASURING_FUEL)?;
        let watcher =
            places.watch(&measuring, module, inspection).map_err(|error| unfit(&error))?;
        let sessions = Sessions { count: options.sessions, seed: options.seed };
        let extent = if options.permutations == 0 { Extent::Uncut } else { Extent::Whole };
        let threads = options.threads;
        let Some(runs) = reaching(&watcher, &cases, extent, sessions, threads, stop) else {
            return Ok(None);
        };
        let Some(crossings) = Crossings::new(&watcher, &cases, options, stop) else {
            return Ok(None);
        };
        let compiled = host(EngineKind::Wasmtime, FUEL_PER_EVENT)?;
        let interpreted = host(EngineKind::Wasmi, FUEL_PER_EVENT)?;
        let ScoreOptions { seed, permutations, .. } = *options;
        Ok(Some(Self {
            runs,
            crossings,
            places,
            seed,
            permutations,
            features,
            compiled,
            interpreted,
        }))
    }

    fn fate(
        &self,
        changeable: &Changeable<'_>,
        change: &Change,
        is_over: &dyn Fn() -> bool,
    ) -> Result<Fate, ScoreError> {
        let Some(module) = changeable.apply(change) else { return Ok(Fate::Invalid) };
        let reaches =
            |executed: &Executed| self.places.is_executed(executed, change.function, change.at);
        let (mut runs, permutations): (Vec<_>, Vec<_>) = self
            .runs
            .iter()
            .filter(|reaching| reaches(&reaching.executed))
            .partition(|reaching| !matches!(reaching.run, Run::Permutation(_)));
        let every = permutations.len().div_ceil(self.permutations.max(1)).max(1);
        runs.extend(permutations.into_iter().step_by(every));
        if runs.is_empty() {
            return Ok(Fate::Survived(Shown::NotExecuted));
        }
        // Most changes show in the first runs: compiling would cost more than all of these.
        let Some(quick) = loaded(&self.interpreted, &module) else {
            return Ok(Fate::Noticed(By::Lint));
        };
        let (first, others) = runs.split_at(runs.len().min(QUICK));
        let was_different = match self.hunted(&quick, first, is_over)? {
            Hunted::Failed(failing) => return Ok(Fate::Noticed(failing.run.by())),
            Hunted::Passed { is_different } => is_different,
        };
        let Some(compiled) = loaded(&self.compiled, &module) else {
            return Ok(Fate::Noticed(By::Lint));
        };
        Ok(match self.hunted(&compiled, others, is_over)? {
            Hunted::Failed(failing) => Fate::Noticed(failing.run.by()),
            Hunted::Passed { is_different } if was_different || is_different => {
                Fate::Survived(Shown::Different)
            }
            Hunted::Passed { .. } if self.crossings.tell(&compiled, &reaches, is_over)? => {
                Fate::Survived(Shown::Different)
            }
            Hunted::Passed { .. } => Fate::Survived(Shown::Same),
        })
    }

    /// Runs the module as it is, which has to pass, and holds what it shows.
    fn hold(
        &mut self,
        sound: &Sandboxed,
        threads: usize,
        stop: &AtomicBool,
    ) -> Result<(), ScoreError> {
        let mut runs = std::mem::take(&mut self.runs);
        let own = &*self;
        let part = runs.len().div_ceil(threads.max(1)).max(1);
        let held = |part: &mut [Reaching<'_>]| {
            let mut uncut = None;
            for reaching in part {
                if stop.load(Ordering::Relaxed) {
                    return Err(ScoreError::Stopped);
                }
                let Ended { is_failed, effects } = own.ended(sound, reaching, &mut uncut);
                if is_failed {
                    return Err(ScoreError::Fails { run: reaching.to_string() });
                }
                reaching.effects = effects;
            }
            Ok(())
        };
        let held = thread::scope(|scope| {
            let held = &held;
            let parts: Vec<_> =
                runs.chunks_mut(part).map(|part| scope.spawn(move || held(part))).collect();
            parts.into_iter().try_for_each(|part| part.join().unwrap_or(Err(ScoreError::Stopped)))
        });
        self.runs = runs;
        held
    }

    /// Runs a changed module until a run fails.
    fn hunted<'r>(
        &self,
        subject: &Sandboxed,
        runs: &[&'r Reaching<'r>],
        is_over: &dyn Fn() -> bool,
    ) -> Result<Hunted<'r>, ScoreError> {
        let mut uncut = None;
        let mut is_different = false;
        for reaching in runs {
            if is_over() {
                return Err(ScoreError::Stopped);
            }
            let Ended { is_failed, effects } = self.ended(subject, reaching, &mut uncut);
            if is_failed {
                return Ok(Hunted::Failed(reaching));
            }
            is_different |= effects != reaching.effects;
        }
        Ok(Hunted::Passed { is_different })
    }

    /// Permutations are compared with the uncut run, which is kept for those that follow.
    fn ended<'c, 's>(
        &self,
        subject: &'s Sandboxed,
        reaching: &Reaching<'c>,
        uncut: &mut Option<(&'c str, Start<'s>)>,
    ) -> Ended
    where
        'c: 's,
    {
        match (reaching.case.source, &reaching.run) {
            (Source::Trace(case), Run::Case) => {
                let start = Start::new(subject, case);
                let effects = Some(Effects::of(&start.uncut.seen));
                Ended { is_failed: start.failure.is_some(), effects }
            }
            (Source::Trace(case), Run::Permutation(permutation)) => {
                let id = reaching.case.id;
                let kept = uncut.take().filter(|(kept, _)| *kept == id);
                let (_, start) =
                    uncut.insert(kept.unwrap_or_else(|| (id, Start::new(subject, case))));
                Ended { is_failed: start.judge(permutation, 0).is_some(), effects: None }
            }
            (Source::Script(script), _) => {
                let run = Judge::run_script(subject, script);
                let effects = Some(Effects::of(&run.log));
                Ended { is_failed: run.failure.is_some(), effects }
            }
            (Source::Sessions(group), Run::Session(number)) => {
                let features = &self.features[reaching.case.profile];
                match group.session(subject, self.seed, *number) {
                    Some(run) => {
                        let effects = Some(Effects::of(run.seen()));
                        Ended { is_failed: group.is_failed(&run, features), effects }
                    }
                    None => Ended { is_failed: false, effects: None },
                }
            }
            (Source::Sessions(_), _) | (Source::Trace(_), Run::Session(_)) => {
                Ended { is_failed: false, effects: None }
            }
        }
    }
}

impl std::fmt::Display for Reaching<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let id = self.case.id;
        match &self.run {
            Run::Case => write!(f, "{id}"),
            Run::Permutation(permutation) => write!(f, "{id}/{permutation}"),
            Run::Session(number) => write!(f, "{id}/{number}"),
        }
    }
}

impl Run {
    fn by(&self) -> By {
        match self {
            Self::Case => By::Cases,
            Self::Permutation(_) => By::Permutations,
            Self::Session(_) => By::Sessions,
        }
    }
}

fn loaded(host: &Host, module: &[u8]) -> Option<Sandboxed> {
    host.load_bytes(module).ok().map(Sandboxed::new)
}

/// Every run with what it executes: cases first, then sessions, then permutations, each in the
/// order of the corpus. None: it was stopped.
fn reaching<'a>(
    watcher: &Watcher,
    cases: &[Listed<'a>],
    extent: Extent,
    sessions: Sessions,
    threads: usize,
    stop: &AtomicBool,
) -> Option<Vec<Reaching<'a>>> {
    let next = AtomicUsize::new(0);
    let all = Mutex::new(Vec::new());
    let is_over = || stop.load(Ordering::Relaxed);
    thread::scope(|scope| {
        for _ in 0..threads.clamp(1, cases.len().max(1)) {
            scope.spawn(|| {
                let watcher = watcher.another();
                let mut own = Vec::new();
                while !is_over() {
                    let number = next.fetch_add(1, Ordering::Relaxed);
                    let Some(case) = cases.get(number) else { break };
                    let mut place = 0;
                    each_run(&watcher, case, extent, sessions, &is_over, &mut |run, executed| {
                        let rank = match run {
                            Run::Case => 0,
                            Run::Session(_) => 1,
                            Run::Permutation(_) => 2,
                        };
                        place += 1;
                        own.push(((rank, number, place), run, executed));
                    });
                }
                if let Ok(mut all) = all.lock() {
                    all.extend(own);
                }
            });
        }
    });
    let mut all = all.into_inner().ok().filter(|_| !is_over())?;
    all.sort_unstable_by_key(|(place, ..)| *place);
    let reaching = |((_, number, _), run, executed): ((_, usize, _), _, _)| Reaching {
        case: cases[number],
        run,
        executed,
        effects: None,
    };
    Some(all.into_iter().map(reaching).collect())
}
