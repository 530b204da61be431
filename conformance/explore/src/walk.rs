//! Random ways through what is too large to be explored whole.
//!
//! A walk goes from a state some choices on, and prefers states from which something new came: code
//! that was not executed before, or a state that was not seen before. All is drawn from a seed.
//! Walks are made in rounds that know nothing of each other, so that any number of threads finds
//! the same.

use crate::ExploreError;
use crate::bounds::{Bounds, Progress};
use crate::choice::Choice;
use crate::explore::{Counterexample, Way};
use crate::hash::Hash128;
use crate::instance::{Shared, locked};
use crate::marked::{Marked, add_marks};
use crate::plans::Plan;
use crate::promise::Breach;
use crate::sandbox::Subject;
use crate::scenario::{Changes, Scenario, Setup};
use crate::search::Search;
use crate::world::World;
use softplug_models::Dice;
use std::collections::{BTreeMap, HashSet};
use std::hash::Hash;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

/// Choices of one round.
const ROUND: u64 = 20_000;
/// Choices that are made at most where all was explored.
const MOST_DOUBT: u64 = 20_000;
/// Choices of one walk.
const WALK: usize = 60;
/// States that walks of a round begin from.
const POOL: usize = 512;
/// One in so many choices is a fault, while there are faults left.
const FAULT: u64 = 12;

/// Which random ways are gone.
///
/// ```
/// use softplug_explore::Walks;
///
/// let walks = Walks { rounds: 10, ..Walks::default() };
/// assert_eq!(walks.seed, 1);
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Walks {
    /// What all is drawn from.
    pub seed: u64,
    /// How many rounds, of 20,000 choices each.
    pub rounds: u32,
}

impl Default for Walks {
    /// Fifty rounds.
    fn default() -> Self {
        Self { seed: 1, rounds: 50 }
    }
}

/// What came of random ways.
///
/// ```no_run
/// use softplug_explore::{Bounds, Changes, Marked, Walks, larger, walk};
/// use std::sync::atomic::AtomicBool;
///
/// let module = std::fs::read("my-plugin.wasm")?;
/// // One that marks nothing: then no state is preferred for its code.
/// let marked = Marked { wasm: module.clone(), globals: Vec::new(), fuel: 5_000_000 };
/// let bounds = Bounds { faults: 4, ..Bounds::default() };
/// let (plan, never) = (larger("r3964")?, AtomicBool::new(false));
/// let changes = Changes::default();
/// let walked =
///     walk(&module, &marked, plan, &changes, &bounds, Walks::default(), &|_| {}, &never)?;
/// assert!(walked.counterexample.is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Walked {
    /// Rounds that came to their end, or to something that must never be.
    pub rounds: u32,
    /// Different states, those of one round counted once.
    pub states: u64,
    /// Choices that were made.
    pub choices: u64,
    /// What the protocol cannot keep from happening, and how often it did.
    pub unavoidable: BTreeMap<String, u64>,
    /// A bit for each place that was executed, as in [`Exploration::marks`](crate::Exploration).
    pub marks: Vec<u64>,
    /// The same for the same module, plan, number of faults and walks, wherever and with however
    /// many threads.
    pub digest: u128,
    /// Of the first round that found something: the way to it, of which no fault can be left out.
    pub counterexample: Option<Counterexample>,
    /// The plug-in was held to the profile's model as well as to the promises.
    pub has_model: bool,
    /// What the plug-ins were given from the start.
    pub setup: Setup,
}

/// One round.
struct Round {
    states: u64,
    choices: u64,
    unavoidable: BTreeMap<String, u64>,
    marks: Vec<u64>,
    digest: u128,
    breach: Option<(Breach, Vec<Choice>)>,
}

/// A state from which walks begin, and the way that leads to it.
struct Begin {
    world: World,
    way: Vec<Choice>,
    /// Walks from here that found nothing new.
    in_vain: u64,
}

