//! The reference plug-ins, explored.
#![cfg(feature = "wasmtime")]

use crate::common::{module, sandboxed};
use serde::Deserialize;
use softplug_conformance::{Places, differs_from_explored, explore_profile};
use softplug_explore::{
    Bounds, Breach, Changes, Exploration, Kept, LARGER, PLANS, Plan, Walked, Walks, explore,
    larger, plans, walk,
};
use std::collections::{BTreeMap, BTreeSet};
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
fn states_that_are_not_held_are_made_again() {
    let plan = configuration("xon-xoff", "hold");
    let all_held = course(&explored(plan, &Changes::default(), &with_faults(1)));
    for held in [0, 7] {
        let bounds = Bounds { held, ..with_faults(1) };
        assert_eq!(course(&explored(plan, &Changes::default(), &bounds)), all_held, "{held}");
    }
}

fn walked(profile: &str, walks: Walks, bounds: &Bounds) -> Walked {
    let module = module(plugin_of(profile));
    let marked = Places::of(&module).and_then(|places| places.marked(&module));
    let marked = marked.expect("it can be marked");
    let (plan, never) = (larger(profile).expect("there is one"), AtomicBool::new(false));
    walk(&module, &marked, plan, &Changes::default(), bounds, walks, &|_| {}, &never)
        .expect("it can be walked through")
}

#[test]
fn random_ways_find_nothing_whatever_the_threads() {
    for plan in LARGER {
        let [one, two] = [1, 2].map(|threads| {
            let walks = Walks { seed: 3, rounds: 2 };
            let bounds = Bounds { threads, ..with_faults(3) };
            let walked = walked(plan.profile, walks, &bounds);
            let found = walked.counterexample.map(|found| (found.breach, found.way.path));
            assert_eq!(found, None, "{}", plan.profile);
            (walked.digest, walked.states, walked.choices, walked.marks)
        });
        assert_eq!(one, two, "{}", plan.profile);
        assert!(one.2 >= 40_000, "{}: {}", plan.profile, one.2);
    }
    let other_seed = walked("xon-xoff", Walks { seed: 4, rounds: 2 }, &with_faults(3));
    let same_seed = walked("xon-xoff", Walks { seed: 3, rounds: 2 }, &with_faults(3));
    assert_ne!(other_seed.digest, same_seed.digest);
}

#[derive(Deserialize)]
struct Promises {
    promise: Vec<Promise>,
}

#[derive(Deserialize)]
struct Promise {
    name: String,
    sentence: String,
    #[serde(default)]
    unavoidable: Vec<Unavoidable>,
}

#[derive(Deserialize)]
struct Unavoidable {
    profiles: Vec<String>,
    why: String,
}

#[test]
fn the_ledger_of_promises_is_what_is_explored_and_what_the_page_says() {
    let ledger: Promises = toml::from_str(softplug_fixtures::PROMISES).expect("it is a ledger");
    let names: Vec<_> = ledger.promise.iter().map(|promise| promise.name.as_str()).collect();
    assert_eq!(names, Breach::NAMES);
    let page = include_str!("../../../docs/explore.md");
    let mut unavoidable: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for promise in &ledger.promise {
        assert!(page.contains(&format!("| {} | `{}` |", promise.sentence, promise.name)));
        for excuse in &promise.unavoidable {
            assert!(page.contains(&excuse.why), "{}", excuse.why);
            for profile in &excuse.profiles {
                unavoidable.entry(profile).or_default().insert(&promise.name);
            }
        }
    }
    let mut explored: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for plan in PLANS.iter().chain(LARGER) {
        explored.entry(plan.profile).or_default().extend(plan.unavoidable());
    }
    assert_eq!(unavoidable, explored);
}

#[test]
fn a_profile_is_explored_for_a_report() {
    let module = module("xon-xoff");
    let (bounds, never) = (Bounds { faults: 1, ..Bounds::default() }, AtomicBool::new(false));
    let explored = explore_profile(&module, "xon-xoff", &bounds, &|_, _| {}, &never);
    let explored = explored.expect("it can be explored").expect("it was not stopped");
    let names: Vec<_> =
        explored.configurations.iter().map(|configuration| &configuration.name).collect();
    let plans = plans("xon-xoff").expect("there are some");
    assert_eq!(names, plans.iter().map(|plan| plan.name).collect::<Vec<_>>());
    assert_eq!((explored.refused.as_deref(), explored.found()), (None, None));
    let coverage = explored.coverage.expect("it can be marked");
    assert!(coverage.adds_up() && coverage.functions.executed * 10 > coverage.functions.of * 8);
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
fn two_do_not_write_to_one_file() {
    let folder = tempfile::tempdir().expect("a folder can be made");
    let file = folder.path().join("states");
    let other = std::fs::File::create(&file).expect("a file can be made");
    other.lock().expect("it is this test's own");
    let kept = |goes_on| Kept { file: file.clone(), goes_on };
    for goes_on in [false, true] {
        let bounds = Bounds { keep: Some(kept(goes_on)), ..with_faults(0) };
        let (module, never) = (module("xon-xoff"), AtomicBool::new(false));
        let plan = configuration("xon-xoff", "hold");
        let refused = explore(&module, plan, &Changes::default(), &bounds, &|_| {}, &never);
        let text = refused.expect_err("somebody else is there").to_string();
        assert!(text.contains("another exploration is writing here"), "{text}");
    }
}

#[test]
fn it_goes_no_deeper_than_it_may() {
    for depth in [0, 3] {
        let bounds = Bounds { depth: Some(depth), ..with_faults(1) };
        let explored = explored(configuration("xon-xoff", "hold"), &Changes::default(), &bounds);
        assert_eq!((explored.depth, explored.is_complete), (depth, false));
    }
}

/// The machine at the other end knows the settings of its plan: with others it cannot say what is
/// wrong, and the model does.
#[test]
fn with_other_settings_a_machine_judges_nothing() {
    for (name, value) in [("bcc_space", "on"), ("parity", "even"), ("character_time", "231")] {
        let settings = vec![(name.to_owned(), value.to_owned())];
        let changes = Changes { settings: [settings.clone(), settings], ..Changes::default() };
        let plan = configuration("heidenhain-fe", "both-ways");
        let found = explored(plan, &changes, &with_faults(1)).counterexample;
        let found = found.map(|found| (found.breach, found.way.path));
        assert_eq!(found, None, "{name}");
    }
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
