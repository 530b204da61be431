//! All permutations of all traces against all subjects.

use super::compare::{compare, first_difference};
use super::demand::demands;
use super::divergence::Divergence;
use super::verdict::{Failure, Verdict};
use crate::given::case::Case;
use crate::given::lines::line_parameters;
use crate::given::timeline::TimelineError;
use crate::random::{GroupRun, SessionGroup, Sessions};
use crate::run::class::Class;
use crate::run::fault::{Fault, FaultClass};
use crate::run::outcome::Outcome;
use crate::run::permute::Permutation;
use crate::run::plan::permutations;
use crate::run::replay::replay;
use crate::run::seen::Seen;
use crate::run::subject::Subject;
use crate::run::transcript;
use crate::script::{Script, ScriptRun};
use data_encoding::HEXLOWER;
use serde::Serialize;
use sha2::{Digest, Sha256};
use softplug_abi::Micros;
use softplug_abi::manifest::Manifest;
use softplug_trace::{Entry, Line, SourceLine, Trace, What, When};
use std::fmt::Write as _;

/// Which cases are run: those whose name is listed, or whose trace is. An empty
/// filter takes all.
///
/// ```
/// use softplug_conformance::{Filter, Permutation};
///
/// let filter = Filter::only(["xon-xoff.tx.hold/cut:1", "xon-xoff.tx.empty"]);
/// assert!(filter.takes("xon-xoff.tx.hold", &Permutation::CutSingly));
/// assert!(!filter.takes("xon-xoff.tx.hold", &Permutation::Uncut));
/// assert!(filter.takes("xon-xoff.tx.empty", &Permutation::Uncut));
/// assert!(Filter::default().takes_trace("xon-xoff.tx.busy"));
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Filter {
    only: Vec<String>,
}

impl Filter {
    /// Only these: traces by their id, single cases as `ID/PERMUTATION`.
    pub fn only(names: impl IntoIterator<Item = impl Into<String>>) -> Self {
        Self { only: names.into_iter().map(Into::into).collect() }
    }

    /// Whether any case of this trace is taken.
    pub fn takes_trace(&self, id: &str) -> bool {
        let of_trace = |name: &String| name == id || name.split('/').next() == Some(id);
        self.only.is_empty() || self.only.iter().any(of_trace)
    }

    /// Whether this case is taken.
    pub fn takes(&self, id: &str, permutation: &Permutation) -> bool {
        let is_case = |name: &String| {
            name == id || name.strip_prefix(id) == Some(format!("/{permutation}").as_str())
        };
        self.only.is_empty() || self.only.iter().any(is_case)
    }
}

/// All that was run.
///
/// The example of [`run_all`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Summary {
    /// Cases that were run.
    pub total: usize,
    /// Those that passed.
    pub passed: usize,
    /// Those that did not.
    pub failed: usize,
    /// SHA-256 over the name, the verdict and the observable effects of every uncut
    /// case, as hex digits.
    pub digest: String,
    /// Every case, in the order of subjects, traces and permutations.
    pub cases: Vec<Verdict>,
}

/// A subject whatever its instances are.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{FromFn, Judge};
/// use softplug_native::NativePlugin;
///
/// // Plug-ins of different types in one list.
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let plugin = NativePlugin::R3964;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let other = FromFn::new(manifest, move || plugin.instantiate());
/// let subjects: [&dyn Judge; 2] = [&subject, &other];
/// assert_eq!(subjects.map(|subject| subject.label()), ["xon-xoff (native)", "r3964 (native)"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub trait Judge: Sync {
    /// How reports name it.
    fn label(&self) -> &str;

    /// What the plug-in says of itself.
    fn manifest(&self) -> &Manifest;

    /// Runs a trace once. The seed changes where random cuts fall.
    fn run(&self, case: &Case, permutation: &Permutation, cut_seed: u64) -> Outcome;

    /// Runs a script once.
    fn run_script(&self, script: &Script) -> ScriptRun;

    /// Runs random sessions until they are over or `is_over` says so; then there is no
    /// result. Features that are not claimed bind nobody.
    fn run_sessions(
        &self,
        group: &SessionGroup,
        sessions: Sessions,
        features: &[String],
        is_over: &dyn Fn() -> bool,
    ) -> Option<GroupRun>;
}

impl<S: Subject + Sync> Judge for S {
    fn label(&self) -> &str {
        Subject::label(self)
    }

    fn manifest(&self) -> &Manifest {
        Subject::manifest(self)
    }

    fn run(&self, case: &Case, permutation: &Permutation, cut_seed: u64) -> Outcome {
        replay(self, case, permutation, cut_seed)
    }

