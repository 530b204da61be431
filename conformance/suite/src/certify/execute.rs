//! Runs the cases of a plan, spread over threads.

use super::engines::{Loaded, Subjects, met_limit};
use super::error::CertifyError;
use super::options::{CertifyOptions, Progress};
use super::plan::{Fate, Plan};
use crate::corpus::{Listed, Source};
use crate::given::case::Case;
use crate::judge::divergence::Divergence;
use crate::judge::run::{Judge, Start, assess, pure};
use crate::judge::verdict::Failure;
use crate::module::covered::Covered;
use crate::module::executed::{Executed, Watcher};
use crate::random::{FailedSession, SessionGroup};
use crate::run::class::Class;
use crate::run::outcome::Outcome;
use crate::run::permute::Permutation;
use crate::run::subject::Fuel;
use crate::script::{Script, ScriptFailure, ScriptRun};
use data_encoding::HEXUPPER;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_report::{FAILURES, FailedRun};
use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread;

/// What came of a case, with all its permutations.
#[derive(Debug, Default)]
pub(super) struct Ran {
    pub(super) runs: u32,
    /// The first failed runs.
    pub(super) failures: Vec<FailedRun>,
    pub(super) failed_runs: u32,
    /// Kinds of all failed runs.
    pub(super) classes: BTreeSet<String>,
    /// Of the uncut run.
    pub(super) fuel: Fuel,
    pub(super) bytes: u64,
    /// What the digest holds of it.
    pub(super) pure: String,
}

