//! A way that an exploration found, as traces: one for each plug-in on it.

use crate::given::case::Case;
use crate::given::lines::{assignments, entry, line_settings};
use crate::judge::run::{Filter, Judge, run_all};
use crate::judge::verdict::Verdict;
use crate::random::given_as;
use crate::run::permute::Permutation;
use crate::run::seen::Seen;
use crate::run::transcript;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Micros, ModemLines};
use softplug_explore::{Breach, Exploration, Log, Plan, Setup, Way};
use softplug_link::LinkOptions;
use softplug_trace::{
    Entry, FrontMatter, Level, Line, ModemLevels, Origin, Permutations, Room, Trace, What,
};

/// Bytes that stand on one line.
const BYTES: usize = 64;

/// A way as each plug-in on it saw it; with what it leads to, and the command that finds it, as
/// comments. A trace demands what the plug-in did: whoever mends it
/// writes down what it should have done.
///
/// ```no_run
/// use softplug_abi::manifest::Manifest;
/// use softplug_conformance::{rows_of_way, traces_of_way};
/// use softplug_explore::{Bounds, Changes, explore, plans};
/// use std::sync::atomic::AtomicBool;
///
/// let module = std::fs::read("broken.wasm")?;
/// let manifest = softplug_host::lint(&module)?.manifest;
/// let (bounds, changes) = (Bounds::default(), Changes::default());
/// let never = AtomicBool::new(false);
/// let plan = plans("r3964")?[0];
/// let explored = explore(&module, plan, &changes, &bounds, &|_| {}, &never)?;
/// if let Some(found) = &explored.counterexample {
///     for row in rows_of_way(explored.setup.begin, &found.way) {
///         println!("{} µs: {}", row.at_us, row.text);
///     }
///     let again = "softplug explore PLUGIN --profile r3964 --only one-block";
///     let what = Some((&found.breach, again));
///     for trace in traces_of_way(&explored.setup, &found.way, what, plan, &manifest) {
///         println!("{}", trace.format());
///     }
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn traces_of_way(
    setup: &Setup,
    way: &Way,
    leads_to: Option<(&Breach, &str)>,
    plan: &Plan,
    manifest: &Manifest,
) -> Vec<Trace> {
    let trace = |(end, log): (usize, &Log)| Trace {
        front: front(setup, leads_to.map(|(breach, _)| breach), plan, end),
        body: body(setup, way, leads_to, log, manifest),
    };
    way.logs.iter().enumerate().map(trace).collect()
}

/// Runs the [sample](Exploration::sample) of an exploration with the plug-in itself, outside of
/// what it was explored in: the first way on which it does something else. Then what was explored
/// is not the plug-in.
///
/// ```no_run
/// use softplug_conformance::{Sandboxed, differs_from_explored};
/// use softplug_explore::{Bounds, Changes, explore, plans};
/// use softplug_host::{Host, HostOptions};
/// use std::sync::atomic::AtomicBool;
///
/// let module = std::fs::read("target/plugins/r3964.wasm")?;
/// let (bounds, changes) = (Bounds::default(), Changes::default());
/// let (plan, never) = (plans("r3964")?[0], AtomicBool::new(false));
/// let explored = explore(&module, plan, &changes, &bounds, &|_| {}, &never)?;
/// let plugin = Host::new(HostOptions::default())?.load_bytes(&module)?;
/// assert!(differs_from_explored(&Sandboxed::new(plugin), &explored, plan).is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn differs_from_explored(
    plugin: &dyn Judge,
    explored: &Exploration,
    plan: &Plan,
) -> Option<Verdict> {
    let traces = explored
        .sample
        .iter()
        .flat_map(|way| traces_of_way(&explored.setup, way, None, plan, plugin.manifest()));
    let cases: Vec<Case> = traces.map(|trace| Case::new("explored.spt", trace)).collect();
    let uncut = |case: &Case| format!("{}/{}", case.trace.front.id, Permutation::Uncut);
    let filter = Filter::only(cases.iter().map(uncut));
    let summary = run_all(&[plugin], &cases, &filter);
    summary.cases.into_iter().find(|verdict| !verdict.is_passed())
}

fn front(setup: &Setup, leads_to: Option<&Breach>, plan: &Plan, end: usize) -> FrontMatter {
    let LinkOptions { transmit_room, .. } = LinkOptions::default();
    let what = leads_to.map_or("way", Breach::name);
    FrontMatter {
        id: format!("{}.explored.{}-{what}-{end}", plan.profile, plan.name),
        title: format!("Found by exploring {}: {what}", plan.name),
        profile: plan.profile.to_owned(),
        clauses: vec![match leads_to {
            Some(Breach::Rule { clause, .. }) => clause.clone(),
            _ => plan.profile.to_owned(),
        }],
        level: Level::Must,
        edge: None,
        line: line_settings(setup.line, 1),
        config: assignments(&setup.settings[end]),
        room: Room { transmit: Some(transmit_room), delivery: Some(setup.delivery_room) },
        modem: ModemLevels::default(),
        since: 1,
        origin: Origin::Generated { generator: "softplug-explore".to_owned(), seed: 0 },
        // In another permutation, what is wrong may show otherwise.
        permute: if leads_to.is_some() { Permutations::NONE } else { Permutations::ALL },
        leaves: String::new(),
        bytes: None,
    }
}

fn body(
    setup: &Setup,
    way: &Way,
    leads_to: Option<(&Breach, &str)>,
    log: &Log,
    manifest: &Manifest,
) -> Vec<Line> {
    let since = |at: Micros| Micros(at.0 - setup.begin.0);
    let observed = log.observed.iter().cloned();
    let seen: Vec<Seen> =
        observed.filter_map(|(at, observed)| Seen::of(since(at), observed)).collect();
    // A trace opens the link by itself.
    let given = log.inputs.iter().skip(1);
    let mut entries: Vec<Entry> = given
        .filter_map(|(at, step)| {
            Some(entry(since(*at), What::Given(given_as(step, ModemLines::default())?)))
        })
        .collect();
    let given: Vec<_> = entries.iter().map(|entry| entry.when).collect();
    let is_cut = |at: Micros| given.iter().any(|when| when.from.0 == at.0 as u64);
    entries.extend(transcript::entries(setup.line, manifest, &seen, BYTES, is_cut));
    entries.sort_by_key(|entry| entry.when.from);
    let faults = way.faults.iter().map(|(at, fault)| format!(" {}: {fault}", since(*at)));
    let found = leads_to.map(|(breach, again)| [format!(" {breach}"), format!(" {again}")]);
    let comments = found.into_iter().flatten().chain(faults);
    let mut body: Vec<Line> = comments.map(Line::Comment).collect();
    body.extend(entries.into_iter().map(Line::Entry));
    body.push(Line::Entry(entry(since(log.end), What::Quiet)));
    body
}
