//! Every reference plug-in passes the scripts of its profiles, natively and under both
//! engines, and all do the same.

mod common;

use common::{native, sandboxed};
use softplug_conformance::script::{Script, all};

/// A profile and the reference plug-ins that claim it.
const PROFILES: &[(&str, &[&str])] = &[
    ("3964", &["r3964"]),
    ("abi", &["fanuc-rs232", "r3964", "r3964-simplified", "xon-xoff"]),
    ("fanuc-rs232", &["fanuc-rs232"]),
    ("r3964", &["r3964"]),
    ("r3964-simplified", &["r3964-simplified"]),
    ("rk512", &["r3964", "r3964-simplified"]),
    ("xon-xoff", &["xon-xoff"]),
];

fn scripts_of(plugin: &str) -> Vec<Script> {
    let claims = |script: &&Script| {
        PROFILES.iter().any(|(name, plugins)| *name == script.profile && plugins.contains(&plugin))
    };
    all().iter().filter(claims).cloned().collect()
}

fn passes(plugin: &str) {
    let native = native(plugin);
    let mut failed = Vec::new();
    for script in scripts_of(plugin) {
        let run = script.run(&native);
        if let Some(failure) = &run.failure {
            failed.push(format!("{} {failure}\n{}", script.id, run.log.join("\n")));
            continue;
        }
        assert_eq!(script.run(&native), run, "{}: not the same twice", script.id);
    }
    assert!(failed.is_empty(), "{}", failed.join("\n\n"));
}

#[test]
fn r3964() {
    passes("r3964");
}

#[test]
fn r3964_simplified() {
    passes("r3964-simplified");
}

/// The rules that the lint of a corpus holds traces to.
#[test]
fn ids_are_slugs_of_their_profile_and_none_is_there_twice() {
    let all = all();
    let is_slug = |text: &str| {
        text.bytes().all(|byte| matches!(byte, b'a'..=b'z' | b'0'..=b'9' | b'-' | b'.'))
    };
    for (place, script) in all.iter().enumerate() {
        assert!(script.id.starts_with(&format!("{}.", script.profile)), "{}", script.id);
        assert!(is_slug(&script.id) && script.id.len() <= 128, "{}", script.id);
        assert!(script.title.len() <= 120, "{}: {}", script.id, script.title.len());
        assert!(!script.clauses.is_empty(), "{}", script.id);
        assert!(place == 0 || all[place - 1].id < script.id, "{} is there twice", script.id);
    }
}
