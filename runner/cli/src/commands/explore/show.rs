//! What was found, for people and for machines.

use std::collections::BTreeMap;
use std::path::PathBuf;

use data_encoding::HEXLOWER;
use serde::Serialize;
use softplug_conformance::rows_of_way;
use softplug_explore::{Counterexample, Exploration, Plan, Setup, Walked};
use softplug_report::Coverage;

use crate::numbers::{count, things};
use crate::screen::{BAD, GOOD, HEADING, Screen, WARNING};
use crate::sequence;

/// What was found in all configurations, for machines.
#[derive(Serialize)]
pub(super) struct All<'a> {
    pub(super) profile: &'a str,
    pub(super) faults: u8,
    pub(super) explored: Vec<Explored>,
}

/// One configuration.
#[derive(Serialize)]
pub(super) struct Explored {
    name: &'static str,
    partner: &'static str,
    settings: [Vec<(String, String)>; 2],
    jobs: [Vec<String>; 2],
    held_to_promises: bool,
    held_to_model: bool,
    pub(super) complete: bool,
    states: u64,
    transitions: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    depth: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    longest_to_rest_micros: Option<i64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    random: Option<Random>,
    unavoidable: BTreeMap<String, u64>,
    digest: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) counterexample: Option<Found>,
}

/// Of random ways.
#[derive(Serialize)]
pub(super) struct Random {
    pub(super) seed: u64,
    pub(super) rounds: u32,
    pub(super) coverage: Coverage,
}

/// The way to something that must never be.
#[derive(Serialize)]
pub(super) struct Found {
    breach: &'static str,
    text: String,
    choices: Vec<String>,
    traces: Vec<PathBuf>,
}

impl Explored {
    pub(super) fn whole(
        explored: &Exploration,
        plan: &Plan,
        is_judged: bool,
        traces: Vec<PathBuf>,
    ) -> Self {
        Self {
            held_to_promises: is_judged,
            held_to_model: explored.has_model,
            complete: explored.is_complete,
            states: explored.states,
            transitions: explored.transitions,
            depth: Some(explored.depth),
            longest_to_rest_micros: explored.longest.map(|time| time.0),
            unavoidable: explored.unavoidable.clone(),
            digest: digest(explored.digest),
            ..Self::new(plan, &explored.setup, explored.counterexample.as_ref(), traces)
        }
    }

    pub(super) fn random(
        walked: &Walked,
        plan: &Plan,
        is_judged: bool,
        rounds: u32,
        random: Random,
        traces: Vec<PathBuf>,
    ) -> Self {
        Self {
            held_to_promises: is_judged,
            held_to_model: walked.has_model,
            complete: random.rounds == rounds,
            states: walked.states,
            transitions: walked.choices,
            random: Some(random),
            unavoidable: walked.unavoidable.clone(),
            digest: digest(walked.digest),
            ..Self::new(plan, &walked.setup, walked.counterexample.as_ref(), traces)
        }
    }

    /// What both have.
    fn new(
        plan: &Plan,
        setup: &Setup,
        counterexample: Option<&Counterexample>,
        traces: Vec<PathBuf>,
    ) -> Self {
        Self {
            name: plan.name,
            partner: plan.partner,
            settings: setup.settings.clone(),
            jobs: [0, 1]
                .map(|end| setup.jobs[end].iter().map(|data| HEXLOWER.encode(data)).collect()),
            held_to_promises: false,
            held_to_model: false,
            complete: false,
            states: 0,
            transitions: 0,
            depth: None,
            longest_to_rest_micros: None,
            random: None,
            unavoidable: BTreeMap::new(),
            digest: String::new(),
            counterexample: counterexample.map(|found| Found {
                breach: found.breach.name(),
                text: found.breach.to_string(),
                choices: found.way.path.iter().map(ToString::to_string).collect(),
                traces,
            }),
        }
    }

    /// For people: beside what was found, if anything was.
    pub(super) fn show(&self, found: Option<&Counterexample>, setup: &Setup, screen: &Screen) {
        let name = self.name;
        match found {
            Some(found) => {
                screen.say(format_args!("{BAD}found{BAD:#} in {name}: {}", found.breach));
                screen.say(sequence::drawn(&rows_of_way(setup.begin, &found.way)));
                for file in self.counterexample.iter().flat_map(|found| &found.traces) {
                    screen.say(format_args!("  trace: {}", file.display()));
                }
            }
            None if self.complete && self.random.is_some() => {
                screen.say(format_args!("{GOOD}nothing{GOOD:#} was found in {name}"));
            }
            None if self.complete => screen.say(format_args!(
                "{GOOD}complete{GOOD:#}: {name}, nothing that must never be can happen"
            )),
            None if self.random.is_some() => screen.say(format_args!(
                "{WARNING}incomplete{WARNING:#}: {name}, it ended before all rounds; nothing was found so far"
            )),
            None => screen.say(format_args!(
                "{WARNING}incomplete{WARNING:#}: {name}, it ended before all was seen; nothing was found so \
                 far"
            )),
        }
        let row = |title: &str, text: String| {
            screen.say(format_args!("  {HEADING}{title:<9}{HEADING:#}{text}"));
        };
        row("partner", self.partner.to_owned());
        let held = match (self.held_to_promises, self.held_to_model) {
            (true, true) => "the promises and the profile's model",
            (true, false) => "the promises",
            (false, true) => "the profile's model; the partner knows no other settings",
            (false, false) => "the rules of the ABI; the partner knows no other settings",
        };
        row("held to", held.to_owned());
        let (states, choices) = (things(self.states, "state"), count(self.transitions));
        if let Some(depth) = self.depth {
            row("explored", format!("{states}, {choices} choices, {depth} deep"));
        }
        if let Some(Random { seed, rounds, coverage }) = &self.random {
            let rounds = things(u64::from(*rounds), "round");
            row("walked", format!("{states}, {choices} choices, {rounds}, seed {seed}"));
            let Coverage { functions, branches, .. } = coverage;
            row(
                "executed",
                format!(
                    "{} of {} functions, {} of {} ways of branches",
                    functions.executed, functions.of, branches.executed, branches.of
                ),
            );
        }
        if let Some(time) = self.longest_to_rest_micros {
            let time = time as f64 / 1e6;
            row("rest", format!("at most {time:.3} s after the last fault, from every state"));
        }
        if !self.unavoidable.is_empty() {
            let counted = self.unavoidable.iter();
            let counted = counted.map(|(name, times)| format!("{name} {}", count(*times)));
            let counted = counted.collect::<Vec<_>>().join(", ");
            row("allowed", format!("what the protocol cannot keep from happening: {counted}"));
        }
        row("digest", self.digest.clone());
    }
}

fn digest(digest: u128) -> String {
    format!("{digest:032x}")
}