/// One for each case of the plan; none for those that did not run to their end. What all of
/// them executed is added, where somebody watches it.
pub(super) fn run(
    plan: &Plan<'_>,
    loaded: &Loaded<'_>,
    subjects: &Subjects,
    watched: Option<(&Watcher, &mut Executed)>,
    options: &CertifyOptions,
    progress: &(dyn Fn(Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Vec<Option<Ran>>, CertifyError> {
    let (watcher, executed) = watched.unzip();
    let mut queue: Vec<usize> =
        (0..plan.cases.len()).filter(|number| plan.cases[*number].fate == Fate::Runs).collect();
    if let Some(seed) = options.shuffle {
        queue = shuffled(queue, seed);
    }
    let shared = Shared {
        plan,
        loaded,
        subjects,
        options,
        progress,
        stop,
        has_failed: AtomicBool::new(false),
        next: AtomicUsize::new(0),
        done: AtomicUsize::new(0),
        failed: AtomicUsize::new(0),
        queue,
    };
    let threads = options.threads.clamp(1, shared.queue.len().max(1));
    let covered = || Covered::new(&subjects.first, watcher.map(Watcher::another));
    let all_covered: Vec<Covered> = (0..threads).map(|_| covered()).collect();
    let finished = thread::scope(|scope| {
        let shared = &shared;
        let work = |covered| scope.spawn(move || shared.work(covered));
        let workers: Vec<_> = all_covered.iter().map(work).collect();
        workers.into_iter().map(thread::ScopedJoinHandle::join).collect::<Vec<_>>()
    });
    if let Some(executed) = executed {
        for covered in &all_covered {
            executed.add(&covered.take());
        }
    }
    let mut all: Vec<Option<Ran>> = plan.cases.iter().map(|_| None).collect();
    let mut errors = Vec::new();
    for worker in finished {
        let results = worker
            .map_err(|_| CertifyError::Internal("a case made it panic; see above".to_owned()))?;
        for (number, result) in results {
            match result {
                Ok(ran) => all[number] = ran,
                Err(error) => errors.push((number, error)),
            }
        }
    }
    match errors.into_iter().min_by_key(|(number, _)| *number) {
        Some((_, error)) => Err(error),
        None => Ok(all),
    }
}

/// In an order that the seed gives.
pub(crate) fn shuffled(mut numbers: Vec<usize>, seed: u64) -> Vec<usize> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for place in (1..numbers.len()).rev() {
        numbers.swap(place, (random.next_u64() % (place as u64 + 1)) as usize);
    }
    numbers
}

/// What the threads share.
struct Shared<'a> {
    plan: &'a Plan<'a>,
    loaded: &'a Loaded<'a>,
    subjects: &'a Subjects,
    options: &'a CertifyOptions,
    progress: &'a (dyn Fn(Progress) + Sync),
    stop: &'a AtomicBool,
    /// A thread has met an error: the others need not go on.
    has_failed: AtomicBool,
    next: AtomicUsize,
    done: AtomicUsize,
    failed: AtomicUsize,
    queue: Vec<usize>,
}

type Finished = Vec<(usize, Result<Option<Ran>, CertifyError>)>;

impl Shared<'_> {
    fn work(&self, first: &Covered) -> Finished {
        let mut finished = Vec::new();
        while !self.is_over() {
            let Some(number) = self.queue.get(self.next.fetch_add(1, Ordering::Relaxed)) else {
                break;
            };
            let result = self.case(first, &self.plan.cases[*number].case);
            match &result {
                Ok(Some(ran)) => self.tell(ran),
                Ok(None) => {}
                Err(_) => self.has_failed.store(true, Ordering::Relaxed),
            }
            finished.push((*number, result));
        }
        finished
    }

    fn is_over(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.has_failed.load(Ordering::Relaxed)
    }

    fn tell(&self, ran: &Ran) {
        let is_failed = usize::from(ran.failed_runs > 0);
        let failed = self.failed.fetch_add(is_failed, Ordering::Relaxed) + is_failed;
        let done = self.done.fetch_add(1, Ordering::Relaxed) + 1;
        (self.progress)(Progress { done, cases: self.queue.len(), failed });
    }

    /// None: it was stopped.
    fn case(&self, first: &Covered, listed: &Listed<'_>) -> Result<Option<Ran>, CertifyError> {
        match listed.source {
            Source::Trace(case) => self.trace(first, listed, case),
            Source::Script(script) => self.script(first, listed, script),
            Source::Sessions(group) => Ok(self.sessions(first, listed, group)),
        }
    }

    fn trace(
        &self,
        first: &Covered,
        listed: &Listed<'_>,
        case: &Case,
    ) -> Result<Option<Ran>, CertifyError> {
        let start = Start::new(first, case);
        let mut ran = Ran {
            fuel: start.uncut.fuel,
            bytes: start.uncut.bytes,
            pure: pure(listed.id, &start.uncut.seen, start.failure.as_ref()),
            ..Ran::default()
        };
        for permutation in start.permutations() {
            if self.is_over() {
                return Ok(None);
            }
            let failure = start.judge(&permutation, self.options.cut_seed);
            let name = permutation.to_string();
            ran.add(failure.map(|failure| failed_run(listed, case, &name, failure)));
            if permutation == Permutation::Uncut {
                let failure = self.second(listed, case, &start.uncut)?;
                let second = self.subjects.second_run;
                ran.add(failure.map(|failure| failed_run(listed, case, second, failure)));
            }
        }
        Ok(Some(ran))
    }

    fn script(
        &self,
        first: &Covered,
        listed: &Listed<'_>,
        script: &Script,
    ) -> Result<Option<Ran>, CertifyError> {
        let Subjects { second, second_run, .. } = self.subjects;
        let run = Judge::run_script(first, script);
        let again = Judge::run_script(second, script);
        let class = |run: &ScriptRun| run.failure.as_ref().map(|failure| failure.class);
        let is_same = run.log == again.log && class(&run) == class(&again);
        if !is_same && ![&run, &again].into_iter().any(|run| met_limit(class(run))) {
            return Err(self.differ(listed));
        }
        let verdict = class(&run).map_or("passed", Class::text);
        let pure = format!("{}\n{verdict}\n{}\n", script.id, run.log.join("\n"));
        let mut ran = Ran { fuel: run.fuel, bytes: run.bytes, pure, ..Ran::default() };
        for (name, run) in [("uncut", run), (*second_run, again)] {
            let ScriptRun { log, failure, .. } = run;
            ran.add(failure.map(|failure| failed_script(listed, name, &log, failure)));
        }
        Ok(Some(ran))
    }

    fn sessions(&self, first: &Covered, listed: &Listed<'_>, group: &SessionGroup) -> Option<Ran> {
        let Shared { options, plan, .. } = self;
        let is_over = || self.is_over();
        let run = Judge::run_sessions(first, group, options.sessions, &plan.features, &is_over)?;
        let mut ran = Ran { pure: run.pure, ..Ran::default() };
        let failed = run.failures.len() as u32;
        for failure in run.failures {
            ran.add(Some(failed_session(listed, failure, options.sessions.seed)));
        }
        ran.runs += run.runs.saturating_sub(failed);
        Some(ran)
    }

    fn differ(&self, listed: &Listed<'_>) -> CertifyError {
        let [first, second] = self.loaded.engines.clone();
        CertifyError::EnginesDiffer { case: listed.id.to_owned(), first, second }
    }

    /// What a case comes to under the second engine.
    fn second(
        &self,
        listed: &Listed<'_>,
        case: &Case,
        uncut: &Outcome,
    ) -> Result<Option<Failure>, CertifyError> {
        let outcome = self.subjects.compared(case, uncut).ok_or_else(|| self.differ(listed))?;
        Ok(assess(&self.subjects.second, case, &Permutation::Uncut, &outcome, None))
    }
}

