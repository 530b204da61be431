//! Scripted cases: a plug-in against a simulated machine that answers what the
//! plug-in does, where a trace can only say what comes when.
//!
//! A [`Script`] runs in virtual time, without chance but from fixed seeds, and keeps a
//! log of all that can be seen from outside: for the same plug-in it is the same on
//! every machine and under every engine.

mod abi;
mod case;
mod context;
mod failure;
mod fanuc;
mod kermit;
mod play;
mod r3964;
mod rk512;
mod settings;
mod setup;
mod xmodem;
mod xon_xoff;

pub use case::{Script, ScriptRun};
pub use failure::ScriptFailure;

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
    all.extend(kermit::scripts());
    all.extend(r3964::scripts());
    all.extend(rk512::scripts());
    all.extend(settings::scripts());
    all.extend(xmodem::scripts());
    all.extend(xon_xoff::scripts());
    all.sort_by(|a, b| a.id.cmp(&b.id));
    all
}
