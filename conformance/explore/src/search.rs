//! Breadth first over all states, level by level.

use crate::ExploreError;
use crate::bounds::{Bounds, Progress};
use crate::choice::Choice;
use crate::end::Ended;
use crate::graph::{Graph, Node};
use crate::instance::{Shared, locked};
use crate::keep::Keep;
use crate::marked::add_marks;
use crate::promise::Breach;
use crate::sandbox::{Sandbox, Subject};
use crate::scenario::Scenario;
use crate::world::World;
use softplug_abi::Micros;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// The states of one level, as they go on. Those that are not held are made again from the ways
/// that lead to them.
pub(crate) type Frontier = Vec<(u32, Option<World>)>;

/// What a search has found so far.
pub(crate) struct Search<'a> {
    pub(crate) subjects: &'a [Subject],
    pub(crate) scenario: Arc<Scenario>,
    pub(crate) bounds: &'a Bounds,
    pub(crate) graph: Graph,
    /// Each with the choices that lead there, the shortest first.
    pub(crate) breaches: Vec<(Breach, Vec<Choice>)>,
    /// A bit for each place that was executed, of a module with marks.
    pub(crate) marks: Vec<u64>,
}

/// What the states of one level led to.
#[derive(Default)]
struct Expanded {
    /// New states that are held as they are, and the most that may be.
    held: usize,
    most_held: usize,
    found: HashMap<u128, Found>,
    /// From each state the usual way, and how long that takes.
    usual: Vec<(u32, u128, Micros)>,
    transitions: u64,
    unavoidable: BTreeMap<String, u64>,
    breaches: Vec<(Breach, u32, u16, Choice)>,
    /// The first choice by which the plug-in cannot be explored, and why.
    unexplorable: Option<(u32, u16, String)>,
}

struct Found {
    parent: u32,
    /// Its place among the parent's choices.
    place: u16,
    choice: Choice,
    is_under_way: bool,
    world: Option<World>,
}

impl<'a> Search<'a> {
    pub(crate) fn new(
        subjects: &'a [Subject],
        scenario: Arc<Scenario>,
        bounds: &'a Bounds,
    ) -> Self {
        let (graph, breaches, marks) = (Graph::default(), Vec::new(), Vec::new());
        Self { subjects, scenario, bounds, graph, breaches, marks }
    }
}

