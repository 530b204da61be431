//! How far the plug-in was tried, and what of it was not.

use crate::{Executed, Place, Report, Score, Shown, Survivor, text};
use maud::{Markup, html};

/// Places and survivors that the page lists; the report has all of them.
const LISTED: usize = 200;

pub(super) fn section(report: &Report) -> Markup {
    let selection = &report.selection;
    html! {
        section id="extent" {
            h2 { "How far it was tried" }
            dl.facts {
                dt { "Cases" }
                dd { (report.counts.executed) " of " (report.counts.required) " required" }
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
            (unexecuted(report))
            @if let Some(score) = &report.score { (survivors(score)) }
        }
    }
}

fn part(part: Executed) -> String {
    format!("{} of {}", part.executed, part.of)
}

fn noticed(score: &Score) -> String {
    let all = score.told();
    let share = score.share();
    format!(
        "{}.{} % of {all} that show outside, drawn by the seed {}",
        share / 10,
        share % 10,
        score.seed
    )
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
    listed(
        "place",
        "of the module never executed",
        Some(hint),
        &places.map(row).collect::<Vec<_>>(),
    )
}

fn survivors(score: &Score) -> Markup {
    let is_different = |survivor: &&Survivor| survivor.shown == Shown::Different;
    let survivors = score.survivors.iter().filter(is_different);
    let row = |survivor: &Survivor| {
        (survivor.at, html! { (survivor.function) }, text::line(&survivor.change))
    };
    let hint = "Each did something else in some run, and no rule was broken: either is allowed, or a rule is \
                missing.";
    listed(
        "change",
        "of the module not noticed",
        Some(hint),
        &survivors.map(row).collect::<Vec<_>>(),
    )
}

/// Places of the module: at which byte, in which function, what.
fn listed(noun: &str, what: &str, hint: Option<&str>, rows: &[(u64, Markup, String)]) -> Markup {
    let count = rows.len();
    html! {
        @if count > 0 {
            details {
                summary { (text::count(count as u32, noun)) " " (what) }
                @if let Some(hint) = hint { p.hint { (hint) } }
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
