//! Explores a module and prints what came of it:
//! `cargo run --release -p softplug-explore --example explore -- MODULE PROFILE FAULTS [THREADS [NAME]]`.

use softplug_explore::{Bounds, Changes, Plan, explore, plans};
use std::error::Error;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [module, profile, faults, more @ ..] = arguments.as_slice() else {
        return Err("MODULE PROFILE FAULTS [THREADS [NAME]] are wanted".into());
    };
    let name = more.get(1);
    let threads = more.first().map_or(Ok(1), |threads| threads.parse())?;
    let bounds = Bounds { faults: faults.parse()?, threads, ..Bounds::default() };
    let module = std::fs::read(module)?;
    for plan in plans(profile)?.into_iter().filter(|plan| name.is_none_or(|name| plan.name == name))
    {
        show(&module, plan, &bounds)?;
    }
    Ok(())
}

fn show(module: &[u8], plan: &Plan, bounds: &Bounds) -> Result<(), Box<dyn Error>> {
    let begin = Instant::now();
    let tell = |progress| eprintln!("{progress:?}");
    let never = AtomicBool::new(false);
    let explored = explore(module, plan, &Changes::default(), bounds, &tell, &never)?;
    let seconds = begin.elapsed().as_secs_f64();
    println!(
        "{} {}: model {}, complete {}, {} states, {} transitions, depth {}, rest {:?}, unavoidable {:?}, digest \
         {:032x}, {seconds:.1} s, {:.0} a second",
        plan.profile,
        plan.name,
        explored.has_model,
        explored.is_complete,
        explored.states,
        explored.transitions,
        explored.depth,
        explored.longest,
        explored.unavoidable,
        explored.digest,
        explored.transitions as f64 / seconds,
    );
    if let Some(found) = explored.counterexample {
        println!("{}", found.breach);
        for choice in found.way.path {
            println!("  {choice}");
        }
        for (end, log) in found.way.logs.iter().enumerate() {
            println!("{end}: {:?}", log.observed);
        }
    }
    Ok(())
}
