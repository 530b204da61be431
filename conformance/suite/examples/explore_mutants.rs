//! Explores every named mutant and says which are found:
//! `cargo run --release -p softplug-conformance --example explore_mutants -- MUTANTS FAULTS SECONDS [FILTER]`.
//! `MUTANTS` is the folder of modules that `cargo xtask mutants --build` makes. Each mutant is a line
//! of JSON: its name, and what it breaks.

use softplug_conformance::mutants::{Catalogue, wake};
use softplug_explore::{Bounds, Changes, explore, plans};
use std::error::Error;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [mutants, faults, seconds, filter @ ..] = arguments.as_slice() else {
        return Err("MUTANTS FAULTS SECONDS [FILTER] are wanted".into());
    };
    let (faults, seconds) = (faults.parse()?, Duration::from_secs(seconds.parse()?));
    let catalogues = Catalogue::read(Path::new("fixtures/mutants"))?;
    let never = AtomicBool::new(false);
    for catalogue in &catalogues {
        let Ok(plans) = plans(&catalogue.profile) else { continue };
        for mutant in &catalogue.mutants {
            if !filter.iter().all(|part| mutant.id.contains(part.as_str())) {
                continue;
            }
            let file = Path::new(mutants).join(format!("{}.wasm", mutant.plugin));
            let module = wake(&std::fs::read(file)?, &mutant.id)?;
            let mut breaks = String::new();
            'found: for faults in 0..=faults {
                for plan in &plans {
                    let bounds =
                        Bounds { faults, time: Some(seconds), threads: 2, ..Bounds::default() };
                    let explored =
                        explore(&module, plan, &Changes::default(), &bounds, &|_| {}, &never);
                    let found = match explored {
                        Ok(explored) => match explored.counterexample {
                            Some(found) => format!("{}: {}", found.breach.name(), found.breach),
                            None if explored.is_complete => continue,
                            None => format!("nothing within {} s", seconds.as_secs()),
                        },
                        Err(error) => format!("error: {error}"),
                    };
                    breaks = format!("{} with {faults}: {found}", plan.name);
                    break 'found;
                }
            }
            println!("{}", serde_json::to_string(&(&mutant.id, breaks))?);
        }
    }
    Ok(())
}
