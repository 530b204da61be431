//! Explores every named mutant and says which are found:
//! `cargo run --release -p softplug-conformance --example explore_mutants -- MUTANTS FAULTS SECONDS [FILTER]`.
//! `MUTANTS` is the folder of modules that `cargo xtask mutants --build` makes. Each mutant is a line
//! of JSON: its name, and what it breaks.
//!
//! All configurations are explored whole with one fault. With more than that, random ways through
//! the larger configuration follow, and then all configurations with so many faults, in the order of
//! their size: for at most so many seconds in all.

use softplug_conformance::Places;
use softplug_conformance::mutants::{Catalogue, wake};
use softplug_explore::{Bounds, Changes, Counterexample, Walks, explore, larger, plans, walk};
use std::error::Error;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

/// Of the time, what random ways take.
const WALKING: u32 = 5;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mutants, faults, seconds, filter @ ..] = arguments.as_slice() else {
        return Err("MUTANTS FAULTS SECONDS [FILTER] are wanted".into());
    };
    let (faults, seconds) = (faults.parse()?, Duration::from_secs(seconds.parse()?));
    let catalogues = Catalogue::read(Path::new("fixtures/mutants"))?;
    for catalogue in &catalogues {
        if plans(&catalogue.profile).is_err() {
            continue;
        }
        for mutant in &catalogue.mutants {
            if !filter.iter().all(|part| mutant.id.contains(part.as_str())) {
                continue;
            }
            let file = Path::new(mutants).join(format!("{}.wasm", mutant.plugin));
            let module = wake(&std::fs::read(file)?, &mutant.id)?;
            let found = found(&module, &catalogue.profile, faults, seconds);
            let breaks = found.unwrap_or_else(|error| format!("error: {error}"));
            println!("{}", serde_json::to_string(&(&mutant.id, breaks))?);
        }
    }
    Ok(())
}

/// What exploring finds; nothing if it finds nothing.
fn found(
    module: &[u8],
    profile: &str,
    faults: u8,
    time: Duration,
) -> Result<String, Box<dyn Error>> {
    let begin = Instant::now();
    let left = || time.saturating_sub(begin.elapsed());
    let (never, changes) = (AtomicBool::new(false), Changes::default());
    let mut sizes = Vec::new();
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    for plan in plans(profile)? {
        let bounds =
            Bounds { faults: faults.min(1), time: Some(left()), threads, ..Bounds::default() };
        let explored = explore(module, plan, &changes, &bounds, &|_| {}, &never)?;
        if let Some(found) = explored.counterexample {
            return Ok(told(plan.name, bounds.faults, &found));
        }
        sizes.push((explored.states, plan));
    }
    if faults < 2 {
        return Ok(String::new());
    }
    let marked = Places::of(module)?.marked(module)?;
    let bounds = Bounds { faults, time: Some(left() / WALKING), threads, ..Bounds::default() };
    let walks = Walks { rounds: u32::MAX, ..Walks::default() };
    let plan = larger(profile)?;
    let walked = walk(module, &marked, plan, &changes, &bounds, walks, &|_| {}, &never)?;
    if let Some(found) = walked.counterexample {
        return Ok(told(plan.name, faults, &found));
    }
    sizes.sort_by_key(|(states, _)| *states);
    for (_, plan) in sizes {
        let bounds = Bounds { faults, time: Some(left()), threads, ..Bounds::default() };
        let explored = explore(module, plan, &changes, &bounds, &|_| {}, &never)?;
        if let Some(found) = explored.counterexample {
            return Ok(told(plan.name, faults, &found));
        }
    }
    Ok(String::new())
}

fn told(name: &str, faults: u8, found: &Counterexample) -> String {
    let breach = &found.breach;
    format!("{name} with {faults}: {}: {breach}", breach.name())
}
