//! Every reference plug-in passes the scripts of its profiles, natively and under both
//! engines, and all do the same; and each script catches one that does wrong.

mod wrong;

use crate::common::{native, sandboxed_under};
use softplug_conformance::Judge;
use softplug_conformance::script::{Script, all};
use softplug_host::EngineKind;
use wrong::{Wrong, caught};

/// A profile and the reference plug-ins that claim it; all of them claim `abi`.
const PROFILES: &[(&str, &[&str])] = &[
    ("3964", &["r3964"]),
    ("fanuc-rs232", &["fanuc-rs232"]),
    ("r3964", &["r3964"]),
    ("r3964-simplified", &["r3964-simplified"]),
    ("rk512", &["r3964", "r3964-simplified"]),
    ("xmodem", &["xmodem"]),
    ("kermit", &["kermit"]),
    ("xon-xoff", &["xon-xoff"]),
];

fn scripts_of(plugin: &str) -> Vec<Script> {
    let claims = |script: &Script| {
        let claimed = |(name, plugins): &(&str, &[&str])| {
            *name == script.profile && plugins.contains(&plugin)
        };
        script.profile == "abi" || PROFILES.iter().any(claimed)
    };
    all().into_iter().filter(claims).collect()
}

/// Passes natively, and in the sandbox with the same log.
fn passes(plugin: &str) {
    let native = native(plugin);
    let engines = [EngineKind::Wasmtime, EngineKind::Wasmi];
    let sandboxed = engines.map(|engine| sandboxed_under(engine, plugin));
    let mut failed = Vec::new();
    for script in scripts_of(plugin) {
        let run = script.run(&native);
        if let Some(failure) = &run.failure {
            let end = &run.log[run.log.len().saturating_sub(30)..];
            failed.push(format!("{} {failure}\n{}", script.id, end.join("\n")));
            continue;
        }
        for subject in &sandboxed {
            let sandboxed = subject.run_script(&script);
            assert!(
                sandboxed.failure.is_some() || sandboxed.fuel.total > 0 || script.profile == "abi"
            );
            if (&sandboxed.log, &sandboxed.failure) != (&run.log, &run.failure) {
                failed.push(format!("{}: the sandbox does something else", script.id));
            }
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n\n"));
}

#[test]
fn fanuc() {
    passes("fanuc-rs232");
}

#[test]
fn xon_xoff() {
    passes("xon-xoff");
}

#[test]
fn kermit() {
    passes("kermit");
}

#[test]
fn xmodem() {
    passes("xmodem");
}

#[test]
fn r3964() {
    passes("r3964");
}

#[test]
fn r3964_simplified() {
    passes("r3964-simplified");
}

/// Each scenario with a machine catches at least one converter that does its work but for
/// one thing, and by what that does: a broken rule of the ABI is no substitute.
#[test]
fn each_scenario_catches_a_wrong_converter() {
    let mut blind = Vec::new();
    for (profile, plugins) in PROFILES {
        for script in all().iter().filter(|script| script.profile == *profile) {
            if !Wrong::ALL.iter().any(|wrong| caught(script, plugins[0], *wrong)) {
                blind.push(script.id.clone());
            }
        }
    }
    assert!(blind.is_empty(), "these catch nothing: {blind:?}");
}

/// What any plug-in must bear is broken by each of these in its own way.
#[test]
fn each_script_of_the_abi_catches_a_wrong_converter() {
    let mut blind = Vec::new();
    for script in all().iter().filter(|script| script.profile == "abi") {
        let plugins = ["xon-xoff", "r3964", "fanuc-rs232"];
        let is_caught = |wrong| plugins.iter().any(|plugin| caught(script, plugin, wrong));
        if !Wrong::OF_THE_ABI.iter().any(|wrong| is_caught(*wrong)) {
            blind.push(script.id.clone());
        }
    }
    assert!(blind.is_empty(), "these catch nothing: {blind:?}");
}

/// The rules that the lint of a corpus holds traces to.
#[test]
fn ids_are_slugs_of_their_profile_and_none_is_there_twice() {
    let all = all();
    for (place, script) in all.iter().enumerate() {
        assert!(script.id.starts_with(&format!("{}.", script.profile)), "{}", script.id);
        assert!(softplug_trace::is_slug(&script.id), "{}", script.id);
        assert!(script.title.len() <= 120, "{}: {}", script.id, script.title.len());
        assert!(!script.clauses.is_empty(), "{}", script.id);
        assert!(place == 0 || all[place - 1].id < script.id, "{} is there twice", script.id);
    }
}
