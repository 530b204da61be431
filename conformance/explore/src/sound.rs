//! Tests that states which count as one are one: whatever comes, the same comes of them.

use crate::bounds::Bounds;
use crate::choice::Choice;
use crate::log::Log;
use crate::plans::{Plan, plans};
use crate::sandbox::Subject;
use crate::scenario::{Changes, Scenario};
use crate::search::Search;
use softplug_abi::Micros;
use softplug_models::Dice;
use std::collections::{HashMap, HashSet};
use std::path::Path;
use std::sync::Arc;

/// Pairs of ways to one state that are tried of each plan.
const PAIRS: usize = 60;
/// Choices behind the state.
const CONTINUATION: usize = 60;

/// Two ways that lead to states with one hash.
type Pair = (Vec<Choice>, Vec<Choice>);

fn module(name: &str) -> Vec<u8> {
    let built = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/plugins");
    let folder = std::env::var_os("SOFTPLUG_PLUGINS").map_or(built, Into::into);
    let file = folder.join(format!("{name}.wasm"));
    std::fs::read(&file).unwrap_or_else(|error| {
        panic!("{}: {error}; `cargo xtask build` makes the plug-ins", file.display())
    })
}

/// Different ways to one state, spread over the exploration.
fn pairs(search: &Search<'_>) -> Vec<Pair> {
    let sandboxes = search.sandboxes().unwrap();
    let (first, _) = search.open(&sandboxes, false).unwrap();
    let mut known = HashMap::from([(first.hash(), Vec::new())]);
    let mut frontier = vec![(Vec::new(), first)];
    let mut pairs: Vec<Pair> = Vec::new();
    while !frontier.is_empty() {
        let mut next = Vec::new();
        for (way, world) in frontier {
            for choice in world.choices() {
                let mut world = world.fork();
                assert_eq!(world.make(choice).breach, None, "{way:?} {choice:?}");
                let mut way: Vec<Choice> = way.clone();
                way.push(choice);
                if let Some(other) = known.get(&world.hash()) {
                    pairs.push((Vec::clone(other), way));
                } else {
                    known.insert(world.hash(), way.clone());
                    next.push((way, world));
                }
            }
        }
        frontier = next;
    }
    let step = (pairs.len() / PAIRS).max(1);
    pairs.into_iter().step_by(step).collect()
}

/// What happened behind `from`, counted from there.
fn behind(logs: &[Log], from: Micros) -> Vec<String> {
    let since = |at: Micros| at.0 - from.0;
    let told = logs.iter().flat_map(|log| {
        let inputs = log.inputs.iter().filter(|(at, _)| *at > from);
        let inputs = inputs.map(|(at, step)| format!("{} {step:?}", since(*at)));
        let observed = log.observed.iter().filter(|(at, _)| *at > from);
        inputs.chain(observed.map(|(at, observed)| format!("{} {observed:?}", since(*at))))
    });
    told.collect()
}

/// With a search of this plan with one fault.
fn with_search(plan: &Plan, plugin: &str, work: impl FnOnce(&Search<'_>)) {
    let subject = Subject::new(&module(plugin), None).unwrap();
    let manifest = subject.plugin.manifest().clone();
    let scenario = Arc::new(Scenario::new(plan, &manifest, &Changes::default()).unwrap());
    let subjects = vec![subject; 2];
    let bounds = Bounds { faults: 1, ..Bounds::default() };
    work(&Search::new(&subjects, scenario, &bounds));
}

fn answer_alike(plan: &Plan, search: &Search<'_>) {
    let pairs = pairs(search);
    assert!(pairs.len() >= PAIRS / 2, "{}: {}", plan.name, pairs.len());
    let sandboxes = search.sandboxes().unwrap();
    let mut dice = Dice::new(7, plan.profile, 0);
    for (one, other) in pairs {
        let mut worlds = [&one, &other].map(|way| {
            let (mut world, _) = search.open(&sandboxes, true).unwrap();
            for choice in way {
                world.make(*choice);
            }
            world
        });
        let from = [worlds[0].now, worlds[1].now];
        for _ in 0..CONTINUATION {
            let choices = worlds[0].choices();
            assert_eq!(choices, worlds[1].choices(), "{one:?} {other:?}");
            assert_eq!(worlds[0].hash(), worlds[1].hash(), "{one:?} {other:?}");
            if choices.is_empty() {
                break;
            }
            let choice = *dice.pick(&choices);
            let [first, second] = worlds.each_mut().map(|world| world.make(choice));
            assert_eq!(first, second, "{one:?} {other:?} {choice:?}");
        }
        let [first, second] = worlds.map(super::world::World::into_logs);
        assert_eq!(behind(&first, from[0]), behind(&second, from[1]), "{one:?} {other:?}");
    }
}

#[test]
fn equal_states_answer_alike() {
    let plugins = ["r3964", "r3964-simplified", "xon-xoff", "fanuc-rs232", "heidenhain-fe"];
    for plugin in plugins {
        for plan in plans(plugin).unwrap().into_iter().take(2) {
            with_search(plan, plugin, |search| answer_alike(plan, search));
        }
    }
}

/// Of two things at one instant at different ends, only one order is tried. In every state where
/// there are such, the other one leads to the same state: it need not be tried.
fn orders_lead_to_one_state(plan: &Plan, search: &Search<'_>) {
    let sandboxes = search.sandboxes().unwrap();
    let (first, _) = search.open(&sandboxes, false).unwrap();
    let mut known = HashSet::from([first.hash()]);
    let mut frontier = vec![first];
    let mut compared = 0;
    while let Some(world) = frontier.pop() {
        if let Some([one, other]) = world.in_both_orders() {
            assert_eq!(one, other, "{} at {} µs", plan.name, world.now);
            compared += 1;
        }
        for choice in world.choices() {
            let mut next = world.fork();
            next.make(choice);
            if known.insert(next.hash()) {
                frontier.push(next);
            }
        }
    }
    assert!(compared > 100, "{}: {compared}", plan.name);
}

#[test]
fn the_order_of_what_is_due_at_different_ends_changes_nothing() {
    for (plugin, name) in [
        ("r3964", "one-block"),
        ("r3964-simplified", "one-block"),
        ("xon-xoff", "hold"),
        ("fanuc-rs232", "read-and-punch"),
        ("heidenhain-fe", "both-ways"),
    ] {
        let plan = plans(plugin).unwrap().into_iter().find(|plan| plan.name == name).unwrap();
        with_search(plan, plugin, |search| orders_lead_to_one_state(plan, search));
    }
}
