//! A module in the two engines that it is judged under.

use super::error::CertifyError;
use crate::corpus::Corpus;
use crate::given::case::Case;
use crate::judge::run::Judge;
use crate::random::Sessions;
use crate::run::class::Class;
use crate::run::fault::FaultClass;
use crate::run::outcome::Outcome;
use crate::run::permute::Permutation;
use crate::run::subject::{Sandboxed, SubjectError};
use softplug_abi::Micros;
use softplug_abi::limits::FUEL_PER_EVENT;
use softplug_abi::manifest::{Manifest, SettingError};
use softplug_host::{
    EngineKind, Host, HostOptions, Inspection, LoadError, Plugin, SessionFault, lint,
};
use std::time::Duration;

/// The name of the run under the engine that has no more memory than is said.
const BOUNDED: &str = "interpreter";

/// The budget is the first engine's. The second one counts in other units; its own bound ends
/// what never ends.
const SECOND_FUEL: u64 = 10 * FUEL_PER_EVENT;

/// A module, checked once and compiled once for each of the engines, as far as it could be.
///
/// The first engine judges and counts fuel; the second must show the same. A module that says how
/// much memory it uses has as its second one that has no more. [`certify()`](super::certify()) has
/// an example.
pub struct Loaded<'a> {
    pub(super) module: &'a [u8],
    /// Name and version of the first engine, and of the second one.
    pub(super) engines: [String; 2],
    inspection: Option<Inspection>,
    first: Option<Sandboxed>,
    subjects: Option<Subjects>,
    unfit: Vec<String>,
}

/// A plug-in in both engines.
pub(super) struct Subjects {
    pub(super) first: Sandboxed,
    pub(super) second: Sandboxed,
    /// The name of the run under the second engine.
    pub(super) second_run: &'static str,
}

impl<'a> Loaded<'a> {
    /// A module that does not fit is no error: it is judged as one that cannot be judged.
    ///
    /// # Errors
    /// The engines fail.
    pub fn new(module: &'a [u8]) -> Result<Self, CertifyError> {
        let host = |engine, fuel_per_event| {
            Host::new(HostOptions { engine, fuel_per_event, ..HostOptions::default() })
                .map_err(|error| CertifyError::Internal(error.to_string()))
        };
        let compiler = host(EngineKind::Wasmtime, FUEL_PER_EVENT)?;
        let (wasmi, bounded) =
            (host(EngineKind::Wasmi, SECOND_FUEL)?, host(EngineKind::Interpreter, SECOND_FUEL)?);
        let mut loaded = Self {
            module,
            engines: [&compiler, &wasmi].map(|host| host.engine().to_string()),
            inspection: None,
            first: None,
            subjects: None,
            unfit: Vec::new(),
        };
        if let Err(reason) = loaded.load(&compiler, &wasmi, &bounded) {
            loaded.unfit.push(reason);
        }
        Ok(loaded)
    }

    fn load(&mut self, compiler: &Host, wasmi: &Host, bounded: &Host) -> Result<(), String> {
        let module = self.module;
        let inspection = lint(module).map_err(|error| error.to_string())?;
        let inspection = &*self.inspection.insert(inspection);
        let plugin = compiler.load_inspected(module, inspection);
        let first = Sandboxed::new(plugin.map_err(|error| error.to_string())?);
        let first = &*self.first.insert(first);
        begins(first.plugin()).map_err(|error| error.to_string())?;
        // What only one of them takes can be shown by one of them only.
        let (host, second_run) = match inspection.manifest.memory_bytes {
            Some(_) => (bounded, BOUNDED),
            None => (wasmi, "wasmi"),
        };
        let second = host.load_inspected(module, inspection);
        let name = host.engine().to_string();
        let second = second.map_err(|error| format!("{name} does not take the module: {error}"))?;
        self.engines[1] = name;
        let (first, second) = (first.clone(), Sandboxed::new(second));
        self.subjects = Some(Subjects { first, second, second_run });
        Ok(())
    }

    /// About as many random sessions of a profile as it gets through in this time.
    ///
    /// # Errors
    /// It cannot be judged.
    pub fn sessions_within(
        &self,
        corpus: &Corpus,
        profile: &str,
        time: Duration,
        threads: usize,
    ) -> Result<u32, SubjectError> {
        let unfit = || Box::<dyn std::error::Error + Send + Sync>::from(self.unfit.concat());
        let first = self.first.as_ref().ok_or_else(unfit)?;
        Ok(Sessions::within(first, corpus, profile, time, threads))
    }

    pub(super) fn inspection(&self) -> Option<&Inspection> {
        self.inspection.as_ref()
    }

    pub(super) fn manifest(&self) -> Option<&Manifest> {
        self.inspection.as_ref().map(|inspection| &inspection.manifest)
    }

    /// None where it cannot be judged.
    pub(super) fn subjects(&self) -> Option<&Subjects> {
        self.subjects.as_ref()
    }

    /// Why it cannot be judged.
    pub(super) fn unfit(&self) -> Vec<String> {
        self.unfit.clone()
    }
}

/// Why there is no instance that could be judged.
#[derive(Debug, thiserror::Error)]
enum NoBegin {
    #[error(transparent)]
    Instance(#[from] LoadError),
    #[error(transparent)]
    Defaults(#[from] SettingError),
    #[error(transparent)]
    Fault(#[from] SessionFault),
}

/// Whether there is an instance that takes its own defaults, or refuses them: which of the two
/// it is, the cases judge.
fn begins(plugin: &Plugin) -> Result<(), NoBegin> {
    let mut session = plugin.instantiate()?;
    let defaults = plugin.manifest().resolve_settings([])?;
    match session.configure(&defaults, Micros::ZERO) {
        Ok(()) | Err(SessionFault::Refused { .. }) => Ok(()),
        Err(fault) => Err(fault.into()),
    }
}

impl Subjects {
    /// The uncut run under the second engine; none where the engines differ.
    pub(super) fn compared(&self, case: &Case, first: &Outcome) -> Option<Outcome> {
        let second = Judge::run(&self.second, case, &Permutation::Uncut, 0);
        let is_same = first.seen == second.seen && class(first) == class(&second);
        // Each engine has its own stack and its own fuel.
        let is_own = [first, &second].into_iter().any(|outcome| met_limit(class(outcome)));
        // Where it is given less memory, a fault there is the plug-in's.
        let lacks_memory = self.second_run == BOUNDED && second.fault.is_some();
        (is_same || is_own || lacks_memory).then_some(second)
    }
}

fn class(outcome: &Outcome) -> Option<Class> {
    outcome.fault.as_ref().map(|fault| Class::Fault(fault.class))
}

/// Whether a run ended at a limit of its engine.
pub(super) fn met_limit(class: Option<Class>) -> bool {
    matches!(class, Some(Class::Fault(FaultClass::Trapped | FaultClass::BudgetExhausted)))
}
