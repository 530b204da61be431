//! What exploring has found: the configurations, and the way to what must never be.

use crate::{Drawn, Explored, ExploredConfiguration, Found, Report, Side, text};
use maud::{Markup, html};

pub(super) fn section(report: &Report) -> Markup {
    html! {
        @if let Some(explored) = &report.explored {
            section id="explored" {
                h2 { "Explored" }
                p {
                    "Everything that line, partner and host may do, with at most "
                    (text::count(explored.faults.into(), "fault")) " on one way, was tried"
                    @if explored.found().is_some() { ", until something was found" }
                    ": " (explored.states()) " states, " (explored.transitions()) " choices."
                }
                @if let Some(refused) = &explored.refused {
                    p.mark.part { "It was not explored to the end: " (text::line(refused)) "." }
                }
                @if !explored.configurations.is_empty() { (table(explored)) }
            }
        }
    }
}

/// What must never be and was found, apart: it stands with what failed.
pub(super) fn found(report: &Report) -> Markup {
    let found = report.explored.as_ref().and_then(|explored| Some((explored, explored.found()?)));
    html! {
        @if let Some((explored, (configuration, found))) = found {
            section id="found" {
                h2 { "Found by exploring" }
                (counterexample(report, explored, configuration, found))
            }
        }
    }
}

fn counterexample(
    report: &Report,
    explored: &Explored,
    configuration: &ExploredConfiguration,
    found: &Found,
) -> Markup {
    let name = text::line(&configuration.name);
    let has_second = found.drawn.iter().any(|row| row.side == Side::Partner);
    html! {
        article.bad {
            h3 { span.mark { "✗ " (text::line(&found.promise)) } " in " (name) }
            p.message { (text::line(&found.text)) "." }
            div.wide {
                table.way {
                    caption.hint { "The shortest way to it, from the top down." }
                    thead {
                        tr {
                            th.number scope="col" { "s" }
                            th scope="col" { "Plug-in (0)" }
                            th scope="col" { @if has_second { "Second plug-in (1)" } @else { "Partner (1)" } }
                        }
                    }
                    tbody { @for row in &found.drawn { (drawn(row)) } }
                }
            }
            p.again {
                "Run it again: "
                code {
                    "softplug explore PLUGIN --profile " (text::line(&report.profile.name))
                    " --only " (name) " --faults " (explored.faults)
                    " --out DIR"
                }
            }
        }
    }
}

fn drawn(row: &Drawn) -> Markup {
    let (time, what) = (text::seconds(row.at_us), text::line(&row.text));
    html! {
        @match row.side {
            Side::Plugin => tr { td.number { (time) } td { code { (what) } } td {} },
            Side::Partner => tr { td.number { (time) } td {} td { code { (what) } } },
            Side::Line => tr.fault { td.number { (time) } td colspan="2" { "✗ " (what) } },
        }
    }
}

fn table(explored: &Explored) -> Markup {
    html! {
        div.wide {
            table {
                thead {
                    tr {
                        th scope="col" { "Configuration" }
                        th scope="col" { "At the other end" }
                        th.number scope="col" { "States" }
                        th.number scope="col" { "Choices" }
                        th.number scope="col" { "Deep" }
                        th.number scope="col" { "To rest, s" }
                        th scope="col" { "Allowed" }
                        th scope="col" { "Digest" }
                    }
                }
                tbody { @for configuration in &explored.configurations { (row(configuration)) } }
            }
        }
        p.hint {
            "To rest: how long it takes at most, from any state, when nothing goes wrong any more. Allowed: what \
             the protocol cannot keep from happening, and how often it did."
        }
        @if let Some(coverage) = &explored.coverage {
            p.hint {
                "Executed on the way: " (coverage.functions.executed) " of " (coverage.functions.of)
                " functions, " (coverage.branches.executed) " of " (coverage.branches.of)
                " ways of branches."
            }
        }
    }
}

fn row(configuration: &ExploredConfiguration) -> Markup {
    let ExploredConfiguration { states, transitions, depth, .. } = configuration;
    let unavoidable = configuration.unavoidable.iter();
    let unavoidable = unavoidable.map(|(name, times)| format!("{} {times}", text::line(name)));
    html! {
        tr {
            th scope="row" { (text::line(&configuration.name)) }
            td {
                (text::line(&configuration.partner))
                @if !configuration.held_to_model { "; no model for these settings" }
            }
            td.number { (states) }
            td.number { (transitions) }
            td.number { (depth) }
            td.number { @if let Some(time) = configuration.longest_us { (text::seconds(time)) } }
            td { (unavoidable.collect::<Vec<_>>().join(", ")) }
            td { code { (configuration.digest) } }
        }
    }
}
