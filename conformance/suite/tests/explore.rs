//! The reference plug-ins, explored.
#![cfg(feature = "wasmtime")]

mod common;

use common::{module, sandboxed};
use softplug_conformance::differs_from_explored;
use softplug_explore::{Bounds, Changes, Exploration, Kept, PLANS, Plan, explore, plans};
use std::sync::atomic::AtomicBool;

/// The plug-in that claims a profile.
fn plugin_of(profile: &str) -> &str {
    if profile == "3964" { "r3964" } else { profile }
}

fn explored(plan: &Plan, changes: &Changes, bounds: &Bounds) -> Exploration {
    let module = module(plugin_of(plan.profile));
    let never = AtomicBool::new(false);
    explore(&module, plan, changes, bounds, &|_| {}, &never).expect("it can be explored")
}

fn with_faults(faults: u8) -> Bounds {
    Bounds { faults, threads: 2, ..Bounds::default() }
}

/// What of two explorations must be the same.
fn course(explored: &Exploration) -> (u128, u64, u64, u32) {
    (explored.digest, explored.states, explored.transitions, explored.depth)
}

/// One configuration of a profile.
fn configuration(profile: &str, name: &str) -> &'static Plan {
    let plans = plans(profile).expect("it has some");
    plans.into_iter().find(|plan| plan.name == name).expect("it has this one")
}

#[test]
fn every_configuration_is_complete_with_one_fault_and_is_the_plug_ins_course() {
    for plan in PLANS {
        let explored = explored(plan, &Changes::default(), &with_faults(1));
        let what = format!("{} {}", plan.profile, plan.name);
        let found = explored.counterexample.as_ref();
        let breach = found.map(|found| (&found.breach, &found.way.path));
        assert_eq!(breach, None, "{what}");
        assert!(explored.is_complete && explored.has_model, "{what}");
        assert!(explored.sample.len() > 20, "{what}: {}", explored.sample.len());
        let differs = differs_from_explored(&sandboxed(plugin_of(plan.profile)), &explored, plan);
        assert_eq!(differs, None, "{what}");
        assert!(explored.states > 300, "{what}: {}", explored.states);
    }
}

#[test]
fn two_faults_are_seen_whole_where_there_are_few_states() {
    for (profile, name) in [("xon-xoff", "receive"), ("xon-xoff", "end-mark")] {
        let explored = explored(configuration(profile, name), &Changes::default(), &with_faults(2));
        assert!(explored.is_complete, "{profile} {name}");
        assert!(explored.states > 5_000, "{profile} {name}: {}", explored.states);
    }
}

#[test]
fn threads_change_nothing() {
    let plan = configuration("r3964", "one-block");
    let [one, two, four] = [1, 2, 4].map(|threads| {
        let bounds = Bounds { threads, ..with_faults(1) };
        course(&explored(plan, &Changes::default(), &bounds))
    });
    assert_eq!((one, one), (two, four));
}

#[test]
fn whoever_was_ended_goes_on() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let file = folder.path().join("states");
    let plan = configuration("r3964", "one-block");
    let whole = course(&explored(plan, &Changes::default(), &with_faults(1)));
    let keep = |goes_on| Some(Kept { file: file.clone(), goes_on });
    let part = Bounds { depth: Some(20), keep: keep(false), ..with_faults(1) };
    assert!(!explored(plan, &Changes::default(), &part).is_complete);

    // It was ended in the middle of writing.
    let mut states = std::fs::read(&file).expect("the states are there");
    states.truncate(states.len() - 7);
    std::fs::write(&file, states).expect("the states can be written");
    let rest = Bounds { keep: keep(true), ..with_faults(1) };
    assert_eq!(course(&explored(plan, &Changes::default(), &rest)), whole);
    // And once more, from the end.
    assert_eq!(course(&explored(plan, &Changes::default(), &rest)), whole);
}

#[test]
fn states_of_something_else_are_refused() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let file = folder.path().join("states");
    let plan = configuration("r3964", "one-block");
    let keep = |goes_on| Some(Kept { file: file.clone(), goes_on });
    explored(plan, &Changes::default(), &Bounds { keep: keep(false), ..with_faults(0) });
    let module = module("r3964");
    let bounds = Bounds { keep: keep(true), ..with_faults(1) };
    let never = AtomicBool::new(false);
    let refused = explore(&module, plan, &Changes::default(), &bounds, &|_| {}, &never);
    let text = refused.expect_err("the number of faults is another").to_string();
    assert!(text.contains("was explored here"), "{text}");
}

#[test]
fn what_was_found_without_the_model_is_no_beginning_for_one_with_it() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let file = folder.path().join("states");
    let plan = configuration("r3964", "one-block");
    let keep = |goes_on| Some(Kept { file: file.clone(), goes_on });
    let without = Changes { without_model: true, ..Changes::default() };
    explored(plan, &without, &Bounds { keep: keep(false), ..with_faults(0) });
    let bounds = Bounds { keep: keep(true), ..with_faults(0) };
    let never = AtomicBool::new(false);
    let module = module("r3964");
    assert!(explore(&module, plan, &Changes::default(), &bounds, &|_| {}, &never).is_err());
}

/// Without a block check, a lost character alters the block: that is what the check is for.
#[test]
fn what_a_check_is_for_is_found() {
    let settings = vec![("bcc".to_owned(), "off".to_owned())];
    let changes = Changes {
        settings: [settings.clone(), settings],
        without_model: true,
        ..Changes::default()
    };
    let explored = explored(configuration("r3964", "one-block"), &changes, &with_faults(1));
    let found = explored.counterexample.expect("a block is altered");
    assert_eq!(found.breach.name(), "altered");
    let way = found.way;
    assert_eq!(way.path.iter().filter(|choice| choice.is_fault()).count(), 1);
    assert_eq!(way.logs.len(), 2);
}
