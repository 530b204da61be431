//! Explores a module and prints what came of it:
//! `cargo run --release -p softplug-explore --example explore -- MODULE PROFILE FAULTS [THREADS]`.

use softplug_explore::{Bounds, Changes, explore, plan};
use std::error::Error;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [module, profile, faults, threads @ ..] = arguments.as_slice() else {
        return Err("MODULE PROFILE FAULTS [THREADS] are wanted".into());
    };
    let threads = threads.first().map_or(Ok(1), |threads| threads.parse())?;
    let bounds = Bounds { faults: faults.parse()?, threads, ..Bounds::default() };
    let module = std::fs::read(module)?;
    let begin = Instant::now();
    let tell = |progress| eprintln!("{progress:?}");
    let never = AtomicBool::new(false);
    let explored =
        explore(&module, &plan(profile)?, &Changes::default(), &bounds, &tell, &never)?;
    let seconds = begin.elapsed().as_secs_f64();
    println!(
        "complete {}, {} states, {} transitions, depth {}, rest {:?}, unavoidable {:?}, digest \
         {:032x}, {seconds:.1} s, {:.0} a second",
        explored.is_complete,
        explored.states,
        explored.transitions,
        explored.depth,
        explored.longest,
        explored.unavoidable,
        explored.digest,
        explored.transitions as f64 / seconds,
    );
    if let Some(counterexample) = explored.counterexample {
        println!("{}", counterexample.breach);
        for choice in counterexample.path {
            println!("  {choice}");
        }
        for (end, log) in counterexample.logs.iter().enumerate() {
            println!("{end}: {:?}", log.observed);
        }
    }
    Ok(())
}