/// Goes random ways through a plan, up to [`Bounds::faults`] on each, for at most
/// [`Bounds::time`].
///
/// # Errors
/// As those of [`explore`](crate::explore).
///
/// The example of [`Walked`] shows it.
#[expect(clippy::too_many_arguments, reason = "they are those of explore, and the walks")]
pub fn walk(
    module: &[u8],
    marked: &Marked,
    plan: &Plan,
    changes: &Changes,
    bounds: &Bounds,
    walks: Walks,
    tell: &(dyn Fn(Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Walked, ExploreError> {
    let subject = Subject::new(module, Some(marked))?;
    let scenario = Arc::new(Scenario::new(plan, subject.plugin.manifest(), changes)?);
    let subjects = vec![subject; plan.plug_ins()];
    let search = Search::new(&subjects, scenario, bounds);
    let rounds = search.rounds(plan, walks, tell, stop)?;
    let mut walked = Walked {
        rounds: 0,
        states: 0,
        choices: 0,
        unavoidable: BTreeMap::new(),
        marks: Vec::new(),
        digest: 0,
        counterexample: None,
        has_model: search.scenario.model(0).is_some(),
        setup: search.scenario.setup(),
    };
    let mut digest = Hash128::new();
    for round in rounds {
        walked.rounds += 1;
        walked.states += round.states;
        walked.choices += round.choices;
        for (name, times) in round.unavoidable {
            *walked.unavoidable.entry(name).or_default() += times;
        }
        add_marks(&mut walked.marks, &round.marks);
        round.digest.hash(&mut digest);
        if let Some((breach, way)) = round.breach {
            let way = search.shortened(&breach, way)?;
            walked.counterexample = Some(Counterexample { breach, way });
            break;
        }
    }
    walked.digest = digest.finish_128();
    Ok(walked)
}

impl Search<'_> {
    /// The rounds in their order, up to the first that found something.
    fn rounds(
        &self,
        plan: &Plan,
        walks: Walks,
        tell: &(dyn Fn(Progress) + Sync),
        stop: &AtomicBool,
    ) -> Result<Vec<Round>, ExploreError> {
        let begin = Instant::now();
        let is_over = || {
            stop.load(Ordering::Relaxed)
                || self.bounds.time.is_some_and(|time| begin.elapsed() >= time)
        };
        let next = AtomicU32::new(0);
        let last = AtomicU32::new(walks.rounds);
        let (states, choices) = (AtomicU64::new(0), AtomicU64::new(0));
        let done = Mutex::new(BTreeMap::new());
        let work = || {
            loop {
                let number = next.fetch_add(1, Ordering::Relaxed);
                if number >= last.load(Ordering::Relaxed) || is_over() {
                    return;
                }
                let dice = Dice::new(walks.seed, plan.name, u64::from(number));
                let round = match self.round(dice, ROUND, &is_over) {
                    Ok(Some(round)) => Ok(round),
                    Ok(None) => return,
                    Err(error) => Err(error),
                };
                if let Ok(round) = &round {
                    let states = states.fetch_add(round.states, Ordering::Relaxed) + round.states;
                    let made = choices.fetch_add(round.choices, Ordering::Relaxed) + round.choices;
                    tell(Progress { depth: number + 1, states, transitions: made, frontier: 0 });
                }
                if round.as_ref().map_or(true, |round| round.breach.is_some()) {
                    last.fetch_min(number + 1, Ordering::Relaxed);
                }
                done.lock().unwrap_or_else(PoisonError::into_inner).insert(number, round);
            }
        };
        std::thread::scope(|scope| {
            let threads: Vec<_> =
                (0..self.bounds.threads.max(1)).map(|_| scope.spawn(work)).collect();
            for thread in threads {
                thread.join().unwrap_or_else(|panic| resume_unwind(panic));
            }
        });
        let mut done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
        // Of a run that was ended, those without a gap before them.
        let mut rounds = Vec::with_capacity(done.len());
        while let Some(round) = done.remove(&(rounds.len() as u32)) {
            rounds.push(round?);
        }
        Ok(rounds)
    }

    /// Random ways through what was explored whole: what they find was missed where two ways lead to
    /// one state, of which only the first is gone on.
    pub(crate) fn doubt(&self, plan: &Plan) -> Result<Option<(Breach, Way)>, ExploreError> {
        let choices = (self.graph.states() / 2).clamp(MOST_DOUBT / 20, MOST_DOUBT);
        let round = self.round(Dice::new(1, plan.name, 0), choices, &|| false)?;
        let Some(Round { breach: Some((breach, way)), .. }) = round else { return Ok(None) };
        let way = self.shortened(&breach, way)?;
        Ok(Some((breach, way)))
    }

    /// One round of so many choices; none if it was ended.
    fn round(
        &self,
        mut dice: Dice,
        choices: u64,
        is_over: &dyn Fn() -> bool,
    ) -> Result<Option<Round>, ExploreError> {
        let sandboxes = self.sandboxes()?;
        let (world, breach) = self.open(&sandboxes, false)?;
        let mut round = Round {
            states: 1,
            choices: 0,
            unavoidable: BTreeMap::new(),
            marks: Vec::new(),
            digest: 0,
            breach: breach.map(|breach| (breach, Vec::new())),
        };
        let mut seen = HashSet::from([world.hash()]);
        let mut digest = Hash128::new();
        let mut pool = vec![Begin { world, way: Vec::new(), in_vain: 0 }];
        while round.choices < choices && round.breach.is_none() {
            if is_over() {
                return Ok(None);
            }
            let place = drawn(&pool, &mut dice);
            let (mut world, mut way) = (pool[place].world.fork(), pool[place].way.clone());
            let mut found = Vec::new();
            for _ in 0..WALK {
                let Some(choice) = chosen(&world.choices(), &mut dice) else { break };
                let outcome = world.make(choice);
                way.push(choice);
                round.choices += 1;
                for name in outcome.unavoidable {
                    *round.unavoidable.entry(name.to_owned()).or_default() += 1;
                }
                if let Some(reason) = outcome.unexplorable {
                    return Err(ExploreError::Module { reason });
                }
                if let Some(breach) = outcome.breach {
                    round.breach = Some((breach, way.clone()));
                    break;
                }
                let hash = world.hash();
                hash.hash(&mut digest);
                let is_new_code = has_new_marks(&mut round.marks, &sandboxes);
                if is_new_code || (seen.insert(hash) && dice.one_in(WALK as u64 / 2)) {
                    found.push(Begin { world: world.fork(), way: way.clone(), in_vain: 0 });
                }
            }
            pool[place].in_vain += 1;
            if !found.is_empty() {
                pool[place].in_vain /= 2;
            }
            for begin in found {
                if pool.len() < POOL {
                    pool.push(begin);
                } else {
                    let place = dice.below(POOL as u64) as usize;
                    pool[place] = begin;
                }
            }
        }
        round.states = seen.len() as u64;
        (&round.marks, round.states, round.choices).hash(&mut digest);
        round.digest = digest.finish_128();
        Ok(Some(round))
    }

    /// The way without what can be left out: everything but what is usual is tried.
    fn shortened(&self, breach: &Breach, way: Vec<Choice>) -> Result<Way, ExploreError> {
        let sandboxes = self.sandboxes()?;
        let mut shortest = way;
        for place in (0..shortest.len()).rev() {
            // What lies behind the breach was cut off meanwhile.
            if shortest.get(place).is_none_or(|choice| *choice == Choice::Next) {
                continue;
            }
            let mut shorter = shortest.clone();
            shorter.remove(place);
            if let Some(way) = self.leads_to(breach, &shorter, &sandboxes)? {
                shortest = way;
            }
        }
        self.way(shortest)
    }

    /// The beginning of a way that leads to a breach of this kind: where one of its choices cannot
    /// be made, it is left out; behind the last one, what is usual happens for a while.
    fn leads_to(
        &self,
        breach: &Breach,
        way: &[Choice],
        sandboxes: &[Shared],
    ) -> Result<Option<Vec<Choice>>, ExploreError> {
        let (mut world, _) = self.open(sandboxes, false)?;
        let mut gone = Vec::with_capacity(way.len() + WALK);
        let more = std::iter::repeat_n(Choice::Next, WALK);
        for choice in way.iter().copied().chain(more) {
            if !world.choices().contains(&choice) {
                continue;
            }
            gone.push(choice);
            let outcome = world.make(choice);
            if let Some(found) = outcome.breach {
                return Ok((found.name() == breach.name()).then_some(gone));
            }
            if outcome.unexplorable.is_some() {
                return Ok(None);
            }
        }
        Ok(None)
    }
}

/// The better of some at random: from which few walks found nothing.
fn drawn(pool: &[Begin], dice: &mut Dice) -> usize {
    let some = [(); 3].map(|()| dice.below(pool.len() as u64) as usize);
    some.into_iter().min_by_key(|place| pool[*place].in_vain).unwrap_or(0)
}

/// What is usual most of the time, and now and then anything.
fn chosen(choices: &[Choice], dice: &mut Dice) -> Option<Choice> {
    let usual: Vec<Choice> = choices.iter().copied().filter(|choice| !choice.is_fault()).collect();
    match (usual.first(), usual.len() == choices.len()) {
        (Some(first), true) if dice.below(4) > 0 => Some(*first),
        (Some(_), true) => Some(*dice.pick(&usual)),
        (Some(first), false) if !dice.one_in(FAULT) => Some(*first),
        _ => (!choices.is_empty()).then(|| *dice.pick(choices)),
    }
}

fn has_new_marks(known: &mut Vec<u64>, sandboxes: &[Shared]) -> bool {
    let mut is_new = false;
    for sandbox in sandboxes {
        is_new |= add_marks(known, locked(sandbox).marks());
    }
    is_new
}
