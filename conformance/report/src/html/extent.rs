//! How far the plug-in was tried, and what of it was not.

use crate::{Executed, Report, Score, text};
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
    let all = score.noticed.all() + score.missed();
    let share = score.share();
    format!("{}.{} % of {all}, drawn by the seed {}", share / 10, share % 10, score.seed)
}

fn unexecuted(report: &Report) -> Markup {
    let places = report.coverage.iter().flat_map(|coverage| &coverage.places);
    let count = places.clone().count();
    html! {
        @if count > 0 {
            details {
                summary { (text::count(count as u32, "place")) " of the module never executed" }
                p.hint {
                    "What the plug-in does there, nobody has seen. Code that nothing can call, and code \
                     that only traps, is not counted."
                }
                table {
                    thead { tr { th { "Byte" } th { "Function" } th { "What" } } }
                    tbody {
                        @for place in places.take(LISTED) {
                            tr {
                                td { (place.at) }
                                td {
                                    @match &place.name {
                                        Some(name) => code { (text::line(name)) },
                                        None => (place.function),
                                    }
                                }
                                td { (text::line(&place.what)) }
                            }
                        }
                    }
                }
                @if count > LISTED { p.hint { "And " (count - LISTED) " more, in the report." } }
            }
        }
    }
}

fn survivors(score: &Score) -> Markup {
    let survivors = score.survivors.iter().filter(|survivor| survivor.executed);
    let count = survivors.clone().count();
    html! {
        @if count > 0 {
            details {
                summary { (text::count(count as u32, "change")) " of the module not noticed" }
                table {
                    thead { tr { th { "Byte" } th { "Function" } th { "Change" } } }
                    tbody {
                        @for survivor in survivors.take(LISTED) {
                            tr {
                                td { (survivor.at) }
                                td { (survivor.function) }
                                td { (text::line(&survivor.change)) }
                            }
                        }
                    }
                }
                @if count > LISTED { p.hint { "And " (count - LISTED) " more, in the report." } }
            }
        }
    }
}
