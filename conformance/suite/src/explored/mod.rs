//! A plug-in explored: all configurations of a profile as part of a report, and a way that was
//! found as a drawing and as traces.

mod drawn;
mod traces;

pub use drawn::rows_of_way;
pub use traces::{differs_from_explored, traces_of_way};

use crate::module::executed::Places;
use crate::run::subject::Sandboxed;
use softplug_explore::{
    Bounds, Changes, Exploration, ExploreError, Plan, Progress, explore, explore_marked, plans,
};
use softplug_host::{Host, HostOptions};
use softplug_report::{Explored, ExploredConfiguration, Found};
use std::sync::atomic::{AtomicBool, Ordering};

/// Explores a module in each configuration of a profile, up to the first in which something is
/// found. `progress` is told how far one is; a `stop` that becomes true ends it, and then there is
/// nothing to report.
///
/// Of bounds, only faults and threads count: what a report says must be true of every machine.
///
/// ```no_run
/// use softplug_conformance::explore_profile;
/// use softplug_explore::Bounds;
/// use std::sync::atomic::AtomicBool;
///
/// let module = std::fs::read("target/plugins/xon-xoff.wasm")?;
/// let (bounds, never) = (Bounds::default(), AtomicBool::new(false));
/// let explored = explore_profile(&module, "xon-xoff", &bounds, &|_, _| {}, &never)?;
/// assert!(explored.expect("it was not stopped").found().is_none());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// The profile has no configurations. A plug-in that cannot be explored is no error: the report
/// says why.
pub fn explore_profile(
    module: &[u8],
    profile: &str,
    bounds: &Bounds,
    progress: &(dyn Fn(&Plan, Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Option<Explored>, ExploreError> {
    let plans = plans(profile)?;
    let bounds = Bounds {
        faults: bounds.faults,
        threads: bounds.threads,
        held: bounds.held,
        ..Bounds::default()
    };
    let mut whole = Explored { faults: bounds.faults, ..Explored::default() };
    let places = Places::of(module).ok();
    let marked = places.as_ref().and_then(|places| places.marked(module).ok());
    let mut marks: Option<Vec<u64>> = marked.as_ref().map(|_| Vec::new());
    for plan in plans {
        let changes = Changes::default();
        let tell = |so_far: Progress| progress(plan, so_far);
        let explored = match explore(module, plan, &changes, &bounds, &tell, stop) {
            Ok(explored) => explored,
            Err(error) => return Ok(Some(refused(whole, plan, &error.to_string()))),
        };
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        match differs(module, &explored, plan) {
            Ok(false) => {}
            Ok(true) => return Ok(Some(refused(whole, plan, OTHERWISE))),
            Err(error) => return Ok(Some(refused(whole, plan, &error.to_string()))),
        }
        let is_found = explored.counterexample.is_some();
        if let (Some(marked), Some(all), false) = (&marked, &mut marks, is_found) {
            let again = explore_marked(module, marked, plan, &changes, &bounds, &tell, stop);
            if stop.load(Ordering::Relaxed) {
                return Ok(None);
            }
            match again {
                Ok(again) if again.digest == explored.digest => {
                    all.resize(again.marks.len(), 0);
                    all.iter_mut().zip(again.marks).for_each(|(all, own)| *all |= own);
                }
                // With its marks it is too large, or cannot be explored: nothing is known of it.
                Ok(_) | Err(_) => marks = None,
            }
        }
        whole.configurations.push(configuration(&explored, plan));
        if is_found {
            return Ok(Some(whole));
        }
    }
    if let (Some(places), Some(marks)) = (places, marks) {
        whole.coverage = Some(places.coverage(module, &marks));
    }
    Ok(Some(whole))
}

const OTHERWISE: &str = "run by itself it does something else than where it is explored, because it \
                         keeps something in its stack or mailbox from one event to the next";

fn refused(mut whole: Explored, plan: &Plan, reason: &str) -> Explored {
    whole.refused = Some(format!("{}: {reason}", plan.name));
    whole
}

/// Whether the plug-in itself does something else on the ways of the sample.
fn differs(
    module: &[u8],
    explored: &Exploration,
    plan: &Plan,
) -> Result<bool, softplug_host::LoadError> {
    let host = Host::new(HostOptions::default())?;
    let subject = Sandboxed::new(host.load_bytes(module)?);
    Ok(differs_from_explored(&subject, explored, plan).is_some())
}

fn configuration(explored: &Exploration, plan: &Plan) -> ExploredConfiguration {
    ExploredConfiguration {
        name: plan.name.to_owned(),
        partner: plan.partner.to_owned(),
        held_to_model: explored.has_model,
        states: explored.states,
        transitions: explored.transitions,
        depth: explored.depth,
        longest_us: explored.longest.map(|time| time.0),
        unavoidable: explored.unavoidable.clone(),
        digest: format!("{:032x}", explored.digest),
        found: explored.counterexample.as_ref().map(|found| Found {
            promise: found.breach.name().to_owned(),
            text: found.breach.to_string(),
            drawn: rows_of_way(explored.setup.begin, &found.way),
        }),
    }
}
