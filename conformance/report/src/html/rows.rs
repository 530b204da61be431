//! The tables of clauses and cases.

use crate::{CaseResult, CaseRow, ClauseRow, Outcome, Report, text};
use maud::{Markup, html};
use std::collections::BTreeMap;

/// Class of an outcome's mark.
const fn class(outcome: Outcome) -> &'static str {
    match outcome {
        Outcome::Passed => "good",
        Outcome::Failed => "bad",
        Outcome::Warned => "warn",
        Outcome::ExpectedFailure | Outcome::Missing => "part",
        _ => "none",
    }
}

pub(super) fn mark(outcome: Outcome) -> Markup {
    let sign = match outcome {
        Outcome::Passed | Outcome::UnscoredPass => "✓",
        Outcome::Missing | Outcome::UnscoredSkip | Outcome::Unclaimed => "–",
        _ => "✗",
    };
    html! {
        span class={ "mark " (class(outcome)) } { span aria-hidden="true" { (sign) } " " (outcome.text()) }
    }
}

pub(super) fn anchor(kind: &str, id: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_');
    let slug = id.chars().map(|c| if is_plain(c) { c } else { '-' });
    format!("{kind}-{}", slug.collect::<String>())
}

pub(super) fn clauses(report: &Report) -> Markup {
    html! {
        section id="clauses" {
            h2 { "Clauses" }
            div.wide tabindex="0" role="region" aria-label="Table of clauses" {
                table {
                    thead { tr {
                        th scope="col" { "Clause" }
                        th scope="col" { "Level" }
                        th.number scope="col" { "Cited by cases" }
                        th.number scope="col" { "Executed" }
                        th.number scope="col" { "Failed" }
                        th.number scope="col" { "Mutants killed" }
                    } }
                    tbody { @for clause in &report.clauses { (clause_row(clause)) } }
                }
            }
            p.hint {
                "Mutants are reference plug-ins that break one clause on purpose; a killed one shows \
                 that the cases notice. A clause is not shown if none of its cases was executed."
            }
        }
    }
}

fn clause_row(clause: &ClauseRow) -> Markup {
    let is_shown = clause.executed > 0 || clause.excluded.is_some();
    html! {
        tr id=(anchor("clause", &clause.id)) {
            th scope="row" {
                code { (text::line(&clause.id)) }
                @if let Some(feature) = &clause.feature { " " span.tag { "feature " (text::line(feature)) } }
                p.sentence { (text::line(&clause.sentence)) }
                @if let Some(reason) = &clause.excluded { p.sentence { "Not testable: " (text::line(reason)) } }
            }
            td { (clause.level.keyword()) }
            td.number { (clause.cited) }
            td.number {
                (clause.executed)
                @if !is_shown { span.mark.part { " not shown" } }
            }
            td.number {
                (clause.failed)
                @if clause.failed > 0 { " " span.mark.bad { span aria-hidden="true" { "✗" } } }
            }
            td.number { (clause.mutants) }
        }
    }
}

/// The cases, each under the first of its clauses.
pub(super) fn cases(report: &Report) -> Markup {
    let mut groups: BTreeMap<&str, Vec<&CaseRow>> = BTreeMap::new();
    for case in &report.cases {
        groups.entry(case.clauses.first().map_or("", String::as_str)).or_default().push(case);
    }
    html! {
        section id="cases" {
            h2 { "Cases by clause" }
            form.filter hidden {
                label { "Show cases with " input type="search" name="text"; }
                label { input type="checkbox" name="failed"; " only what did not pass" }
            }
            @for (clause, cases) in &groups { (group(report, clause, cases)) }
        }
    }
}

fn group(report: &Report, clause: &str, cases: &[&CaseRow]) -> Markup {
    let passed = |case: &&&CaseRow| report.outcome(case) == Outcome::Passed;
    let count = cases.iter().filter(passed).count();
    let is_open = cases.iter().any(|case| report.outcome(case).has_failed());
    html! {
        details.group open[is_open] {
            summary {
                code { @if clause.is_empty() { "no clause" } @else { (text::line(clause)) } }
                span.tally { (count) " of " (cases.len()) " passed" }
            }
            ul.cases { @for case in cases { (case_row(report, case)) } }
        }
    }
}

fn case_row(report: &Report, case: &CaseRow) -> Markup {
    let outcome = report.outcome(case);
    let others: Vec<_> = case.clauses.iter().skip(1).map(|id| text::line(id)).collect();
    html! {
        li.case data-passed[outcome == Outcome::Passed] {
            (mark(outcome)) " "
            @if outcome.has_failed() { a href={ "#" (anchor("case", &case.id)) } { code { (text::line(&case.id)) } } }
            @else { code { (text::line(&case.id)) } }
            span.title { (text::line(&case.title)) }
            span.detail {
                (case.level.keyword()) " · " (text::count(case.runs, "run"))
                @if case.fuel > 0 { " · " (case.fuel) " units of fuel" }
                @match &case.result {
                    CaseResult::Skipped { reason } | CaseResult::ExpectedFailure { reason } => {
                        " · " (text::line(reason))
                    }
                    _ => {}
                }
                @if !others.is_empty() { " · shows " (others.join(", ")) " too" }
            }
        }
    }
}
