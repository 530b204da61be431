//! The two engines, and a module in both.

use super::error::CertifyError;
use crate::given::case::Case;
use crate::judge::run::Judge;
use crate::run::class::Class;
use crate::run::fault::FaultClass;
use crate::run::outcome::Outcome;
use crate::run::permute::Permutation;
use crate::run::subject::Sandboxed;
use softplug_abi::Micros;
use softplug_abi::limits::FUEL_PER_EVENT;
use softplug_abi::manifest::{Manifest, SettingError};
use softplug_host::{EngineKind, Host, HostOptions, LoadError, Plugin, SessionFault, lint};

/// The name of the run under the engine that has no more memory than is said.
const BOUNDED: &str = "interpreter";

/// The budget is the first engine's. The second one counts in other units; its own bound ends
/// what never ends.
const SECOND_FUEL: u64 = 10 * FUEL_PER_EVENT;

/// The first engine judges and counts fuel; the second must show the same. A module that says how
/// much memory it uses has as its second one that has no more.
pub(super) struct Engines {
    first: Host,
    second: Host,
    bounded: Host,
}

/// A module as far as it could be loaded.
pub(super) struct Judged {
    manifest: Option<Manifest>,
    subjects: Option<Subjects>,
    unfit: Vec<String>,
}

/// A plug-in in both engines.
pub(super) struct Subjects {
    pub(super) first: Sandboxed,
    pub(super) second: Sandboxed,
    /// The name of the run under the second engine.
    pub(super) second_run: &'static str,
    /// Of the engines.
    pub(super) names: [String; 2],
}

impl Engines {
    pub(super) fn new() -> Result<Self, CertifyError> {
        let host = |engine, fuel_per_event| {
            Host::new(HostOptions { engine, fuel_per_event, ..HostOptions::default() })
                .map_err(|error| CertifyError::Internal(error.to_string()))
        };
        Ok(Self {
            first: host(EngineKind::Wasmtime, FUEL_PER_EVENT)?,
            second: host(EngineKind::Wasmi, SECOND_FUEL)?,
            bounded: host(EngineKind::Interpreter, SECOND_FUEL)?,
        })
    }

    /// Name and version of the first engine.
    pub(super) fn first(&self) -> String {
        self.first.engine().to_string()
    }

    /// Name and version of the second engine.
    pub(super) fn second(&self) -> String {
        self.second.engine().to_string()
    }

    /// A module that does not fit is no error: it is judged as one that cannot be judged.
    pub(super) fn load(&self, module: &[u8]) -> Judged {
        let unfit =
            |manifest, reason: String| Judged { manifest, subjects: None, unfit: vec![reason] };
        let manifest = match lint(module) {
            Ok(inspection) => inspection.manifest,
            Err(error) => return unfit(None, error.to_string()),
        };
        let plugin = match self.first.load_bytes(module) {
            Ok(plugin) => plugin,
            Err(error) => return unfit(Some(manifest), error.to_string()),
        };
        if let Err(reason) = begins(&plugin) {
            return unfit(Some(manifest), reason.to_string());
        }
        // What only one of them takes can be shown by one of them only.
        let (host, second_run) = match manifest.memory_bytes {
            Some(_) => (&self.bounded, BOUNDED),
            None => (&self.second, "wasmi"),
        };
        let second = match host.load_bytes(module) {
            Ok(second) => second,
            Err(error) => {
                let reason = format!("{} does not take the module: {error}", host.engine());
                return unfit(Some(manifest), reason);
            }
        };
        let (first, second) = (Sandboxed::new(plugin), Sandboxed::new(second));
        let names = [self.first(), host.engine().to_string()];
        let subjects = Some(Subjects { first, second, second_run, names });
        Judged { manifest: Some(manifest), subjects, unfit: Vec::new() }
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

impl Judged {
    pub(super) fn manifest(&self) -> Option<&Manifest> {
        self.manifest.as_ref()
    }

    /// Name and version of the engine that is compared with; none where it cannot be judged.
    pub(super) fn second(&self) -> Option<&str> {
        self.subjects.as_ref().map(|subjects| &*subjects.names[1])
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
