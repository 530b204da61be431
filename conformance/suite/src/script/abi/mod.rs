//! The ABI, whatever the protocol: what any plug-in must bear.
//!
//! A generator makes legal input from a seed and the plug-in's own manifest; the plug-in
//! must neither fault on it nor do anything else when the same input is cut differently,
//! comes twice, is interrupted by saves or carried over into fresh instances.

mod random;
mod saving;
mod settings;

use super::case::Script;
use super::context::ScriptContext;
use super::failure::{Outcome, diverged};
use crate::run::class::Class;
use crate::run::permute::Permutation;
use crate::run::seen::Seen;
use crate::run::{outcome, replay};
use random::{Shape, conditions};
use saving::Saving;
use softplug_abi::Micros;

/// What is drawn from each seed, and how often.
const SEEDS: u64 = 4;

pub(super) fn scripts() -> Vec<Script> {
    let mut all = settings::scripts();
    for shape in Shape::ALL {
        for seed in 1..=SEEDS {
            let id = format!("abi.input.{}-{seed}", shape.slug());
            let title = format!("{} (seed {seed}): no fault, no rule broken", shape.title());
            all.push(Script::new("abi", id, title, shape.clauses(), move |context| {
                run(context, shape, seed, &Permutation::Uncut).map(|_| ())
            }));
        }
    }
    let again = [
        ("cuts-singly", "cut into single bytes", "abi.cuts.one-time", Permutation::CutSingly),
        ("cuts-whole", "joined to the longest runs", "abi.cuts.one-time", Permutation::CutWhole),
        ("cuts-random", "cut at random", "abi.cuts.one-time", Permutation::CutRandom(1)),
        ("twice", "again after close and open", "abi.close.as-new", Permutation::Twice),
        (
            "swaps",
            "with a fresh instance after every event",
            "abi.state.goes-on",
            Permutation::SwapAll,
        ),
    ];
    for (slug, words, clause, permutation) in again {
        for seed in 1..=SEEDS {
            let id = format!("abi.{slug}.{seed}");
            let title = format!("The same input {words} (seed {seed}): the same is done");
            let clauses: &[_] = match permutation {
                Permutation::SwapAll => {
                    &["abi.state.goes-on", "abi.swap.timers", "abi.swap.pieces"]
                }
                _ => &[clause],
            };
            let permutation = permutation.clone();
            all.push(Script::new("abi", id, title, clauses, move |context| {
                alike(context, seed, &permutation)
            }));
        }
    }
    for seed in 1..=SEEDS {
        let id = format!("abi.saves.{seed}");
        let title =
            format!("The same input with a save after every event (seed {seed}): the same is done");
        all.push(Script::new(
            "abi",
            id,
            title,
            &["abi.swap.save-changes-nothing"],
            move |context| saves_change_nothing(context, seed),
        ));
    }
    all
}

/// One run; what it showed goes into the log.
fn run(
    context: &mut ScriptContext<'_>,
    shape: Shape,
    seed: u64,
    way: &Permutation,
) -> Outcome<outcome::Outcome> {
    let conditions = conditions(context.manifest(), shape, seed)?;
    let line = conditions.options.line;
    let outcome = replay::run(&context.subject, conditions, way);
    context.write(line, &outcome.seen);
    context.count(outcome.fuel, outcome.bytes);
    match outcome.fault {
        Some(fault) => Err(fault.into()),
        None => Ok(outcome),
    }
}

/// Gives an input once as it is and once in another way: the plug-in must do the same.
fn alike(context: &mut ScriptContext<'_>, seed: u64, way: &Permutation) -> Outcome {
    if *way == Permutation::SwapAll && context.manifest().state.saves.is_none() {
        // A plug-in may save nothing: it is then never asked to.
        return Ok(());
    }
    let shape = match way {
        Permutation::Twice => Shape::Session,
        _ => Shape::Everything,
    };
    let first = run(context, shape, seed, &Permutation::Uncut)?;
    let conditions = conditions(context.manifest(), shape, seed)?;
    let second = replay::run(&context.subject, conditions, way);
    if let Some(fault) = second.fault {
        return Err(fault.into());
    }
    let class = match way {
        Permutation::Twice => Class::DependsOnPast,
        Permutation::SwapAll => Class::DependsOnSwap,
        _ => Class::DependsOnCuts,
    };
    same(class, &first, &second)
}

fn saves_change_nothing(context: &mut ScriptContext<'_>, seed: u64) -> Outcome {
    if context.manifest().state.saves.is_none() {
        return Ok(());
    }
    let first = run(context, Shape::Everything, seed, &Permutation::Uncut)?;
    let conditions = conditions(context.manifest(), Shape::Everything, seed)?;
    let second = replay::run(&Saving(context.subject), conditions, &Permutation::Uncut);
    if let Some(fault) = second.fault {
        return Err(fault.into());
    }
    same(Class::DependsOnSwap, &first, &second)
}

fn same(class: Class, first: &outcome::Outcome, second: &outcome::Outcome) -> Outcome {
    let both = first.seen.iter().zip(&second.seen);
    let place = both.take_while(|(first, second)| first == second).count();
    let (expected, observed) = (first.seen.get(place), second.seen.get(place));
    if expected.is_none() && observed.is_none() {
        return Ok(());
    }
    let at = expected.or(observed).map_or(Micros::ZERO, |seen| seen.at);
    let text = |seen: Option<&Seen>| {
        seen.map_or_else(|| "nothing".to_owned(), |seen| format!("at {seen}"))
    };
    let mut failure = diverged(at, class.text(), text(expected), text(observed));
    failure.class = class;
    Err(failure)
}
