//! How a replay can end before its time: faults, by class.

use super::erased::Boxed;
use serde::Serialize;
use softplug_abi::{EventKind, Micros};
use softplug_host::SessionFault;
use softplug_link::{LinkFault, SwapError};
use std::error::Error;

/// A replay that did not reach the end of its trace.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{Fault, FaultClass, FromFn, Permutation, load, replay};
/// use softplug_native::NativePlugin;
/// use softplug_trace::Trace;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let case = &load(["../../fixtures/traces/xon-xoff/xon-xoff.tx.hold.spt"])?[0];
/// let text = case.trace.format().replace("since: 1", "config: speed=9\nsince: 1");
/// let case = case.with_trace(Trace::parse(&text)?);
/// let outcome = replay(&subject, &case, &Permutation::Uncut, 0);
/// let Fault { class, at_us, message } = outcome.fault.expect("there is no such setting");
/// assert_eq!((class, at_us), (FaultClass::NotApplicable, 0));
/// assert!(message.contains("speed"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct Fault {
    /// What kind of fault.
    pub class: FaultClass,
    /// When, in µs of the trace's time.
    pub at_us: i64,
    /// In words.
    pub message: String,
}

/// Kinds of fault. None of them is ever what a trace asks for.
///
/// ```
/// use softplug_conformance::FaultClass;
///
/// let budget = FaultClass::BudgetExhausted;
/// assert_eq!(budget.name(), "budget-exhausted");
/// assert_eq!(format!("the plug-in {}", budget.text()), "the plug-in used up its budget");
/// assert!(FaultClass::ALL.contains(&budget));
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Hash, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultClass {
    /// It trapped; native code panicked.
    Trapped,
    /// It computed for too long over one event.
    BudgetExhausted,
    /// It broke a rule of the ABI, or its encoding.
    RuleBroken,
    /// It refused the settings of the trace.
    SettingsRefused,
    /// It refused an event.
    EventRefused,
    /// It did not give or take a saved state.
    SwapFailed,
    /// There is no instance of it.
    NotStarted,
    /// The trace asks for what this plug-in or the replay does not have.
    NotApplicable,
}

impl FaultClass {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Trapped,
        Self::BudgetExhausted,
        Self::RuleBroken,
        Self::SettingsRefused,
        Self::EventRefused,
        Self::SwapFailed,
        Self::NotStarted,
        Self::NotApplicable,
    ];

    /// The name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Trapped => "trapped",
            Self::BudgetExhausted => "budget-exhausted",
            Self::RuleBroken => "rule-broken",
            Self::SettingsRefused => "settings-refused",
            Self::EventRefused => "event-refused",
            Self::SwapFailed => "swap-failed",
            Self::NotStarted => "not-started",
            Self::NotApplicable => "not-applicable",
        }
    }

    /// In words, as the end of "the plug-in …".
    pub const fn text(self) -> &'static str {
        match self {
            Self::Trapped => "trapped",
            Self::BudgetExhausted => "used up its budget",
            Self::RuleBroken => "broke a rule of the ABI",
            Self::SettingsRefused => "refused the settings",
            Self::EventRefused => "refused an event",
            Self::SwapFailed => "could not be replaced by a fresh instance of itself",
            Self::NotStarted => "cannot be started",
            Self::NotApplicable => "cannot be given what the trace asks for",
        }
    }
}

impl Fault {
    pub(crate) fn new(class: FaultClass, at: Micros, message: &(impl ToString + ?Sized)) -> Self {
        Self { class, at_us: at.0, message: message.to_string() }
    }

    pub(crate) fn of_link<F: Error + 'static>(
        at: Micros,
        fault: &LinkFault<WatchedFault<F>>,
    ) -> Self {
        let class = match fault {
            LinkFault::Instance { event, source } => of_instance(*event, source),
            LinkFault::Malformed { .. } | LinkFault::Rule { .. } | LinkFault::Ended => {
                FaultClass::RuleBroken
            }
        };
        Self::new(class, at, fault)
    }

    pub(crate) fn of_swap<F: Error + 'static>(
        at: Micros,
        error: &SwapError<WatchedFault<F>>,
    ) -> Self {
        let class = match error {
            SwapError::Save(fault) | SwapError::Failed(fault) => {
                return Self { message: error.to_string(), ..Self::of_link(at, fault) };
            }
            SwapError::Refused { event, source } => match of_instance(*event, source) {
                FaultClass::SettingsRefused | FaultClass::EventRefused => FaultClass::SwapFailed,
                worse => worse,
            },
            SwapError::NoState
            | SwapError::Format { .. }
            | SwapError::Unsaid { .. }
            | SwapError::NoProbation => FaultClass::SwapFailed,
            SwapError::Malformed(_) | SwapError::Rule { .. } => FaultClass::RuleBroken,
        };
        Self::new(class, at, error)
    }
}

/// Why a watched instance did not take an event.
#[derive(Debug, thiserror::Error)]
pub(crate) enum WatchedFault<F: Error + 'static> {
    #[error("it panicked: {0}")]
    Panicked(String),
    #[error(transparent)]
    Instance(F),
}

/// How an instance that did not take an event has failed.
pub(crate) fn of_instance<F: Error + 'static>(
    event: EventKind,
    fault: &WatchedFault<F>,
) -> FaultClass {
    let refused = if event == EventKind::Settings {
        FaultClass::SettingsRefused
    } else {
        FaultClass::EventRefused
    };
    let fault: &(dyn Error + 'static) = match fault {
        WatchedFault::Panicked(_) => return FaultClass::Trapped,
        WatchedFault::Instance(fault) => fault,
    };
    let fault = fault.downcast_ref::<Boxed>().map_or(fault, |boxed| boxed.0.as_ref());
    match fault.downcast_ref::<SessionFault>() {
        Some(SessionFault::Trapped { .. }) => FaultClass::Trapped,
        Some(SessionFault::BudgetExhausted { .. }) => FaultClass::BudgetExhausted,
        Some(SessionFault::Malformed { .. }) => FaultClass::RuleBroken,
        _ => refused,
    }
}
