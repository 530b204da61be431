//! Runs changed modules until a run fails.

use super::change::{Change, Changeable};
use crate::certify::CertifyOptions;
use crate::corpus::{Corpus, Listed, Source};
use crate::judge::run::{Judge, Start};
use crate::random::Sessions;
use crate::run::permute::Permutation;
use crate::run::subject::Sandboxed;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_abi::manifest::Manifest;
use softplug_host::{EngineKind, Host, HostOptions, lint};
use softplug_report::{Score, Survivor};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// What is asked for.
///
/// ```
/// use softplug_conformance::score::ScoreOptions;
///
/// let ScoreOptions { sample, seed, sessions, .. } = ScoreOptions::default();
/// assert_eq!((sample, seed, sessions), (Some(300), 1, 400));
/// ```
#[derive(Clone, Debug)]
pub struct ScoreOptions {
    /// So many changes, drawn at random; `None`: all of them.
    pub sample: Option<u32>,
    /// What they are drawn from.
    pub seed: u64,
    /// Random sessions of each profile.
    pub sessions: u32,
    /// Changes that are looked into at a time.
    pub threads: usize,
}

impl Default for ScoreOptions {
    fn default() -> Self {
        let threads = thread::available_parallelism().map_or(1, usize::from);
        Self { sample: Some(300), seed: 1, sessions: 400, threads }
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
    let manifest = lint(module).map_err(|error| unfit(&error))?.manifest;
    let changeable = Changeable::new(module).map_err(|error| unfit(&error))?;
    let hunter = Hunter::new(corpus, &manifest, options)?;
    let sound = hunter.load(EngineKind::Wasmtime, module).ok_or_else(|| unfit(&"not loaded"))?;
    if let Some((_, run)) = hunter.first_failure(&sound) {
        return Err(ScoreError::Fails { run });
    }
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
                    if stop.load(Ordering::Relaxed) {
                        return;
                    }
                    let fate = hunter.fate(&changeable, change);
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
    let mut random = ChaCha8Rng::seed_from_u64(options.seed);
    let mut places: Vec<usize> = (0..changes.len()).collect();
    for place in (1..places.len()).rev() {
        places.swap(place, (random.next_u64() % (place as u64 + 1)) as usize);
    }
    places.truncate(sample);
    places.sort_unstable();
    places.into_iter().map(|place| &changes[place]).collect()
}

/// What a change came to.
enum Fate {
    Invalid,
    Noticed(By),
    Survived { executed: bool },
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
        Fate::Survived { executed } => {
            let Change { function, at, what, .. } = change.clone();
            let survivor = Survivor { function, at: at as u64, change: what, executed: *executed };
            return score.survivors.push(survivor);
        }
    };
    *count += 1;
}

/// The runs by which changes are hunted.
struct Hunter<'a> {
    /// The profiles' cases that count for the plug-in.
    cases: Vec<Listed<'a>>,
    features: BTreeMap<&'a str, Vec<String>>,
    sessions: u32,
    compiled: Host,
    interpreted: Host,
}

impl<'a> Hunter<'a> {
    fn new(
        corpus: &'a Corpus,
        manifest: &Manifest,
        options: &ScoreOptions,
    ) -> Result<Self, ScoreError> {
        let host = |engine| {
            Host::new(HostOptions { engine, ..HostOptions::default() })
                .map_err(|error| ScoreError::Module(error.to_string()))
        };
        let mut features = BTreeMap::new();
        for ledger in &corpus.ledgers {
            let claim = manifest.profiles.iter().find(|claim| claim.name == ledger.profile);
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
        let cases: Vec<_> =
            corpus.list().into_iter().filter(|case| counts(case) == Some(true)).collect();
        let sessions = options.sessions;
        let (compiled, interpreted) = (host(EngineKind::Wasmtime)?, host(EngineKind::Wasmi)?);
        Ok(Self { cases, features, sessions, compiled, interpreted })
    }

    fn load(&self, engine: EngineKind, module: &[u8]) -> Option<Sandboxed> {
        let host = match engine {
            EngineKind::Wasmtime => &self.compiled,
            EngineKind::Wasmi => &self.interpreted,
        };
        host.load_bytes(module).ok().map(Sandboxed::new)
    }

    fn fate(&self, changeable: &Changeable<'_>, change: &Change) -> Fate {
        let Some(module) = changeable.apply(change) else { return Fate::Invalid };
        // Most changes show in the first cases: compiling would cost more than all of these.
        let Some(quick) = self.load(EngineKind::Wasmi, &module) else {
            return Fate::Noticed(By::Lint);
        };
        if self.failing_case(&quick).is_some() {
            return Fate::Noticed(By::Cases);
        }
        let Some(compiled) = self.load(EngineKind::Wasmtime, &module) else {
            return Fate::Noticed(By::Lint);
        };
        match self.first_failure(&compiled) {
            Some((by, _)) => Fate::Noticed(by),
            None => Fate::Survived { executed: self.is_executed(changeable, change) },
        }
    }

    /// Whether anything fails where the place traps.
    fn is_executed(&self, changeable: &Changeable<'_>, change: &Change) -> bool {
        let trapping = changeable.apply(&change.trapping());
        let trapping = trapping.and_then(|module| self.load(EngineKind::Wasmtime, &module));
        trapping.is_none_or(|subject| self.first_failure(&subject).is_some())
    }

    fn first_failure(&self, subject: &Sandboxed) -> Option<(By, String)> {
        let case = || Some((By::Cases, self.failing_case(subject)?));
        let permutation = || Some((By::Permutations, self.failing_permutation(subject)?));
        let session = || Some((By::Sessions, self.failing_session(subject)?));
        case().or_else(session).or_else(permutation)
    }

    fn failing_case(&self, subject: &Sandboxed) -> Option<String> {
        let fails = |case: &&Listed<'_>| match case.source {
            Source::Trace(trace) => Start::new(subject, trace).failure.is_some(),
            Source::Script(script) => Judge::run_script(subject, script).failure.is_some(),
            Source::Sessions(_) => false,
        };
        self.cases.iter().find(fails).map(|case| case.id.to_owned())
    }

    fn failing_permutation(&self, subject: &Sandboxed) -> Option<String> {
        self.cases.iter().find_map(|case| {
            let Source::Trace(trace) = case.source else { return None };
            let start = Start::new(subject, trace);
            let others = start.permutations().into_iter();
            let mut others = others.filter(|permutation| *permutation != Permutation::Uncut);
            let failing = others.find(|permutation| start.judge(permutation, 0).is_some())?;
            Some(format!("{}/{failing}", case.id))
        })
    }

    fn failing_session(&self, subject: &Sandboxed) -> Option<String> {
        self.cases.iter().find_map(|case| {
            let Source::Sessions(group) = case.source else { return None };
            let seed = CertifyOptions::new(case.profile).sessions.seed;
            let sessions = Sessions { count: self.sessions, seed };
            let features = &self.features[case.profile];
            let run = Judge::run_sessions(subject, group, sessions, features, &|| false)?;
            run.failures.first().map(|failed| format!("{}/{}", case.id, failed.number))
        })
    }
}
