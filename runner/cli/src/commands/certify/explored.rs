//! `--explore`: everything that may happen, up to so many faults, as part of the verdict.

use std::sync::atomic::AtomicBool;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use softplug_conformance::explore_profile;
use softplug_explore::{Bounds, Plan, Progress, plans};
use softplug_report::{Explored, Report};

use crate::commands::explore::{failure, far};
use crate::failure::Failure;
use crate::screen::Screen;

/// Whether a profile can be explored is known before the work begins.
pub(super) fn can_be_explored(profile: &str) -> Result<(), Failure> {
    plans(profile).map(|_| ()).map_err(failure)
}

/// Explores a plug-in that is conformant, and weighs what was found. False: it was ended before.
pub(in crate::commands) fn explored(
    report: &mut Report,
    module: &[u8],
    bounds: &Bounds,
    stop: &AtomicBool,
    screen: &Screen,
) -> Result<bool, Failure> {
    if !report.verdict.is_conformant() {
        screen.note("it is not explored: only a conformant plug-in is");
        return Ok(true);
    }
    let bar = bar(screen);
    let tell = |plan: &Plan, progress: Progress| {
        bar.set_message(format!("{}: {}", plan.name, far(progress)));
        bar.tick();
    };
    let explored = explore_profile(module, &report.profile.name, bounds, &tell, stop);
    bar.finish_and_clear();
    let explored = explored.map_err(failure)?;
    let is_whole = explored.is_some();
    let explored = explored.unwrap_or_else(|| Explored {
        faults: bounds.faults,
        refused: Some("it was ended before".to_owned()),
        ..Explored::default()
    });
    let judged = (report.verdict, std::mem::take(&mut report.reason));
    (report.verdict, report.reason) = explored.weigh(judged);
    report.explored = Some(explored);
    Ok(is_whole)
}

fn bar(screen: &Screen) -> ProgressBar {
    if !screen.shows_progress() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    bar.with_style(ProgressStyle::with_template("{spinner} exploring {msg}").expect("it is sound"))
}
