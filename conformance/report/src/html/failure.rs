//! Failed cases: what was demanded and what was seen, as text, bytes and picture.

use super::rows::{anchor, mark};
use super::sequence;
use crate::hex::{self, Pair};
use crate::{CaseRow, FailedRun, Outcome, Report, explain, text};
use maud::{Markup, html};

/// All failed cases, those that decide the verdict first.
pub(super) fn section(report: &Report) -> Markup {
    let mut failed: Vec<_> = report
        .cases
        .iter()
        .map(|case| (report.outcome(case), case))
        .filter(|(outcome, _)| outcome.has_failed())
        .collect();
    failed.sort_by_key(|(outcome, _)| match outcome {
        Outcome::Failed => 0,
        Outcome::Warned => 1,
        Outcome::ExpectedFailure => 2,
        Outcome::Informed => 3,
        _ => 4,
    });
    html! {
        @if !failed.is_empty() {
            section id="failures" {
                h2 { "Failed cases" }
                @for (outcome, case) in failed { (article(report, outcome, case)) }
            }
        }
    }
}

fn article(report: &Report, outcome: Outcome, case: &CaseRow) -> Markup {
    html! {
        article id=(anchor("case", &case.id)) {
            h3 { (mark(outcome)) " " code { (text::line(&case.id)) } }
            p.title { (text::line(&case.title)) }
            @for clause in explain::clauses(report, case) { p.clause { (clause) } }
            @for (number, run) in case.failures.iter().enumerate() {
                @if number == 0 { (first_run(case, run)) }
                @else {
                    details { summary { code { (text::line(&run.run)) } } (failed_run(run)) }
                }
            }
            @if case.more_failures > 0 {
                p.hint { "And " (text::count(case.more_failures, "more failed run")) "." }
            }
        }
    }
}

fn first_run(case: &CaseRow, run: &FailedRun) -> Markup {
    html! {
        div.run {
            @if run.run.strip_prefix(&case.id) != Some("/uncut") { p { "In the run " code { (text::line(&run.run)) } ":" } }
            (failed_run(run))
        }
    }
}

fn failed_run(run: &FailedRun) -> Markup {
    html! {
        p.message {
            strong { (text::line(&run.message)) }
            " at " (text::seconds(run.at_us)) " s "
            span.tag { (text::line(&run.class)) }
            @if let Some(place) = explain::place(run) { " " code { (place) } }
        }
        @if !run.expected.is_empty() || !run.observed.is_empty() {
            dl.sides {
                dt { "Expected" } dd { code { (text::line(&run.expected)) } }
                dt { "Observed" } dd { code { (text::line(&run.observed)) } }
            }
        }
        @if let Some(difference) = hex::Difference::new(&run.expected_bytes, &run.observed_bytes) {
            (bytes(&difference))
        }
        (sequence::picture(run))
        @if !run.before.is_empty() {
            details {
                summary { "Before that, as lines of a trace" }
                pre { @for line in &run.before { (text::line(line)) "\n" } }
            }
        }
        p.again { "Again: " code { (text::line(&run.again)) } }
    }
}

/// The bytes of both sides, one above the other; what differs is underlined, bold and
/// has a mark below it.
fn bytes(difference: &hex::Difference) -> Markup {
    html! {
        div.wide tabindex="0" role="region" aria-label="Bytes around the difference" {
            table.bytes {
                tbody {
                    @for row in &difference.rows {
                        (side("expected", row, |pair| pair.expected))
                        (side("observed", row, |pair| pair.observed))
                        @if row.iter().any(|pair| pair.differs()) {
                            tr.marks aria-hidden="true" {
                                th {}
                                @for pair in row { td { @if pair.differs() { "▲" } } }
                                td {}
                            }
                        }
                    }
                }
            }
        }
        @if difference.is_same() { p.hint { "The same bytes at another time." } }
    }
}

fn side(name: &str, row: &[Pair], of: fn(&Pair) -> Option<u8>) -> Markup {
    html! {
        tr {
            th scope="row" { (name) }
            @for pair in row {
                td { @if pair.differs() { strong.differs { (hex::cell(of(pair))) } } @else { (hex::cell(of(pair))) } }
            }
            td.ascii {
                "|"
                @for pair in row {
                    @if pair.differs() { strong.differs { (hex::glyph(of(pair))) } } @else { (hex::glyph(of(pair))) }
                }
                "|"
            }
        }
    }
}