    fn run_script(&self, script: &Script) -> ScriptRun {
        script.run(self)
    }

    fn run_sessions(
        &self,
        group: &SessionGroup,
        sessions: Sessions,
        features: &[String],
        is_over: &dyn Fn() -> bool,
    ) -> Option<GroupRun> {
        group.run(self, sessions, features, is_over)
    }
}

/// Runs all cases that the filter takes. The result depends on nothing but the
/// arguments.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{Filter, FromFn, load, run_all};
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let cases = load(["../../fixtures/traces/xon-xoff"])?;
/// let filter = Filter::only(["xon-xoff.tx.hold", "xon-xoff.tx.empty"]);
/// let summary = run_all(&[&subject], &cases, &filter);
/// assert!(summary.total > 10, "two traces in all their permutations");
/// assert_eq!((summary.passed, summary.failed), (summary.total, 0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn run_all(subjects: &[&dyn Judge], cases: &[Case], filter: &Filter) -> Summary {
    let mut summary = Summary::default();
    let mut digest = Sha256::new();
    for subject in subjects {
        for case in cases.iter().filter(|case| filter.takes_trace(&case.trace.front.id)) {
            let (verdicts, uncut) = judge(*subject, case, filter);
            digest.update(uncut);
            summary.cases.extend(verdicts);
        }
    }
    summary.total = summary.cases.len();
    summary.passed = summary.cases.iter().filter(|verdict| verdict.is_passed()).count();
    summary.failed = summary.total - summary.passed;
    summary.digest = HEXLOWER.encode(&digest.finalize());
    summary
}

/// Judges one trace in every permutation that the filter takes. Returns the
/// verdicts and what the digest holds of the uncut run.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{Filter, FromFn, judge, load};
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let (verdicts, uncut) = judge(&subject, case, &Filter::only(["xon-xoff.tx.hold/uncut"]));
/// assert_eq!(verdicts.len(), 1);
/// assert_eq!(verdicts[0].to_string(), "passed xon-xoff.tx.hold/uncut [xon-xoff (native)]");
/// assert!(uncut.starts_with("xon-xoff.tx.hold\npassed\n"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn judge(subject: &dyn Judge, case: &Case, filter: &Filter) -> (Vec<Verdict>, String) {
    let id = &case.trace.front.id;
    let start = Start::new(subject, case);
    let mut verdicts = Vec::new();
    for permutation in start.permutations() {
        if !filter.takes(id, &permutation) {
            continue;
        }
        verdicts.push(Verdict {
            case: format!("{id}/{permutation}"),
            subject: subject.label().to_owned(),
            level: case.trace.front.level.name(),
            failure: start.judge(&permutation, 0),
        });
    }
    (verdicts, pure(id, &start.uncut.seen, start.failure.as_ref()))
}

/// A case of which the uncut run is over: what all others are compared with.
pub(crate) struct Start<'a> {
    subject: &'a dyn Judge,
    case: &'a Case,
    pub(crate) uncut: Outcome,
    /// Why the uncut run did not pass.
    pub(crate) failure: Option<Failure>,
}

impl<'a> Start<'a> {
    pub(crate) fn new(subject: &'a dyn Judge, case: &'a Case) -> Self {
        let uncut = subject.run(case, &Permutation::Uncut, 0);
        let failure = assess(subject, case, &Permutation::Uncut, &uncut, None);
        Self { subject, case, uncut, failure }
    }

    /// Every permutation that there is, the uncut run first.
    pub(crate) fn permutations(&self) -> Vec<Permutation> {
        let (case, manifest) = (self.case, self.subject.manifest());
        permutations(case, manifest, self.uncut.swap_places, self.speaks_first())
            // The uncut run has failed for the same reason.
            .unwrap_or_else(|_| vec![Permutation::Uncut])
    }

    /// Whether the plug-in does something on an open line of itself.
    fn speaks_first(&self) -> bool {
        let quiet = When::at(self.case.trace.end());
        let entry = Entry { when: quiet, what: What::Quiet, line: SourceLine::default() };
        let trace = &self.case.trace;
        let empty = Trace { front: trace.front.clone(), body: vec![Line::Entry(entry)] };
        let outcome = self.subject.run(&self.case.with_trace(empty), &Permutation::Uncut, 0);
        !outcome.seen.is_empty() || outcome.fault.is_some()
    }

    /// Runs one of them.
    pub(crate) fn judge(&self, permutation: &Permutation, cut_seed: u64) -> Option<Failure> {
        if *permutation == Permutation::Uncut {
            return self.failure.clone();
        }
        self.assess(permutation, &self.subject.run(self.case, permutation, cut_seed))
    }

