//! Baselines: what is expected to fail must fail, for its reason.

use crate::common::small::{Small, options, run, small};
use softplug_conformance::certify::{Baseline, BaselineError, CertifyOptions};
use softplug_report::{CaseResult, Report, VerdictKind};
use std::path::Path;

const GOOD: Small = Small::good("xon-xoff.a.good");
const BAD: Small = Small::bad("xon-xoff.b.bad");

fn with(entry: &str) -> Report {
    let text = format!("[[expected]]\n{entry}");
    let baseline = Baseline::parse(Path::new("known.toml"), &text).expect("it can be read");
    let foreign = Small { clause: "xon-xoff.tx.foreign", ..Small::bad("xon-xoff.c.bad") };
    let options = CertifyOptions { baseline: Some(baseline), ..options() };
    run(&small(&[GOOD, BAD, foreign]), &options)
}

#[test]
fn what_is_expected_makes_a_run_partial() {
    let report = with("case = \"xon-xoff.b.bad\"\nclass = \"diverged\"\nreason = \"Known.\"");
    assert_eq!((report.verdict, report.counts.expected), (VerdictKind::Partial, 1));
    let reason = "Known.".to_owned();
    assert_eq!(report.cases[1].result, CaseResult::ExpectedFailure { reason });
    assert!(!report.cases[1].failures.is_empty());
    assert!(report.selection.baseline.is_some());
}

#[test]
fn a_stale_entry_fails_the_run() {
    let also =
        "\n[[expected]]\ncase = \"xon-xoff.b.bad\"\nclass = \"diverged\"\nreason = \"Known.\"";
    for (entry, why) in [
        (
            "case = \"xon-xoff.z\"\nclass = \"diverged\"\nreason = \"Known.\"",
            "there is no such case",
        ),
        ("case = \"xon-xoff.a.good\"\nclass = \"diverged\"\nreason = \"Known.\"", "it passes"),
        ("case = \"xon-xoff.c.bad\"\nclass = \"diverged\"\nreason = \"Known.\"", "does not run"),
    ] {
        let report = with(&format!("{entry}{also}"));
        assert_eq!(report.verdict, VerdictKind::NotConformant);
        assert!(
            report.reason.contains("stale") && report.reason.contains(why),
            "{}",
            report.reason
        );
    }
    for (entry, why) in [
        ("class = \"diverged\"", "it has no reason"),
        ("class = \"diverged\"\nreason = \" \"", "it has no reason"),
        ("class = \"trapped\"\nreason = \"Known.\"", "it fails as diverged, trapped is expected"),
    ] {
        let report = with(&format!("case = \"xon-xoff.b.bad\"\n{entry}"));
        assert_eq!(report.verdict, VerdictKind::NotConformant);
        assert_eq!(report.cases[1].result, CaseResult::Failed);
        assert!(report.reason.contains(why), "{}", report.reason);
    }
}

#[test]
fn an_entry_says_nothing_of_a_case_that_was_filtered() {
    let text = "[[expected]]\ncase = \"xon-xoff.b.bad\"\nclass = \"trapped\"\nreason = \"Known.\"";
    let baseline = Baseline::parse(Path::new("known.toml"), text).expect("it can be read");
    let cases = vec!["*.good".to_owned()];
    let options = CertifyOptions { baseline: Some(baseline), cases, ..options() };
    assert_eq!(run(&small(&[GOOD, BAD]), &options).verdict, VerdictKind::Partial);
}

#[test]
fn a_damaged_baseline_is_an_error_with_its_place() {
    let fault = |text: &str| {
        let error = Baseline::parse(Path::new("known.toml"), text).expect_err("it is damaged");
        error.to_string()
    };
    let twice = "[[expected]]\ncase = \"a.b\"\nclass = \"diverged\"\nreason = \"x\"\n";
    for (text, place) in [
        ("[[expected]\n", "known.toml:1:12: "),
        ("[[expected]]\ncase = \"a\nclass = 1", "known.toml:2:10: "),
        (
            "[[expected]]\ncase = \"a.b\"\nclass = \"divergd\"",
            "known.toml:3:9: there is no failure",
        ),
        ("[[expected]]\ncase = \"a.b\"\nclas = \"diverged\"", "known.toml:3:1: unknown field"),
        (&format!("{twice}{twice}"), "known.toml:6:8: \"a.b\" stands here twice"),
    ] {
        assert!(fault(text).starts_with(place), "{text}\n{}", fault(text));
    }
    let none = Baseline::read(Path::new("/nowhere/known.toml"));
    assert!(matches!(none, Err(BaselineError::Io { .. })));
}
