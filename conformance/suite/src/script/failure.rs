//! How a script, or a part of it, ends: well, or with a failure.

use crate::run::class::Class;
use crate::run::fault::{Fault, FaultClass};
use serde::Serialize;
use softplug_abi::Micros;
use std::fmt;

/// Why a script failed.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{FromFn, script};
/// use softplug_native::NativePlugin;
///
/// // A plug-in that speaks another protocol than the script's.
/// let plugin = NativePlugin::R3964;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let scripts = script::all();
/// let script = scripts.iter().find(|script| script.profile == "xon-xoff").expect("there are some");
/// let failure = script.run(&subject).failure.expect("it cannot pass");
/// let first = format!("the plug-in {}\n", failure.class.text());
/// assert!(failure.to_string().starts_with(&first));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, PartialEq, Eq, Debug, Serialize)]
pub struct ScriptFailure {
    /// What kind of failure.
    pub class: Class,
    /// When it showed, in µs of the case's time.
    pub at_us: i64,
    /// In words.
    pub message: String,
    /// What had to be; empty where there is nothing to compare.
    pub expected: String,
    /// What was.
    pub observed: String,
}

/// How a scenario, or a part of it, went.
pub(super) type Outcome<T = ()> = Result<T, Box<ScriptFailure>>;

/// A failure that the plug-in's behaviour shows.
#[expect(clippy::unnecessary_box_returns, reason = "it is the error of a small result")]
pub(super) fn diverged(
    at: Micros,
    message: impl Into<String>,
    expected: impl Into<String>,
    observed: impl Into<String>,
) -> Box<ScriptFailure> {
    Box::new(ScriptFailure {
        class: Class::Diverged,
        at_us: at.0,
        message: message.into(),
        expected: expected.into(),
        observed: observed.into(),
    })
}

/// A failure of asking for what the plug-in does not have.
#[expect(clippy::unnecessary_box_returns, reason = "it is the error of a small result")]
pub(super) fn not_applicable(reason: &(impl ToString + ?Sized)) -> Box<ScriptFailure> {
    Fault::new(FaultClass::NotApplicable, Micros::ZERO, reason).into()
}

impl From<Fault> for Box<ScriptFailure> {
    fn from(fault: Fault) -> Self {
        Box::new(ScriptFailure {
            class: Class::Fault(fault.class),
            at_us: fault.at_us,
            message: fault.message,
            expected: String::new(),
            observed: String::new(),
        })
    }
}

impl fmt::Display for ScriptFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the plug-in {}", self.class.text())?;
        write!(f, "\n  at {}: {}", Micros(self.at_us), self.message)?;
        if !self.expected.is_empty() || !self.observed.is_empty() {
            write!(f, "\n    expected  {}\n    observed  {}", self.expected, self.observed)?;
        }
        Ok(())
    }
}
