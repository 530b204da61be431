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
use serde::Serialize;
use softplug_abi::manifest::Manifest;
use softplug_host::{EngineKind, Host, HostOptions, lint};
use std::collections::BTreeMap;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
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

/// What became of a module's changes.
///
/// The example of [`score`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Score {
    /// Changes that there are.
    pub changes: u32,
    /// Those that were tried.
    pub tried: u32,
    /// Those that make no valid module.
    pub invalid: u32,
    /// Those that were noticed, by what noticed them first.
    pub noticed: BTreeMap<Noticed, u32>,
    /// Those that nothing showed.
    pub survivors: Vec<Survivor>,
}

/// What notices a change.
#[derive(Copy, Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Noticed {
    /// The module is refused.
    Lint,
    /// A case as it is written, or a script.
    Cases,
    /// A permutation of a case.
    Permutations,
    /// A random session.
    Sessions,
}

/// A change that nothing showed.
#[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize)]
pub struct Survivor {
    /// The function's number in the module.
    pub function: u32,
    /// The instruction's place in the file.
    pub at: usize,
    /// What was changed.
    pub change: String,
}

/// A module that cannot be scored.
///
/// ```
/// use softplug_conformance::Corpus;
/// use softplug_conformance::score::{ScoreError, ScoreOptions, score};
///
/// let error = score(b"no module", &Corpus::embedded(), &ScoreOptions::default(), &|_, _| {});
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
}

/// Changes a module, one instruction at a time, and says which changes the cases,
/// permutations and random sessions of its profiles notice. `progress` is told how
/// many of how many are over.
///
/// ```no_run
/// use softplug_conformance::Corpus;
/// use softplug_conformance::score::{Noticed, ScoreOptions, score};
///
/// let module = std::fs::read("xon-xoff.wasm")?;
/// let score = score(&module, &Corpus::embedded(), &ScoreOptions::default(), &|_, _| {})?;
/// println!("{} of {} noticed by cases", score.noticed[&Noticed::Cases], score.tried);
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
        changes: changeable.changes().len() as u32,
        tried: tried.len() as u32,
        ..Score::default()
    });
    thread::scope(|scope| {
        for _ in 0..options.threads.clamp(1, tried.len().max(1)) {
            scope.spawn(|| {
                while let Some(change) = tried.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let fate = hunter.fate(&changeable, change);
                    if let Ok(mut total) = total.lock() {
                        total.add(change, fate);
                    }
                    progress(done.fetch_add(1, Ordering::Relaxed) + 1, tried.len());
                }
            });
        }
    });
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
    Noticed(Noticed),
    Survived,
}

impl Score {
    fn add(&mut self, change: &Change, fate: Fate) {
        match fate {
            Fate::Invalid => self.invalid += 1,
            Fate::Noticed(by) => *self.noticed.entry(by).or_default() += 1,
            Fate::Survived => self.survivors.push(Survivor {
                function: change.function,
                at: change.at,
                change: change.what.clone(),
            }),
        }
    }
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
            return Fate::Noticed(Noticed::Lint);
        };
        if self.failing_case(&quick).is_some() {
            return Fate::Noticed(Noticed::Cases);
        }
        let Some(compiled) = self.load(EngineKind::Wasmtime, &module) else {
            return Fate::Noticed(Noticed::Lint);
        };
        match self.first_failure(&compiled) {
            Some((by, _)) => Fate::Noticed(by),
            None => Fate::Survived,
        }
    }

    fn first_failure(&self, subject: &Sandboxed) -> Option<(Noticed, String)> {
        let case = || Some((Noticed::Cases, self.failing_case(subject)?));
        let permutation = || Some((Noticed::Permutations, self.failing_permutation(subject)?));
        let session = || Some((Noticed::Sessions, self.failing_session(subject)?));
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
