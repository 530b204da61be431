//! What was tried: cases, runs, sessions, and how much of the module they reached.

use super::untried::part;
use crate::{Counts, Report, Score, text};
use maud::{Markup, html};

pub(super) fn section(report: &Report) -> Markup {
    let selection = &report.selection;
    html! {
        section id="extent" {
            h2 { "What was tried" }
            dl.facts {
                dt { "Cases" }
                dd { (cases(&report.counts)) }
                @for (name, number) in beside(&report.counts) { dt { (name) } dd { (number) } }
                dt { "Runs" }
                dd { (report.counts.runs) ", permutations and random sessions included" }
                @if selection.sessions_needed > 0 {
                    dt { "Random sessions" }
                    dd {
                        (selection.sessions) " of " (selection.sessions_needed)
                        " that a whole verdict needs, of the seed " (selection.seed)
                    }
                }
                @if let Some(coverage) = &report.coverage {
                    dt { "Functions executed" } dd { (part(coverage.functions)) }
                    dt { "Ways of branches gone" } dd { (part(coverage.branches)) }
                }
                @if let Some(score) = &report.score {
                    dt { "Changes noticed" } dd { (noticed(score)) }
                }
            }
            p.hint {
                "A case counts once, with all its permutations. Unscored cases are newer than the \
                 revision; cases of features that the plug-in does not claim are not run."
            }
        }
    }
}

/// What came of those that are required, in a sentence; what did not happen is not in it.
fn cases(counts: &Counts) -> String {
    let Counts { required, executed, passed, failed, warned, informed, expected, .. } = *counts;
    let mut parts = vec![format!("{executed} of {required} required cases executed")];
    if passed > 0 && passed == required {
        return format!("{executed} of {required} required cases executed, all passed");
    }
    for (number, what) in [
        (passed, "passed"),
        (failed, "failed"),
        (warned, "failed, level SHOULD"),
        (informed, "failed, level MAY"),
        (expected, "failed as the baseline expects"),
    ] {
        if number > 0 {
            parts.push(format!("{number} {what}"));
        }
    }
    parts.join("; ")
}

/// Cases that the verdict does not need, where there are any.
fn beside(counts: &Counts) -> impl Iterator<Item = (&'static str, String)> {
    let rows = [
        ("Unscored", text::count(counts.unscored, "case")),
        ("Not claimed", text::count(counts.unclaimed, "case")),
    ];
    let numbers = [counts.unscored, counts.unclaimed];
    rows.into_iter().zip(numbers).filter(|(_, number)| *number > 0).map(|(row, _)| row)
}

fn noticed(score: &Score) -> String {
    let all = score.told();
    if all == 0 {
        return format!("None that was tried shows outside, drawn by the seed {}", score.seed);
    }
    let share = score.share();
    format!(
        "{}.{} % of {all} that show outside, drawn by the seed {}",
        share / 10,
        share % 10,
        score.seed
    )
}
