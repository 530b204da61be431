//! What is looked at once the traces hold: the ABI's own cases, what of the code no case executes,
//! and five seconds of exploring. The next save breaks it off.

use std::error::Error;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use serde::Serialize;
use softplug_conformance::Corpus;
use softplug_conformance::certify::{ABI, CertifyOptions, Loaded, certify};
use softplug_explore::{Bounds, Changes, explore, plans};
use softplug_report::{Coverage, Report};

use crate::commands::build::Built;
use crate::commands::certify::place_text;
use crate::corpus::REQUIREMENTS;
use crate::numbers;
use crate::screen::{BAD, GOOD, Screen};

/// How long it is explored.
const EXPLORED: Duration = Duration::from_secs(5);
/// Places without a case that are told.
const PLACES: usize = 3;

/// What was found, for machines.
#[derive(Serialize)]
struct Document {
    result: &'static str,
    /// Verdicts by profile.
    verdicts: Vec<Judged>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    explored: Vec<Explored>,
}

#[derive(Serialize)]
struct Judged {
    profile: String,
    verdict: &'static str,
    passed: u32,
    executed: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    coverage: Option<Coverage>,
}

#[derive(Serialize)]
struct Explored {
    configuration: &'static str,
    states: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    found: Option<String>,
}

/// Looks, unless `broken_off`.
pub(super) fn look(built: &Built, root: &Path, broken_off: &AtomicBool, screen: &Screen) {
    let mut document =
        Document { result: "looked-further", verdicts: Vec::new(), explored: Vec::new() };
    let manifest = built.plugin.manifest();
    let claimed = manifest.profiles.iter().map(|profile| profile.name.as_str());
    for profile in std::iter::once(ABI).chain(claimed.clone().filter(|name| *name != ABI)) {
        let judged = judged(built, root, profile, broken_off);
        if broken_off.load(Ordering::Relaxed) {
            return;
        }
        let report = match judged {
            Ok(report) => report,
            Err(error) => {
                screen.note(format_args!("{profile} is not judged: {error}"));
                continue;
            }
        };
        show(profile, &report, screen);
        document.verdicts.push(Judged {
            profile: profile.to_owned(),
            verdict: report.verdict.text(),
            passed: report.counts.passed,
            executed: report.counts.executed,
            coverage: report.coverage,
        });
    }
    for profile in claimed {
        document.explored.extend(explored(built, profile, broken_off, screen));
        if broken_off.load(Ordering::Relaxed) {
            return;
        }
    }
    screen.json_line(&document);
}

/// The verdict by a profile of the project, or of this command.
fn judged(
    built: &Built,
    root: &Path,
    profile: &str,
    broken_off: &AtomicBool,
) -> Result<Report, Box<dyn Error>> {
    // Empty where it is the working folder, which is no folder that can be read.
    let root = if root.as_os_str().is_empty() { Path::new(".") } else { root };
    let own = root.join(REQUIREMENTS).join(format!("{profile}.toml")).is_file();
    let corpus = if own { Corpus::read(root)? } else { Corpus::embedded() };
    let options = CertifyOptions::new(profile);
    Ok(certify(&Loaded::new(&built.module)?, &corpus, &options, &|_| {}, broken_off)?)
}

fn show(profile: &str, report: &Report, screen: &Screen) {
    let is_good = report.verdict.is_conformant();
    let (style, counts) = (if is_good { GOOD } else { BAD }, &report.counts);
    screen.say(format_args!(
        "{profile}: {style}{}{style:#}, {} of {} passed",
        report.verdict.text(),
        numbers::count(counts.passed.into()),
        numbers::things(counts.executed.into(), "case")
    ));
    if !is_good {
        screen.say(format_args!("  softplug certify PLUGIN --profile {profile} shows why"));
    }
    let Some(coverage) = report.coverage.as_ref().filter(|_| profile != ABI) else { return };
    let Coverage { functions, branches, places } = coverage;
    screen.say(format_args!(
        "  executed {} of {} functions, {} of {} ways of branches",
        functions.executed, functions.of, branches.executed, branches.of
    ));
    for place in places.iter().take(PLACES) {
        screen.say(format_args!("  {}", place_text(place)));
    }
}

/// Up to the first configuration in which something is found.
fn explored(
    built: &Built,
    profile: &str,
    broken_off: &AtomicBool,
    screen: &Screen,
) -> Vec<Explored> {
    let Ok(plans) = plans(profile) else { return Vec::new() };
    let share = EXPLORED / u32::try_from(plans.len()).unwrap_or(1).max(1);
    let bounds = Bounds { time: Some(share), ..Bounds::default() };
    let mut all = Vec::new();
    for plan in plans {
        let explored =
            explore(&built.module, plan, &Changes::default(), &bounds, &|_| {}, broken_off);
        let Ok(explored) = explored else { break };
        if broken_off.load(Ordering::Relaxed) {
            break;
        }
        let found = explored.counterexample.as_ref().map(|found| found.breach.to_string());
        let states = numbers::things(explored.states, "state");
        match &found {
            None => screen.say(format_args!("explored {}: {states}, nothing found", plan.name)),
            Some(found) => screen.say(format_args!(
                "explored {}: {BAD}{found}{BAD:#}\n  softplug explore PLUGIN --profile {profile} \
                 shows the way",
                plan.name
            )),
        }
        let is_found = found.is_some();
        all.push(Explored { configuration: plan.name, states: explored.states, found });
        if is_found {
            break;
        }
    }
    all
}