impl Search<'_> {
    /// The first state, or none where something is wrong with it.
    pub(crate) fn start(&mut self) -> Result<Frontier, ExploreError> {
        let sandboxes = self.sandboxes()?;
        let (world, breach) = self.open(&sandboxes, false)?;
        let node = Node { parent: 0, choice: Choice::Next, is_under_way: false };
        let number = self.graph.add(world.hash(), node);
        if let Some(breach) = breach {
            self.breaches.push((breach, Vec::new()));
            return Ok(Vec::new());
        }
        Ok(vec![(number, Some(world))])
    }

    /// The states of the latest level.
    pub(crate) fn latest(&self) -> Frontier {
        self.graph.frontier().map(|number| (number, None)).collect()
    }

    /// These states, by the ways that lead to them.
    fn again(
        &self,
        numbers: &[u32],
        sandboxes: &[Shared],
    ) -> Result<Vec<(u32, World)>, ExploreError> {
        let mut children: HashMap<u32, Vec<u32>> = HashMap::new();
        for mut number in numbers.iter().copied() {
            // Up to a state of which it is known that it is on a way.
            while number != 0 {
                let parent = self.graph.nodes[number as usize].parent;
                let known = children.entry(parent).or_default();
                known.push(number);
                if known.len() > 1 {
                    break;
                }
                number = parent;
            }
        }
        let wanted: HashSet<u32> = numbers.iter().copied().collect();
        let mut found = Vec::with_capacity(numbers.len());
        let mut waiting = vec![(0, self.open(sandboxes, false)?.0)];
        while let Some((number, world)) = waiting.pop() {
            if world.hash() != self.graph.hash_of(number) {
                return Err(ExploreError::Differs);
            }
            let choices = world.choices();
            for child in children.remove(&number).unwrap_or_default() {
                let choice = self.graph.nodes[child as usize].choice;
                if !choices.contains(&choice) {
                    return Err(ExploreError::Differs);
                }
                let mut next = world.fork();
                let outcome = next.make(choice);
                if outcome.breach.is_some() || outcome.unexplorable.is_some() {
                    return Err(ExploreError::Differs);
                }
                waiting.push((child, next));
            }
            if wanted.contains(&number) {
                found.push((number, world));
            }
        }
        Ok(found)
    }

    pub(crate) fn open(
        &self,
        sandboxes: &[Shared],
        is_logged: bool,
    ) -> Result<(World, Option<Breach>), ExploreError> {
        World::open(&self.scenario, sandboxes, self.bounds.faults, is_logged).map_err(|ended| {
            match ended {
                Ended::Fault(reason) => ExploreError::Open { reason },
                Ended::Unexplorable(reason) => ExploreError::Module { reason },
            }
        })
    }

    pub(crate) fn sandboxes(&self) -> Result<Vec<Shared>, ExploreError> {
        let sandbox = |subject: &Subject| Ok(Arc::new(Mutex::new(Sandbox::new(subject.clone())?)));
        self.subjects.iter().map(sandbox).collect()
    }

    /// Goes on from a frontier until there is nothing new, something is wrong or a bound is
    /// reached. Whether all was seen.
    pub(crate) fn go_on(
        &mut self,
        mut frontier: Frontier,
        tell: &(dyn Fn(Progress) + Sync),
        stop: &AtomicBool,
        mut keep: Option<Keep>,
    ) -> Result<bool, ExploreError> {
        let begin = Instant::now();
        let mut is_ended = false;
        let is_over = || {
            stop.load(Ordering::Relaxed)
                || self.bounds.time.is_some_and(|time| begin.elapsed() >= time)
        };
        let threads = self.bounds.threads.max(1);
        let mut sandboxes = Vec::with_capacity(threads);
        for _ in 0..threads {
            sandboxes.push(self.sandboxes()?);
        }
        while !frontier.is_empty() && self.breaches.is_empty() {
            let depth = self.graph.depth();
            let is_bound = self.bounds.depth.is_some_and(|most| depth >= most)
                || self.bounds.states.is_some_and(|most| self.graph.states() >= most);
            if is_bound || is_over() {
                break;
            }
            let progress = Progress {
                depth,
                states: self.graph.states(),
                transitions: self.graph.transitions,
                frontier: frontier.len() as u64,
            };
            tell(progress);
            let (level, is_whole) =
                self.expand(std::mem::take(&mut frontier), &sandboxes, &is_over)?;
            if let Some((.., reason)) = level.unexplorable {
                return Err(ExploreError::Module { reason });
            }
            if !is_whole {
                // Its states are not numbered, but what is wrong is wrong.
                self.add_breaches(level.breaches);
                is_ended = true;
                break;
            }
            frontier = self.merge(level);
            // One with a breach is found again by whoever goes on.
            if let Some(keep) = keep.as_mut().filter(|_| self.breaches.is_empty()) {
                keep.level(&self.graph)?;
            }
        }
        for sandbox in sandboxes.iter().flatten() {
            add_marks(&mut self.marks, locked(sandbox).marks());
        }
        Ok(frontier.is_empty() && self.breaches.is_empty() && !is_ended)
    }

    /// What comes of the states of the frontier, and whether of all of them.
    fn expand(
        &self,
        frontier: Frontier,
        sandboxes: &[Vec<Shared>],
        is_over: &(dyn Fn() -> bool + Sync),
    ) -> Result<(Expanded, bool), ExploreError> {
        // Small pieces, so that no thread waits long for another.
        const PIECE: usize = 64;
        let is_small = frontier.len() <= PIECE;
        let rest = Mutex::new(frontier.into_iter());
        let known = &self.graph;
        let work = |sandboxes: &[Shared]| {
            let mut level = Expanded::new(self.bounds);
            loop {
                let mut rest = rest.lock().unwrap_or_else(PoisonError::into_inner);
                let piece: Frontier = rest.by_ref().take(PIECE).collect();
                drop(rest);
                if piece.is_empty() {
                    return Ok((level, true));
                }
                if is_over() {
                    return Ok((level, false));
                }
                let is_missing = |(_, world): &&(u32, Option<World>)| world.is_none();
                let missing: Vec<u32> =
                    piece.iter().filter(is_missing).map(|(number, _)| *number).collect();
                for (number, world) in piece {
                    if let Some(world) = world {
                        level.expand(number, &world, sandboxes, known);
                    }
                }
                if !missing.is_empty() {
                    for (number, world) in self.again(&missing, sandboxes)? {
                        level.expand(number, &world, sandboxes, known);
                    }
                }
            }
        };
        if sandboxes.len() == 1 || is_small {
            return work(&sandboxes[0]);
        }
        std::thread::scope(|scope| {
            let threads: Vec<_> =
                sandboxes.iter().map(|sandboxes| scope.spawn(|| work(sandboxes))).collect();
            let (mut whole, mut is_whole) = (Expanded::new(self.bounds), true);
            for thread in threads {
                let (level, is_all) = thread.join().unwrap_or_else(|panic| resume_unwind(panic))?;
                whole.append(level);
                is_whole &= is_all;
            }
            Ok((whole, is_whole))
        })
    }

    /// Numbers the new states, by the first path that leads to each, whichever thread found it.
    fn merge(&mut self, level: Expanded) -> Frontier {
        let Expanded { found, mut usual, transitions, unavoidable, breaches, .. } = level;
        let mut found: Vec<(u128, Found)> = found.into_iter().collect();
        found.sort_by_key(|(_, found)| (found.parent, found.place));
        let mut frontier = Vec::with_capacity(found.len());
        self.graph.begin_level();
        for (hash, Found { parent, choice, is_under_way, world, .. }) in found {
            let node = Node { parent, choice, is_under_way };
            frontier.push((self.graph.add(hash, node), world));
        }
        usual.sort_by_key(|(from, ..)| *from);
        for (from, to, time) in usual {
            self.graph.set_usual(from, to, time);
        }
        self.graph.count(transitions, unavoidable);
        self.add_breaches(breaches);
        frontier
    }

    fn add_breaches(&mut self, mut breaches: Vec<(Breach, u32, u16, Choice)>) {
        breaches.sort_by_key(|(_, parent, place, _)| (*parent, *place));
        for (breach, parent, _, choice) in breaches {
            let mut path = self.graph.path_to(parent);
            path.push(choice);
            self.breaches.push((breach, path));
        }
    }
}

