//! A case that is code: what it is called, and how it is run.

use super::context::ScriptContext;
use super::failure::ScriptFailure;
use crate::run::subject::{Fuel, Subject};
use softplug_trace::Level;
use std::fmt;
use std::sync::Arc;

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
type Scenario = dyn Fn(&mut ScriptContext<'_>) -> Result<(), Box<ScriptFailure>> + Send + Sync;

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

impl Script {
    pub(super) fn new(
        profile: &'static str,
        id: impl Into<String>,
        title: impl Into<String>,
        clauses: &[&'static str],
        scenario: impl Fn(&mut ScriptContext<'_>) -> Result<(), Box<ScriptFailure>>
        + Send
        + Sync
        + 'static,
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
        let mut context = ScriptContext::new(subject);
        let failure = (self.scenario)(&mut context).err().map(|failure| *failure);
        ScriptRun { log: context.log, failure, fuel: context.fuel, bytes: context.bytes }
    }
}

impl fmt::Debug for Script {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Script").field("id", &self.id).finish_non_exhaustive()
    }
}
