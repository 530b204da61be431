//! What was not tried, or not noticed: what the verdict says nothing of.

use super::rows::mark;
use crate::{CaseResult, CaseRow, Executed, Outcome, Place, Report, Shown, Survivor, text};
use maud::{Markup, html};

/// Places and survivors that the page lists; the report has all of them.
const LISTED: usize = 200;

/// The section; there is always one, for what is not said could be taken for something that was
/// tried.
pub(super) fn section(report: &Report) -> Markup {
    let missing = with(report, |outcome| outcome == Outcome::Missing);
    let others =
        with(report, |outcome| matches!(outcome, Outcome::Unclaimed | Outcome::UnscoredSkip));
    let sentences = sentences(report);
    let is_all = missing.is_empty() && others.is_empty() && sentences.is_empty();
    html! {
        section id="untried" {
            h2 { "What was not tried" }
            @if !missing.is_empty() {
                details open {
                    summary { (text::count(missing.len() as u32, "required case")) " not executed" }
                    (cases(report, &missing))
                }
            }
            @if !sentences.is_empty() {
                ul.plain-list { @for sentence in &sentences { li { (sentence) } } }
            }
            @if !others.is_empty() {
                details {
                    summary { (text::count(others.len() as u32, "case")) " that this verdict does not need" }
                    (cases(report, &others))
                }
            }
            (clauses(report))
            (unexecuted(report))
            (survivors(report))
            @if is_all && untestable(report).is_empty() {
                p { "Nothing that the profile demands was left out." }
            }
        }
    }
}

fn with(report: &Report, is: impl Fn(Outcome) -> bool) -> Vec<&CaseRow> {
    report.cases.iter().filter(|case| is(report.outcome(case))).collect()
}

fn cases(report: &Report, cases: &[&CaseRow]) -> Markup {
    html! {
        ul.cases {
            @for case in cases.iter().take(LISTED) {
                li.case {
                    (mark(report.outcome(case))) " " code { (text::line(&case.id)) }
                    span.title { (text::line(&case.title)) }
                    @if let CaseResult::Skipped { reason } = &case.result {
                        span.detail { (text::line(reason)) }
                    }
                }
            }
        }
        @if cases.len() > LISTED { p.hint { "And " (cases.len() - LISTED) " more, below." } }
    }
}

/// What was left out of the run as a whole.
fn sentences(report: &Report) -> Vec<String> {
    let selection = &report.selection;
    let mut sentences = Vec::new();
    let fewer = selection.sessions_needed.saturating_sub(selection.sessions);
    if fewer > 0 {
        sentences.push(format!(
            "{} of {} random sessions that a whole verdict needs were not run.",
            fewer, selection.sessions_needed
        ));
    }
    if report.coverage.is_none() && report.verdict.is_conformant() {
        sentences.push("How much of the module was executed was not measured.".to_owned());
    }
    match &report.explored {
        None => sentences.push(
            "Not everything that may happen on the line was tried: the module was not explored."
                .to_owned(),
        ),
        Some(explored) => sentences.extend(explored.refused.as_ref().map(|refused| {
            format!("The module was not explored to the end: {}.", text::line(refused))
        })),
    }
    if report.score.is_none() {
        sentences.push(
            "How many changes of the module the cases would notice was not tried.".to_owned(),
        );
    }
    sentences
}

fn untestable(report: &Report) -> Vec<(String, String)> {
    let of = |clause: &crate::ClauseRow| {
        Some((clause.id.clone(), text::line(clause.excluded.as_ref()?)))
    };
    report.clauses.iter().filter_map(of).collect()
}

/// Clauses that no case can show.
fn clauses(report: &Report) -> Markup {
    let untestable = untestable(report);
    html! {
        @if !untestable.is_empty() {
            details {
                summary { (text::count(untestable.len() as u32, "clause")) " that no case can show" }
                ul.plain-list {
                    @for (id, reason) in &untestable { li { code { (text::line(id)) } ": " (reason) } }
                }
            }
        }
    }
}

fn unexecuted(report: &Report) -> Markup {
    let places = report.coverage.iter().flat_map(|coverage| &coverage.places);
    let row = |place: &Place| {
        let unnamed = || html! { (place.function) };
        let named = |name: &String| html! { code { (text::line(name)) } };
        let function = place.name.as_ref().map_or_else(unnamed, named);
        let source = place.source.as_ref().map(|source| format!(" ({})", text::line(source)));
        (place.at, function, text::line(&place.what) + &source.unwrap_or_default())
    };
    let hint = "What the plug-in does there, nobody has seen. Code that nothing can call, and code that \
                only traps, is not counted.";
    listed("place", "of the module never executed", hint, &places.map(row).collect::<Vec<_>>())
}

fn survivors(report: &Report) -> Markup {
    let is_different = |survivor: &&Survivor| survivor.shown == Shown::Different;
    let survivors = report.score.iter().flat_map(|score| &score.survivors).filter(is_different);
    let row = |survivor: &Survivor| {
        (survivor.at, html! { (survivor.function) }, text::line(&survivor.change))
    };
    let hint = "Each did something else in some run, and no rule was broken: either is allowed, or a rule is \
                missing.";
    listed("change", "of the module not noticed", hint, &survivors.map(row).collect::<Vec<_>>())
}

/// Places of the module: at which byte, in which function, what.
fn listed(noun: &str, what: &str, hint: &str, rows: &[(u64, Markup, String)]) -> Markup {
    let count = rows.len();
    html! {
        @if count > 0 {
            details {
                summary { (text::count(count as u32, noun)) " " (what) }
                p.hint { (hint) }
                table {
                    thead { tr { th { "Byte" } th { "Function" } th { "What" } } }
                    tbody {
                        @for (at, function, what) in rows.iter().take(LISTED) {
                            tr { td { (at) } td { (function) } td { (what) } }
                        }
                    }
                }
                @if count > LISTED { p.hint { "And " (count - LISTED) " more, in the report." } }
            }
        }
    }
}

/// So many of so many.
pub(super) fn part(part: Executed) -> String {
    format!("{} of {}", part.executed, part.of)
}
