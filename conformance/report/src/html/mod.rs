//! `report.html`: one file for people. It needs no network and no script; it can be
//! read in light and dark, on paper and by a screen reader.

mod explored;
mod extent;
mod failure;
mod record;
mod rows;
mod sequence;
mod untried;

use crate::{Outcome, Report, VerdictKind, text};
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use sha2::{Digest, Sha256};

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");
/// Cases that are named in the head of the page.
const NAMED: usize = 12;

/// The report as a page.
///
/// ```
/// use softplug_report::{html, json};
///
/// let text = std::fs::read_to_string("tests/reports/conformant.json")?;
/// let report = json::read(std::path::Path::new("conformance.json"), &text)?;
/// assert!(html::write(&report).starts_with("<!DOCTYPE html>"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn write(report: &Report) -> String {
    let title = format!(
        "{} {}: {}",
        plugin_name(report),
        text::line(&report.profile.name),
        report.verdict.text()
    );
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(policy());
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="referrer" content="no-referrer";
                title { (title) }
                style { (PreEscaped(STYLE)) (PreEscaped(record::paper(report))) }
            }
            body {
                (top(report))
                main {
                    (record::signatures())
                    (lint(report))
                    (failure::section(report))
                    (explored::found(report))
                    (untried::section(report))
                    (extent::section(report))
                    (explored::section(report))
                    (rows::clauses(report))
                    (rows::cases(report))
                    (fuel(report))
                    (origin(report))
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    let mut page = page.into_string();
    page.push('\n');
    page
}

/// Nothing may be fetched, and no script runs but the page's own.
fn policy() -> String {
    let digest = BASE64_STANDARD.encode(Sha256::digest(SCRIPT));
    format!(
        "default-src 'none'; style-src 'unsafe-inline'; script-src 'sha256-{digest}'; \
         base-uri 'none'; form-action 'none'"
    )
}

fn plugin_name(report: &Report) -> String {
    let name = text::line(&report.plugin.name);
    if name.is_empty() { "unnamed plug-in".to_owned() } else { name }
}

/// Class and sign of a verdict.
fn look(verdict: VerdictKind) -> (&'static str, &'static str) {
    match verdict {
        VerdictKind::Conformant => ("good", "✓"),
        VerdictKind::ConformantWithWarnings => ("warn", "✓!"),
        VerdictKind::Partial => ("part", "◐"),
        VerdictKind::NotConformant => ("bad", "✗"),
        VerdictKind::NotJudged => ("none", "?"),
    }
}

fn top(report: &Report) -> Markup {
    let (class, sign) = look(report.verdict);
    let profile = &report.profile;
    html! {
        header class=(class) {
            p.eyebrow { "Conformance report · " (plugin_name(report)) " " (text::line(&report.plugin.version)) " · " (text::line(&profile.name)) " revision " (profile.revision) }
            h1 { span.sign aria-hidden="true" { (sign) } " " (sentence(report.verdict)) }
            p.reason { (text::line(&report.reason)) "." }
            @for remark in remarks(report) { p.remark { (remark) } }
            (worst(report))
            (record::identity(report))
        }
    }
}

/// What failed and what was not executed, by name: whoever files the page reads no further.
fn worst(report: &Report) -> Markup {
    let with = |is: fn(Outcome) -> bool| {
        let cases = report.cases.iter().filter(move |case| is(report.outcome(case)));
        cases.map(|case| case.id.as_str()).collect::<Vec<_>>()
    };
    let failed = with(Outcome::has_failed);
    let missing = with(|outcome| outcome == Outcome::Missing);
    let more = |count: usize| (count > NAMED).then(|| format!(" and {} more", count - NAMED));
    html! {
        @if !failed.is_empty() {
            p.remark {
                "Failed: "
                @for (at, id) in failed.iter().take(NAMED).enumerate() {
                    @if at > 0 { ", " }
                    a href={ "#" (rows::anchor("case", id)) } { code { (text::line(id)) } }
                }
                (more(failed.len()).unwrap_or_default()) "."
            }
        }
        @if !missing.is_empty() {
            p.remark {
                a href="#untried" { "Not executed" } ": "
                @for (at, id) in missing.iter().take(NAMED).enumerate() {
                    @if at > 0 { ", " }
                    code { (text::line(id)) }
                }
                (more(missing.len()).unwrap_or_default()) "."
            }
        }
    }
}

/// The verdict as what it says of the plug-in.
const fn sentence(verdict: VerdictKind) -> &'static str {
    match verdict {
        VerdictKind::Conformant => "Conformant",
        VerdictKind::ConformantWithWarnings => "Conformant, with warnings",
        VerdictKind::Partial => "Partial: conformance is not shown",
        VerdictKind::NotConformant => "Not conformant",
        VerdictKind::NotJudged => "Not judged: the plug-in could not be run",
    }
}

