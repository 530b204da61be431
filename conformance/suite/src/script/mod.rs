//! Scripted cases: a plug-in against a simulated machine that answers what the
//! plug-in does, where a trace can only say what comes when.
//!
//! A [`Script`] runs in virtual time, without chance but from fixed seeds, and keeps a
//! log of all that can be seen from outside: for the same plug-in it is the same on
//! every machine and under every engine.

mod abi;
mod erased;
mod fanuc;
mod play;
mod r3964;
mod rk512;
mod stage;
mod xon_xoff;

use crate::fault::Fault;
use crate::{Class, Fuel, Subject};
use serde::Serialize;
use softplug_trace::Level;
use std::fmt;
use std::sync::Arc;

pub(crate) use erased::Boxed;
use stage::Stage;

/// A case that is code.
///
/// ```
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{FromFn, script};
/// use softplug_native::NativePlugin;
///
/// let plugin = NativePlugin::XonXoff;
/// let manifest = Manifest::parse(plugin.manifest().as_bytes())?;
/// let subject = FromFn::new(manifest, move || plugin.instantiate());
/// let scripts = script::all();
/// let script = scripts.iter().find(|script| script.profile == "xon-xoff").expect("there are some");
/// let run = script.run(&subject);
/// assert_eq!(run.failure, None);
/// assert!(run.bytes > 0 && !run.log.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct Script {
    /// The case's id.
    pub id: String,
    /// One sentence.
    pub title: String,
    /// The profile to which it belongs.
    pub profile: &'static str,
    /// The clauses that it shows.
    pub clauses: Vec<String>,
    /// How much these bind.
    pub level: Level,
    /// The revision of the profile that brought the case.
    pub since: u32,
    scenario: Arc<Scenario>,
}

/// What happens, and what must come of it.
type Scenario = dyn Fn(&mut Stage<'_>) -> Result<(), Box<ScriptFailure>> + Send + Sync;

/// One run of a script.
///
/// The example of [`Script`] shows one.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct ScriptRun {
    /// What was seen from outside, each line with its virtual time.
    pub log: Vec<String>,
    /// `None`: passed.
    pub failure: Option<ScriptFailure>,
    /// What the plug-in's computing cost.
    pub fuel: Fuel,
    /// Bytes that left and were delivered.
    pub bytes: u64,
}

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

impl Script {
    fn new(
        profile: &'static str,
        id: impl Into<String>,
        title: impl Into<String>,
        clauses: &[&'static str],
        scenario: impl Fn(&mut Stage<'_>) -> Result<(), Box<ScriptFailure>> + Send + Sync + 'static,
    ) -> Self {
        Self {
            id: id.into(),
            title: title.into(),
            profile,
            clauses: clauses.iter().map(|clause| (*clause).to_owned()).collect(),
            level: Level::Must,
            since: 1,
            scenario: Arc::new(scenario),
        }
    }

    /// Runs the script. The result depends on nothing but the plug-in.
    pub fn run<S: Subject>(&self, subject: &S) -> ScriptRun {
        let mut stage = Stage::new(subject);
        let failure = (self.scenario)(&mut stage).err().map(|failure| *failure);
        ScriptRun { log: stage.log, failure, fuel: stage.fuel, bytes: stage.bytes }
    }
}

impl fmt::Debug for Script {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Script").field("id", &self.id).finish_non_exhaustive()
    }
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
        write!(f, "\n  at {}: {}", softplug_abi::Micros(self.at_us), self.message)?;
        if !self.expected.is_empty() || !self.observed.is_empty() {
            write!(f, "\n    expected  {}\n    observed  {}", self.expected, self.observed)?;
        }
        Ok(())
    }
}

/// All scripts, sorted by id.
///
/// ```
/// use softplug_conformance::script;
///
/// let scripts = script::all();
/// assert!(scripts.is_sorted_by_key(|script| script.id.clone()));
/// assert!(scripts.iter().any(|script| script.id == "abi.settings.malformed"));
/// ```
pub fn all() -> Vec<Script> {
    let mut all = abi::scripts();
    all.extend(fanuc::scripts());
    all.extend(r3964::scripts());
    all.extend(rk512::scripts());
    all.extend(xon_xoff::scripts());
    all.sort_by(|a, b| a.id.cmp(&b.id));
    all
}
