//! A way that an exploration found, as traces: one for each plug-in on it.

use crate::given::lines::{assignments, entry, line_settings};
use crate::random::given_as;
use crate::run::effect::Effect;
use crate::run::outcome::Seen;
use crate::run::transcript;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Micros, ModemLines};
use softplug_explore::{Breach, Counterexample, Exploration, Log, Plan};
use softplug_link::LinkOptions;
use softplug_trace::{
    Entry, FrontMatter, Level, Line, ModemLevels, Origin, Permutations, Room, Trace, What,
};

/// Bytes that stand on one line.
const BYTES: usize = 64;
/// Nothing more happens for so long behind the last step.
const TAIL: Micros = Micros(1);

/// The way to what must never be, as each plug-in saw it. A trace demands what the plug-in did:
/// whoever mends it writes down what it should have done.
///
/// ```no_run
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::traces_of_way;
/// use softplug_explore::{Bounds, Changes, explore, plans};
/// use std::sync::atomic::AtomicBool;
///
/// let module = std::fs::read("broken.wasm")?;
/// let manifest = softplug_host::lint(&module)?.manifest;
/// let (bounds, changes) = (Bounds::default(), Changes::default());
/// let never = AtomicBool::new(false);
/// let plan = plans("r3964")?[0];
/// let explored = explore(&module, plan, &changes, &bounds, &|_| {}, &never)?;
/// if let Some(way) = &explored.counterexample {
///     for trace in traces_of_way(&explored, way, plan, &manifest) {
///         println!("{}", trace.format());
///     }
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn traces_of_way(
    explored: &Exploration,
    way: &Counterexample,
    plan: &Plan,
    manifest: &Manifest,
) -> Vec<Trace> {
    let trace = |(end, log): (usize, &Log)| Trace {
        front: front(explored, way, plan, end),
        body: body(explored, way, log, manifest),
    };
    way.logs.iter().enumerate().map(trace).collect()
}

fn front(explored: &Exploration, way: &Counterexample, plan: &Plan, end: usize) -> FrontMatter {
    let LinkOptions { transmit_room, .. } = LinkOptions::default();
    FrontMatter {
        id: format!("{}.explored.{}-{}-{end}", plan.profile, plan.name, way.breach.name()),
        title: format!("Found by exploring: {}", way.breach),
        profile: plan.profile.to_owned(),
        clauses: vec![match &way.breach {
            Breach::Rule { clause, .. } => clause.clone(),
            _ => plan.profile.to_owned(),
        }],
        level: Level::Must,
        edge: None,
        line: line_settings(explored.line, 1),
        config: assignments(&explored.settings[end]),
        room: Room { transmit: Some(transmit_room), delivery: Some(explored.delivery_room) },
        modem: ModemLevels::default(),
        since: 1,
        origin: Origin::Generated { generator: "softplug-explore".to_owned(), seed: 0 },
        permute: Permutations::ALL,
        leaves: String::new(),
        bytes: None,
    }
}

fn body(explored: &Exploration, way: &Counterexample, log: &Log, manifest: &Manifest) -> Vec<Line> {
    let observed = log.observed.iter().cloned();
    let since = |at: Micros| Micros(at.0 - explored.begin.0);
    let seen: Vec<Seen> = observed
        .filter_map(|(at, observed)| Some(Seen { at: since(at), effect: Effect::of(observed)? }))
        .collect();
    // A trace opens the link by itself.
    let given = log.inputs.iter().skip(1);
    let mut entries: Vec<Entry> = given
        .filter_map(|(at, step)| Some(entry(since(*at), given_as(step, ModemLines::default())?)))
        .collect();
    let given: Vec<_> = entries.iter().map(|entry| entry.when).collect();
    let is_cut = |at: Micros| given.iter().any(|when| when.from.0 == at.0 as u64);
    entries.extend(transcript::entries(explored.line, manifest, &seen, BYTES, is_cut));
    entries.sort_by_key(|entry| entry.when.from);
    let choices = way.path.iter().filter(|choice| choice.is_fault());
    let comments = choices.map(|choice| format!(" {choice}"));
    let mut body: Vec<Line> = comments.map(Line::Comment).collect();
    body.extend(entries.into_iter().map(Line::Entry));
    body.push(Line::Entry(entry(since(log.end) + TAIL, What::Quiet)));
    body
}
