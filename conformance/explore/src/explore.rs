//! An exploration as a whole.

use crate::ExploreError;
use crate::bounds::{Bounds, Kept, Progress};
use crate::choice::Choice;
use crate::graph::Ends;
use crate::hash::Hash128;
use crate::keep::Keep;
use crate::log::Log;
use crate::marked::Marked;
use crate::plans::Plan;
use crate::promise::Breach;
use crate::sandbox::Subject;
use crate::scenario::{Changes, Scenario, Setup};
use crate::search::{Frontier, Search};
use softplug_abi::Micros;
use std::collections::BTreeMap;
use std::hash::Hash;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Ways that are given to be tried.
const SAMPLE: u64 = 32;
/// Choices of all of them at most.
const SAMPLE_CHOICES: usize = 10_000;

/// What came of an exploration.
///
/// ```no_run
/// use softplug_explore::{Bounds, Changes, explore, plans};
/// use std::sync::atomic::AtomicBool;
///
/// let module = std::fs::read("target/plugins/r3964.wasm")?;
/// let (bounds, changes) = (Bounds::default(), Changes::default());
/// let never = AtomicBool::new(false);
/// let plan = plans("r3964")?[0];
/// let explored = explore(&module, plan, &changes, &bounds, &|_| {}, &never)?;
/// assert!(explored.is_complete && explored.counterexample.is_none());
/// assert_eq!(explored.setup.jobs[0], [b"A\x10"]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Exploration {
    /// Everything within the number of faults was seen.
    pub is_complete: bool,
    /// States that were found.
    pub states: u64,
    /// Choices that were made.
    pub transitions: u64,
    /// Choices from the first state to the last one.
    pub depth: u32,
    /// The plug-in was held to the profile's model as well as to the promises.
    pub has_model: bool,
    /// What the protocol cannot keep from happening, and how often it did.
    pub unavoidable: BTreeMap<String, u64>,
    /// From the state that takes longest: how long it takes to rest when nothing goes wrong
    /// any more. Only of a complete one.
    pub longest: Option<Micros>,
    /// The same for the same module, plan and bounds, wherever and with however many threads.
    pub digest: u128,
    /// Of a module with [marks](Marked), their words: what was executed. A search that goes on from
    /// kept states knows only what it executed itself.
    pub marks: Vec<u64>,
    /// The shortest way to something that must never be.
    pub counterexample: Option<Counterexample>,
    /// Ways to some of the states, from all over: whoever does not believe what was explored can
    /// run them.
    pub sample: Vec<Way>,
    /// What the plug-ins were given from the start.
    pub setup: Setup,
}

/// A way to something that must never be.
///
/// The example of [`Exploration`] looks for one.
#[derive(Debug)]
pub struct Counterexample {
    /// What must never be.
    pub breach: Breach,
    /// The way that leads to it.
    pub way: Way,
}

/// A way from the beginning to some state.
///
/// The example of [`Exploration`] looks for one.
#[derive(Debug)]
pub struct Way {
    /// The choices that lead there.
    pub path: Vec<Choice>,
    /// Those of them that are faults, and when.
    pub faults: Vec<(Micros, Choice)>,
    /// What each plug-in was given on the way, and what it did.
    pub logs: Vec<Log>,
}

