//! Some sessions of a profile, run against one plug-in.

use super::Sessions;
use super::digest::SessionsDigest;
use super::trace;
use crate::given::ledger::Ledger;
use crate::run::class::Class;
use crate::run::fault::FaultClass;
#[cfg(feature = "wasmtime")]
use crate::run::seen::Seen;
use crate::run::subject::{Fuel, Subject};
use crate::run::watched::{Meter, Watched};
use data_encoding::HEXLOWER;
use softplug_models::{Effect, Finding, Profile, Ran, Session};
use softplug_report::Level;
use softplug_trace::Trace;
use std::rc::Rc;
use std::sync::Arc;

/// Sessions of one group that are looked into when they fail.
const FAILURES: usize = 3;

/// Random sessions of a profile, as a case.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{Corpus, FromFn, GroupRun, Judge, Sessions};
/// use softplug_native::NativePlugin;
///
/// let corpus = Corpus::embedded();
/// let group = corpus.sessions.iter().find(|group| group.id == "xon-xoff.random.1").unwrap();
/// assert!(group.clauses.contains(&"xon-xoff.tx.obey-xoff".to_owned()));
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let few = Sessions { count: 16, seed: 1 };
/// let run = subject.run_sessions(group, few, &[], &|| false).expect("nothing stops it");
/// let GroupRun { runs, failures, effects, .. } = run;
/// assert!((1..=2).contains(&runs) && effects > 0 && failures.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct SessionGroup {
    /// The case's id.
    pub id: String,
    /// One sentence.
    pub title: String,
    /// The profile.
    pub profile: &'static str,
    /// Clauses of the core that the model judges.
    pub clauses: Vec<String>,
    /// The newest revision of these.
    pub since: u32,
    /// From 1.
    pub(crate) number: u64,
    model: &'static Profile,
    ledger: Arc<Ledger>,
}

/// The model of the ledger's profile, if it has one and the ledger is that of this
/// project: it has all of the model's clauses.
pub(crate) fn model_of(ledger: &Ledger) -> Option<&'static Profile> {
    let has_clauses = |model: &&Profile| model.clauses.iter().all(|id| ledger.clause(id).is_some());
    softplug_models::profile(&ledger.profile).filter(has_clauses)
}

/// What came of a group.
///
/// The example of [`SessionGroup`] shows one.
#[derive(Clone, Debug, Default)]
pub struct GroupRun {
    /// Sessions that fitted the plug-in.
    pub runs: u32,
    /// The first ones that failed.
    pub failures: Vec<FailedSession>,
    /// What the plug-in's computing cost.
    pub fuel: Fuel,
    /// Things that the plug-in did: bytes, deliveries, ends of jobs.
    pub effects: u64,
    /// What the digest holds of it.
    pub pure: String,
}

/// A session that failed, made short.
///
/// The example of [`SessionGroup`] leads to one.
#[derive(Clone, Debug)]
pub struct FailedSession {
    /// The session's number.
    pub number: u64,
    /// How it failed.
    pub class: Class,
    /// The clause and what had to be.
    pub message: String,
    /// When.
    pub at_us: i64,
    /// What was given and seen.
    pub trace: Trace,
}

/// One session, run.
pub(crate) struct SessionRun {
    session: Session,
    ran: Ran,
    fuel: Fuel,
    fault: Option<FaultClass>,
}

impl SessionRun {
    /// All that the plug-in did.
    #[cfg(feature = "wasmtime")]
    pub(crate) fn seen(&self) -> Vec<Seen> {
        trace::seen(&self.ran)
    }
}

impl SessionGroup {
    /// The groups of the ledger's profile, if it has a model and the ledger has all of
    /// the model's clauses.
    pub(crate) fn of(ledger: &Ledger) -> Vec<Self> {
        let Some(model) = model_of(ledger) else { return Vec::new() };
        let is_core = |id: &&&str| {
            ledger
                .clause(id)
                .is_some_and(|clause| clause.feature.is_none() && clause.level == Level::Must)
        };
        let clauses: Vec<String> =
            model.clauses.iter().filter(is_core).map(|id| (*id).to_owned()).collect();
        let since = clauses.iter().filter_map(|id| Some(ledger.clause(id)?.since)).max();
        let ledger = Arc::new(ledger.clone());
        let group = |number| Self {
            id: format!("{}.random.{number}", model.name),
            title: format!("Random sessions hold to the model, part {number} of {}", super::GROUPS),
            profile: model.name,
            clauses: clauses.clone(),
            since: since.unwrap_or(1),
            number,
            model,
            ledger: Arc::clone(&ledger),
        };
        (1..=super::GROUPS).map(group).collect()
    }

