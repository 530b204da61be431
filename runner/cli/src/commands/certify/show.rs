//! The verdict for people.

use std::fmt::Write as _;

use softplug_conformance::certify::ABI;
use softplug_report::{
    CaseKind, Coverage, Executed, Explored, Noticed, Place, Report, Score, Shown, VerdictKind,
    explain,
};

use super::files::{Folder, REPORT, failure_file};
use crate::numbers::{count, things};
use crate::plugin::as_word;
use crate::screen::{BAD, GOOD, HEADING, Screen, WARNING};
use crate::sequence;

/// What was judged and by what, as the command names it.
pub(super) struct Named<'a> {
    pub(super) plugin: &'a str,
    pub(super) corpus: Option<&'a str>,
}

/// Failed cases that are told in full.
const SHOWN: usize = 3;

pub(super) fn report(report: &Report, named: &Named<'_>, folder: Option<&Folder>, screen: &Screen) {
    for finding in &report.lint {
        screen.say(format_args!("  {finding}"));
    }
    let corpus = named.corpus.map(|folder| format!("--corpus {} ", as_word(folder)));
    let again = format!("certify {} {}", as_word(named.plugin), corpus.unwrap_or_default());
    let failed: Vec<_> = report.cases.iter().filter(|case| !case.failures.is_empty()).collect();
    for case in failed.iter().take(SHOWN) {
        let text = explain(report, case).replace("certify PLUGIN ", &again);
        screen.say(format_args!("{BAD}FAILED{BAD:#} {text}"));
        if let Some(folder) = folder {
            let observed = folder.file(&failure_file(&case.failures[0].run));
            screen.say(format_args!("  observed course: {observed}"));
        }
        screen.say("");
    }
    if failed.len() > SHOWN {
        screen.say("failed too:");
        failed[SHOWN..].iter().for_each(|case| screen.say(format_args!("  {}", case.id)));
    }
    let style = match report.verdict {
        VerdictKind::Conformant => GOOD,
        VerdictKind::ConformantWithWarnings | VerdictKind::Partial => WARNING,
        VerdictKind::NotConformant | VerdictKind::NotJudged => BAD,
    };
    let verdict = report.verdict.text();
    screen.say(format_args!("{style}{verdict}{style:#}: {}", report.reason));
    let row = |title: &str, text: String| {
        screen.say(format_args!("  {HEADING}{title:<9}{HEADING:#}{text}"));
    };
    let (plug_in, profile, counts) = (&report.plugin, &report.profile, &report.counts);
    row("plug-in", format!("{} {}, sha256 {}", plug_in.name, plug_in.version, plug_in.sha256));
    let mut text = format!("{}, revision {}", profile.name, profile.revision);
    if !profile.features.is_empty() {
        let _ = write!(text, ", with {}", profile.features.join(", "));
    }
    if !profile.claimed {
        text += ", not claimed by the plug-in: its core";
    }
    row("profile", text);
    let number = |number: u32| count(u64::from(number));
    let mut cases = format!(
        "{} required, {} executed, {} passed",
        number(counts.required),
        number(counts.executed),
        number(counts.passed)
    );
    for (many, what) in [
        (counts.failed, "failed"),
        (counts.warned, "failed that should pass"),
        (counts.informed, "failed that may"),
        (counts.expected, "failed as expected"),
        (counts.unscored, "unscored"),
        (counts.unclaimed, "of features that are not claimed"),
    ] {
        if many > 0 {
            let _ = write!(cases, ", {} {what}", number(many));
        }
    }
    row("cases", format!("{cases}; {}", things(u64::from(counts.runs), "run")));
    let has_model = report.cases.iter().any(|case| case.kind == CaseKind::Random);
    if !has_model && profile.name != ABI {
        row("random", "no sessions: the profile has no model".to_owned());
    }
    let fuel = &report.fuel;
    if fuel.bytes > 0 {
        let (whole, tenth) = (fuel.tenths_per_byte / 10, fuel.tenths_per_byte % 10);
        let largest =
            format!("{} for one event ({})", count(fuel.largest_event), fuel.largest_case);
        row("fuel", format!("{whole}.{tenth} units a byte, at most {largest}"));
    }
    if let Some(coverage) = &report.coverage {
        row("executed", executed(coverage));
    }
    if let Some(explored) = &report.explored {
        row("explored", text_of_explored(explored));
        if let Some((_, found)) = explored.found() {
            screen.say(sequence::drawn(&found.drawn));
        }
    }
    if let Some(score) = &report.score {
        row("score", text_of(score));
    }
    row("digest", report.digest.clone());
    if let Some(folder) = folder {
        row("files", format!("{}, {}", folder.file("report.html"), folder.file(REPORT)));
    }
}

/// Places that are named; the report has them all.
const PLACES: usize = 5;

fn executed(coverage: &Coverage) -> String {
    let part = |part: Executed, what: &str| {
        format!("{} of {} {what}", count(part.executed.into()), count(part.of.into()))
    };
    let mut text = format!(
        "{}, {}",
        part(coverage.functions, "functions"),
        part(coverage.branches, "ways of branches")
    );
    for place in coverage.places.iter().take(PLACES) {
        let _ = write!(text, "\n           {}", place_text(place));
    }
    if coverage.places.len() > PLACES {
        let _ = write!(text, "\n           and {} more", coverage.places.len() - PLACES);
    }
    text
}

/// A place that no case executes.
pub(crate) fn place_text(place: &Place) -> String {
    let name = place.name.clone().unwrap_or_else(|| format!("function {}", place.function));
    let source = place.source.as_ref().map(|source| format!(" ({source})")).unwrap_or_default();
    format!("byte {}, in {name}{source}: {}", place.at, place.what)
}

fn text_of_explored(explored: &Explored) -> String {
    format!(
        "{}, {}, {} choices",
        things(explored.configurations.len() as u64, "configuration"),
        things(explored.states(), "state"),
        count(explored.transitions())
    )
}

fn text_of(score: &Score) -> String {
    let Noticed { lint, cases, permutations, sessions } = score.noticed;
    let by = [
        (cases, "cases"),
        (permutations, "permutations"),
        (sessions, "random sessions"),
        (lint, "the check of the module"),
    ];
    let by = by.iter().filter(|(many, _)| *many > 0);
    let by: Vec<_> =
        by.map(|(many, what)| format!("{} by {what}", count((*many).into()))).collect();
    let same = count(score.survived(Shown::Same));
    let not_executed = count(score.survived(Shown::NotExecuted));
    if score.told() == 0 {
        return format!(
            "none: no change of the module that was tried shows outside; {same} do in every run what \
             the module does, {not_executed} stand where nothing is executed"
        );
    }
    let by = if by.is_empty() { String::new() } else { format!(": {}", by.join(", ")) };
    format!(
        "{}.{} % of {} changes of the module that show outside are noticed{by}; {} are not; {same} more do in \
         every run what the module does, {not_executed} stand where nothing is executed",
        score.share() / 10,
        score.share() % 10,
        count(score.told()),
        count(score.survived(Shown::Different)),
    )
}