/// Explores a module by a plan.
///
/// `tell` is called at each level, `stop` ends it.
///
/// # Errors
/// The module is no plug-in or cannot be explored, or a setting is not its own.
///
/// The example of [`Exploration`] shows it.
pub fn explore(
    module: &[u8],
    plan: &Plan,
    changes: &Changes,
    bounds: &Bounds,
    tell: &(dyn Fn(Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Exploration, ExploreError> {
    let subject = Subject::new(module, None)?;
    explore_subject(module, subject, plan, changes, bounds, tell, stop)
}

/// The same, and what of the module is executed. Marks change nothing of what is found.
///
/// # Errors
/// As those of [`explore`].
///
/// The example of [`Marked`] shows it.
pub fn explore_marked(
    module: &[u8],
    marked: &Marked,
    plan: &Plan,
    changes: &Changes,
    bounds: &Bounds,
    tell: &(dyn Fn(Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Exploration, ExploreError> {
    let subject = Subject::new(module, Some(marked))?;
    explore_subject(module, subject, plan, changes, bounds, tell, stop)
}

fn explore_subject(
    module: &[u8],
    subject: Subject,
    plan: &Plan,
    changes: &Changes,
    bounds: &Bounds,
    tell: &(dyn Fn(Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Exploration, ExploreError> {
    let scenario = Arc::new(Scenario::new(plan, subject.plugin.manifest(), changes)?);
    let subjects = vec![subject; plan.plug_ins()];
    let mut search = Search::new(&subjects, Arc::clone(&scenario), bounds);
    let key = key(module, plan, &scenario, changes, bounds.faults);
    let (frontier, keep) = search.begin(key)?;
    let is_complete = search.go_on(frontier, tell, stop, keep)?;
    let ends = is_complete.then(|| search.graph.ends());
    if let Some(Ends { endless: Some(state), .. }) = ends {
        search.breaches.push((Breach::NeverEnds, search.graph.path_to(state)));
    }
    let found = match search.breaches.first() {
        Some((breach, path)) => Some((breach.clone(), search.way(path.clone())?)),
        None if is_complete => search.doubt(plan)?,
        None => None,
    };
    let counterexample = found.map(|(breach, way)| Counterexample { breach, way });
    let sample = search.sample()?;
    let graph = &search.graph;
    Ok(Exploration {
        is_complete: is_complete && counterexample.is_none(),
        states: graph.states(),
        transitions: graph.transitions,
        depth: graph.depth(),
        has_model: scenario.model(0).is_some(),
        unavoidable: graph.unavoidable.clone(),
        longest: ends.filter(|_| counterexample.is_none()).map(|ends| ends.longest),
        digest: graph.digest(),
        marks: search.marks.clone(),
        counterexample,
        sample,
        setup: scenario.setup(),
    })
}

/// Equal for searches that find the same states and judge them alike.
fn key(module: &[u8], plan: &Plan, scenario: &Scenario, changes: &Changes, faults: u8) -> u128 {
    let mut state = Hash128::new();
    (env!("CARGO_PKG_VERSION"), module, plan.profile, plan.name, faults).hash(&mut state);
    (&scenario.asked, changes.without_model).hash(&mut state);
    for jobs in &scenario.jobs {
        jobs.len().hash(&mut state);
        for job in jobs {
            job.data.hash(&mut state);
        }
    }
    state.finish_128()
}

impl Search<'_> {
    /// The first state, or all that were kept.
    fn begin(&mut self, key: u128) -> Result<(Frontier, Option<Keep>), ExploreError> {
        // One that was ended before may not have come to this one.
        if let Some(Kept { file, goes_on: true }) = &self.bounds.keep
            && file.exists()
        {
            let (keep, levels) = Keep::open(file, key)?;
            if !levels.is_empty() {
                if !levels.into_iter().all(|level| self.graph.add_level(level)) {
                    return Err(ExploreError::Differs);
                }
                return Ok((self.latest(), Some(keep)));
            }
        }
        let frontier = self.start()?;
        let mut keep = match &self.bounds.keep {
            Some(Kept { file, .. }) => Some(Keep::create(file, key)?),
            None => None,
        };
        if let Some(keep) = &mut keep {
            keep.level(&self.graph)?;
        }
        Ok((frontier, keep))
    }

    /// Ways from all over.
    fn sample(&self) -> Result<Vec<Way>, ExploreError> {
        let states = self.graph.states();
        let spread = (0..states).step_by((states / SAMPLE + 1) as usize);
        let mut rest = SAMPLE_CHOICES;
        let mut sample = Vec::new();
        for state in spread {
            let path = self.graph.path_to(state as u32);
            if let Some(left) = rest.checked_sub(path.len()) {
                rest = left;
                sample.push(self.way(path)?);
            }
        }
        Ok(sample)
    }

    /// Goes a way once more and writes down what happens on it.
    pub(crate) fn way(&self, path: Vec<Choice>) -> Result<Way, ExploreError> {
        let sandboxes = self.sandboxes()?;
        let (mut world, _) = self.open(&sandboxes, true)?;
        let mut faults = Vec::new();
        for choice in &path {
            if choice.is_fault() {
                faults.push((world.time_of(*choice), *choice));
            }
            world.make(*choice);
        }
        Ok(Way { path, faults, logs: world.into_logs() })
    }
}