    /// Runs its sessions. Features that are not claimed bind nobody.
    pub(crate) fn run<S: Subject>(
        &self,
        subject: &S,
        sessions: Sessions,
        features: &[String],
        is_over: &dyn Fn() -> bool,
    ) -> Option<GroupRun> {
        let mut group = GroupRun::default();
        let mut digest = SessionsDigest::default();
        for number in sessions.numbers(self.number) {
            if is_over() {
                return None;
            }
            let Some(run) = self.session(subject, sessions.seed, number) else { continue };
            group.runs += 1;
            group.effects += run.ran.observed.len() as u64;
            group.fuel.total = group.fuel.total.saturating_add(run.fuel.total);
            group.fuel.largest = group.fuel.largest.max(run.fuel.largest);
            let told = run.ran.observed.iter();
            let told = told.map(|(at, observed)| (at, Effect::of(observed, subject.manifest())));
            digest.put(told.filter_map(|(at, effect)| Some((*at, effect?))));
            if self.is_failed(&run, features) {
                group.failures.push(self.failed(subject, run, number));
                if group.failures.len() == FAILURES {
                    break;
                }
            }
        }
        let verdict = if group.failures.is_empty() { "passed" } else { "failed" };
        group.pure = format!("{}\n{verdict}\n{}\n", self.id, HEXLOWER.encode(&digest.finish()));
        Some(group)
    }

    /// One session, as it is drawn.
    pub(crate) fn session<S: Subject>(
        &self,
        subject: &S,
        seed: u64,
        number: u64,
    ) -> Option<SessionRun> {
        let session = Session::draw(self.model, subject.manifest(), seed, number)?;
        let meter = Rc::new(Meter::default());
        let ran = session.run(subject.manifest(), &mut || start(subject, &meter));
        Some(SessionRun { session, ran, fuel: meter.fuel.get(), fault: meter.fault.get() })
    }

    /// Whether a session failed by what binds a plug-in that claims these features.
    pub(crate) fn is_failed(&self, run: &SessionRun, features: &[String]) -> bool {
        self.binds(run.ran.finding.as_ref(), features)
    }

    /// A session that failed, made short, as a trace.
    pub(crate) fn failed<S: Subject>(
        &self,
        subject: &S,
        run: SessionRun,
        number: u64,
    ) -> FailedSession {
        let meter = Rc::new(Meter::default());
        let SessionRun { session, ran, fault, .. } = run;
        let ran = session.shrunk(subject.manifest(), &mut || start(subject, &meter), ran);
        let (class, message, at) = match &ran.finding {
            Some(Finding::Broken { at, broken }) => {
                (Class::Diverged, format!("{}: {}", broken.clause, broken.message), *at)
            }
            Some(Finding::Fault { at, message }) => {
                let class = fault.unwrap_or(FaultClass::RuleBroken);
                (Class::Fault(class), message.clone(), *at)
            }
            None => (Class::Diverged, "passes when it is run again".to_owned(), ran.end),
        };
        let trace = trace::of_session(self.model, &session, &ran, subject.manifest());
        FailedSession { number, class, message, at_us: at.0, trace }
    }

    /// Whether a finding counts: what SHOULD or MAY be, or belongs to a feature that is
    /// not claimed, does not.
    fn binds(&self, finding: Option<&Finding>, features: &[String]) -> bool {
        match finding {
            None => false,
            Some(Finding::Fault { .. }) => true,
            Some(Finding::Broken { broken, .. }) => {
                self.ledger.clause(broken.clause).is_none_or(|clause| {
                    let is_claimed = |feature: &String| features.contains(feature);
                    clause.level == Level::Must && clause.feature.as_ref().is_none_or(is_claimed)
                })
            }
        }
    }
}

fn start<S: Subject>(subject: &S, meter: &Rc<Meter>) -> Result<Watched<S::Instance>, String> {
    Watched::start(subject, Rc::clone(meter)).map_err(|error| error.to_string())
}