impl Ran {
    /// A run that failed, or passed.
    fn add(&mut self, failed: Option<FailedRun>) {
        self.runs += 1;
        let Some(failed) = failed else { return };
        self.failed_runs += 1;
        // A trap is never hidden behind what merely differs.
        let is_wrong = failed.is_wrong_behaviour();
        let has_fault = self.failures.iter().any(|failed| !failed.is_wrong_behaviour());
        self.classes.insert(failed.class.clone());
        if self.failures.len() == FAILURES && !is_wrong && !has_fault {
            self.failures.pop();
        }
        if self.failures.len() < FAILURES {
            self.failures.push(failed);
        }
    }
}

/// Lines of a script's log that are shown.
const BEFORE: usize = 8;

fn failed_script(
    listed: &Listed<'_>,
    run: &str,
    log: &[String],
    failure: ScriptFailure,
) -> FailedRun {
    FailedRun {
        run: format!("{}/{run}", listed.id),
        class: failure.class.name().to_owned(),
        message: format!("the plug-in {}: {}", failure.class.text(), failure.message),
        file: String::new(),
        line: None,
        at_us: failure.at_us,
        expected: failure.expected,
        observed: failure.observed,
        expected_bytes: String::new(),
        observed_bytes: String::new(),
        before: log[log.len().saturating_sub(BEFORE)..].to_vec(),
        again: again(listed),
    }
}

fn failed_session(listed: &Listed<'_>, failure: FailedSession, seed: u64) -> FailedRun {
    let FailedSession { number, class, message, at_us, trace } = failure;
    let lines: Vec<String> = trace.entries().map(ToString::to_string).collect();
    FailedRun {
        run: format!("{}/{number}", listed.id),
        class: class.name().to_owned(),
        message: format!("the plug-in {}: {message}", class.text()),
        file: String::new(),
        line: None,
        at_us,
        expected: String::new(),
        observed: String::new(),
        expected_bytes: String::new(),
        observed_bytes: String::new(),
        before: lines[lines.len().saturating_sub(BEFORE)..].to_vec(),
        again: format!("{} --seed {seed}", again(listed)),
    }
}

fn failed_run(listed: &Listed<'_>, case: &Case, run: &str, failure: Failure) -> FailedRun {
    let class = failure.class;
    let message = match &failure.fault {
        Some(fault) => format!("the plug-in {}: {}", class.text(), fault.message),
        None => format!("the plug-in {}", class.text()),
    };
    let hex = |bytes: &[u8]| HEXUPPER.encode(bytes);
    let divergence = failure.divergence.as_ref();
    let at_fault = failure.fault.as_ref().map(|fault| fault.at_us);
    let side = |side: fn(&Divergence) -> String| divergence.map(side).unwrap_or_default();
    FailedRun {
        run: format!("{}/{run}", listed.id),
        class: class.name().to_owned(),
        message,
        file: case.path.display().to_string(),
        line: divergence.and_then(|divergence| divergence.line),
        at_us: divergence.map(|divergence| divergence.at_us).or(at_fault).unwrap_or_default(),
        expected: side(|divergence| divergence.expected.text.clone()),
        observed: side(|divergence| divergence.observed.text.clone()),
        expected_bytes: hex(divergence.map(|d| d.expected.bytes.as_slice()).unwrap_or_default()),
        observed_bytes: hex(divergence.map(|d| d.observed.bytes.as_slice()).unwrap_or_default()),
        before: failure.before,
        again: again(listed),
    }
}

/// The command that runs a case again, in every permutation.
pub(super) fn again(listed: &Listed<'_>) -> String {
    format!("softplug certify PLUGIN --profile {} --case {}", listed.profile, listed.id)
}