/// What a reader must know beside the verdict.
fn remarks(report: &Report) -> Vec<String> {
    let (selection, profile) = (&report.selection, &report.profile);
    let mut remarks = Vec::new();
    if selection.interrupted {
        remarks.push("The run was interrupted.".to_owned());
    }
    if !selection.cases.is_empty() {
        let patterns: Vec<_> = selection.cases.iter().map(|glob| text::quoted(glob)).collect();
        remarks.push(format!("Only cases that match {} were run.", patterns.join(", ")));
    }
    if selection.baseline.is_some() {
        remarks.push("A baseline of expected failures was given.".to_owned());
    }
    if selection.strict {
        remarks.push("Strict: a failed SHOULD counts as a failed MUST.".to_owned());
    }
    if report.verdict == VerdictKind::NotJudged {
        // Nothing is known of a manifest that may not have been read.
    } else if !profile.claimed {
        remarks.push(
            "The manifest does not claim this profile; the plug-in was judged by its core."
                .to_owned(),
        );
    } else if !profile.features.is_empty() {
        let features: Vec<_> = profile.features.iter().map(|name| text::line(name)).collect();
        remarks.push(format!("Optional features claimed: {}.", features.join(", ")));
    }
    remarks
}

fn lint(report: &Report) -> Markup {
    html! {
        @if !report.lint.is_empty() {
            section id="lint" {
                h2 { "Why no case was run" }
                p { "Before the first case a module is held against the ABI, loaded and started:" }
                ul { @for finding in &report.lint { li { (text::line(finding)) } } }
            }
        }
    }
}

fn fuel(report: &Report) -> Markup {
    let fuel = &report.fuel;
    let per_byte = format!("{}.{}", fuel.tenths_per_byte / 10, fuel.tenths_per_byte % 10);
    html! {
        section id="fuel" {
            h2 { "Computing" }
            dl.facts {
                dt { "Fuel used" }
                dd { (fuel.units) " units for " (fuel.bytes) " bytes" }
                @if fuel.bytes > 0 { dt { "A byte" } dd { (per_byte) " units" } }
                @if !fuel.largest_case.is_empty() {
                    dt { "Largest event" }
                    dd { (fuel.largest_event) " units, in " code { (text::line(&fuel.largest_case)) } }
                }
            }
            p.hint { "From the uncut runs of the required cases. Figures hold for this engine and version only." }
        }
    }
}

fn origin(report: &Report) -> Markup {
    html! {
        section id="origin" {
            h2 { "What was judged, and how to do it again" }
            dl.facts {
                dt { "Module, SHA-256" } dd { code { (report.plugin.sha256) } }
                dt { "Module, size" } dd { (report.plugin.bytes) " bytes"
                    @if !report.plugin.abi.is_empty() { ", ABI " (text::line(&report.plugin.abi)) } }
                dt { "Corpus, SHA-256" } dd { code { (report.suite.corpus) } }
                @if let Some(baseline) = &report.selection.baseline {
                    dt { "Baseline, SHA-256" } dd { code { (baseline) } }
                }
                dt { "Digest of the observed" } dd { code { (report.digest) } }
                dt { "Run it again" }
                dd {
                    code {
                        "softplug verify conformance.json PLUGIN"
                        @if report.selection.baseline.is_some() { " --baseline BASELINE" }
                    }
                }
            }
            p.hint {
                "The digest covers id, verdict and observable actions of every uncut case. "
                code { "PLUGIN" } " stands for the module's file."
                @if report.selection.baseline.is_some() {
                    " " code { "BASELINE" } " for that of the expected failures."
                }
            }
        }
    }
}