impl Expanded {
    /// What one of the threads finds.
    fn new(bounds: &Bounds) -> Self {
        Self { most_held: bounds.held / bounds.threads.max(1), ..Self::default() }
    }

    /// Makes every choice of a state.
    fn expand(&mut self, number: u32, world: &World, sandboxes: &[Shared], known: &Graph) {
        for (place, choice) in world.choices().into_iter().enumerate() {
            let place = place as u16;
            let mut next = world.fork();
            next.move_to(sandboxes);
            let outcome = next.make(choice);
            self.transitions += 1;
            for name in outcome.unavoidable {
                *self.unavoidable.entry(name.to_owned()).or_default() += 1;
            }
            if let Some(why) = outcome.unexplorable {
                self.cannot_be_explored((number, place, why));
                continue;
            }
            if let Some(breach) = outcome.breach {
                self.breaches.push((breach, number, place, choice));
                continue;
            }
            let hash = next.hash();
            if place == 0 && !choice.is_fault() {
                self.usual.push((number, hash, Micros(next.now.0 - world.now.0)));
            }
            if !known.contains(hash) {
                let is_under_way = next.is_under_way();
                let world = (self.held < self.most_held).then_some(next);
                self.held += usize::from(world.is_some());
                self.find(hash, Found { parent: number, place, choice, is_under_way, world });
            }
        }
    }

    fn find(&mut self, hash: u128, found: Found) {
        use std::collections::hash_map::Entry;
        match self.found.entry(hash) {
            Entry::Vacant(entry) => {
                entry.insert(found);
            }
            Entry::Occupied(mut entry) => {
                let first = entry.get();
                if (found.parent, found.place) < (first.parent, first.place) {
                    entry.insert(found);
                }
            }
        }
    }

    fn cannot_be_explored(&mut self, here: (u32, u16, String)) {
        let first = self.unexplorable.take().into_iter().chain([here]).min();
        self.unexplorable = first;
    }

    fn append(&mut self, other: Self) {
        if let Some(why) = other.unexplorable {
            self.cannot_be_explored(why);
        }
        for (hash, found) in other.found {
            self.find(hash, found);
        }
        self.usual.extend(other.usual);
        self.transitions += other.transitions;
        for (name, count) in other.unavoidable {
            *self.unavoidable.entry(name).or_default() += count;
        }
        self.breaches.extend(other.breaches);
    }
}
