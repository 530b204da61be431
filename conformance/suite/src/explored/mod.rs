//! A plug-in explored: all configurations of a profile as part of a report, and a way that was
//! found as a drawing and as traces.

mod drawn;
mod traces;

pub use drawn::rows_of_way;
pub use traces::{differs_from_explored, traces_of_way};

use crate::module::executed::{Executed, Places};
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
    let mut marked = places.as_ref().and_then(|places| places.marked(module).ok());
    let mut executed = Executed::default();
    let changes = Changes::default();
    for plan in plans {
        let tell = |so_far: Progress| progress(plan, so_far);
        let explored = match explore_checked(module, plan, &changes, &bounds, &tell, stop) {
            Ok(explored) => explored,
            Err(error) => {
                whole.refused = Some(format!("{}: {error}", plan.name));
                return Ok(Some(whole));
            }
        };
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        whole.configurations.push(configuration(&explored, plan));
        if explored.counterexample.is_some() {
            return Ok(Some(whole));
        }
        let Some(with_marks) = &marked else { continue };
        let again = explore_marked(module, with_marks, plan, &changes, &bounds, &tell, stop);
        if stop.load(Ordering::Relaxed) {
            return Ok(None);
        }
        match again {
            Ok(again) if again.digest == explored.digest => {
                executed.add(&Executed::of(again.marks));
            }
            // With its marks it is too large, or something else: nothing is known of it.
            Ok(_) | Err(_) => marked = None,
        }
    }
    if let (Some(places), Some(_)) = (places, marked) {
        whole.coverage = Some(places.coverage(module, executed.words()));
    }
    Ok(Some(whole))
}

/// [Explores](explore) a module, and runs the [sample](Exploration::sample) of that with the plug-in
/// itself, outside of what it was explored in.
///
/// ```no_run
/// use softplug_conformance::explore_checked;
/// use softplug_explore::{Bounds, Changes, plans};
/// use std::sync::atomic::AtomicBool;
///
/// let module = std::fs::read("target/plugins/r3964.wasm")?;
/// let (bounds, changes) = (Bounds::default(), Changes::default());
/// let (plan, never) = (plans("r3964")?[0], AtomicBool::new(false));
/// let explored = explore_checked(&module, plan, &changes, &bounds, &|_| {}, &never)?;
/// assert!(explored.is_complete);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// As those of [`explore`]; besides, the plug-in itself does something else.
pub fn explore_checked(
    module: &[u8],
    plan: &Plan,
    changes: &Changes,
    bounds: &Bounds,
    tell: &(dyn Fn(Progress) + Sync),
    stop: &AtomicBool,
) -> Result<Exploration, ExploreError> {
    let plugin = Host::new(HostOptions::default())?.load_bytes(module)?;
    let explored = explore(module, plan, changes, bounds, tell, stop)?;
    if differs_from_explored(&Sandboxed::new(plugin), &explored, plan).is_some() {
        let reason = "run by itself it does something else than where it is explored".to_owned();
        return Err(ExploreError::Module { reason });
    }
    Ok(explored)
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