    /// Holds a run of one of them against what it must be.
    pub(crate) fn assess(&self, permutation: &Permutation, outcome: &Outcome) -> Option<Failure> {
        let is_compared = self.failure.is_none() && permutation.equals_uncut();
        let compared = is_compared.then_some(&self.uncut);
        assess(self.subject, self.case, permutation, outcome, compared)
    }
}

/// Holds a run against the trace, and against the uncut run if that is given.
pub(crate) fn assess(
    subject: &dyn Judge,
    case: &Case,
    permutation: &Permutation,
    outcome: &Outcome,
    uncut: Option<&Outcome>,
) -> Option<Failure> {
    let manifest = subject.manifest();
    let other = match permutation {
        Permutation::Byte(byte) => Some(case.with_trace(case.trace.with_byte(*byte))),
        _ => None,
    };
    let case = other.as_ref().unwrap_or(case);
    if let Some(fault) = &outcome.fault {
        let class = Class::Fault(fault.class);
        let before = transcript::before(case, manifest, &outcome.seen, Micros(fault.at_us));
        return Some(failure(case, permutation, class, None, Some(fault.clone()), before));
    }
    let divergence = match uncut {
        Some(uncut) => {
            let place = first_difference(&uncut.seen, &outcome.seen)?;
            let divergence =
                Divergence::between_runs(case, manifest, &uncut.seen, &outcome.seen, place);
            (divergence, place)
        }
        None => match against_trace(case, manifest, outcome) {
            Ok(found) => found?,
            Err(error) => {
                let fault = Fault::new(FaultClass::NotApplicable, Micros::ZERO, &error);
                let class = Class::Fault(FaultClass::NotApplicable);
                return Some(failure(case, permutation, class, None, Some(fault), Vec::new()));
            }
        },
    };
    let (divergence, place) = divergence;
    let class = match uncut {
        None => Class::Diverged,
        Some(_) => class(permutation),
    };
    let before =
        transcript::before(case, manifest, &outcome.seen[..place], Micros(divergence.at_us));
    Some(failure(case, permutation, class, Some(divergence), None, before))
}

/// What a plug-in depends on that does in this permutation something else than in the
/// uncut run: of two that are combined, the second.
fn class(permutation: &Permutation) -> Class {
    match permutation {
        Permutation::CutSingly | Permutation::CutWhole | Permutation::CutRandom(_) => {
            Class::DependsOnCuts
        }
        Permutation::SwapAll | Permutation::SwapAfter(_) => Class::DependsOnSwap,
        Permutation::Twice | Permutation::After(_) | Permutation::Again(_) => Class::DependsOnPast,
        Permutation::Later(_) | Permutation::Idle(_) => Class::DependsOnClock,
        Permutation::Rooms(_) => Class::DependsOnRooms,
        Permutation::Uncut | Permutation::Late(_) | Permutation::Byte(_) => Class::Diverged,
        Permutation::Both(both) => class(&both[1]),
    }
}

fn failure(
    case: &Case,
    permutation: &Permutation,
    class: Class,
    divergence: Option<Divergence>,
    fault: Option<Fault>,
    before: Vec<String>,
) -> Failure {
    let file = case.path.display().to_string();
    let id = &case.trace.front.id;
    let again = format!("softplug replay PLUGIN {file} --only {id}/{permutation}");
    Failure { class, file, divergence, fault, before, again }
}

/// The divergence from that timeline of events which is followed the longest, and
/// how much was seen before it.
fn against_trace(
    case: &Case,
    manifest: &Manifest,
    outcome: &Outcome,
) -> Result<Option<(Divergence, usize)>, TimelineError> {
    let line = line_parameters(&case.trace.front.line);
    let mut furthest = None;
    for timeline in case.trace.variants() {
        let demands = demands(case, manifest, &timeline)?;
        let Err(mismatch) = compare(&demands, &outcome.seen, line) else { return Ok(None) };
        let is_further = furthest
            .as_ref()
            .is_none_or(|(best, _): &(Divergence, usize)| best.at_us < mismatch.at.0);
        if is_further {
            let divergence =
                Divergence::from_trace(case, manifest, &demands, &outcome.seen, mismatch);
            furthest = Some((divergence, mismatch.observed.unwrap_or(outcome.seen.len())));
        }
    }
    Ok(furthest)
}

/// What the digest holds of an uncut run: nothing that depends on the engine.
pub(crate) fn pure(id: &str, seen: &[Seen], failure: Option<&Failure>) -> String {
    let verdict = failure.map_or("passed", |failure| failure.class.text());
    let mut text = format!("{id}\n{verdict}\n");
    for seen in seen {
        let _ = writeln!(text, "{seen}");
    }
    text
}
