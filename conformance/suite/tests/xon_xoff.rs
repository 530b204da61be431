//! The XON/XOFF plug-in passes its profile in every permutation, natively and in
//! the sandbox, and both do the same.

mod common;

use common::{assert_all_pass, native, root, sandboxed};
use softplug_conformance::{Case, Filter, Judge, Summary, load, run_all};
use std::collections::BTreeSet;

fn cases() -> Vec<Case> {
    load([root().join("fixtures/traces/xon-xoff")])
        .unwrap_or_else(|error| panic!("{}", error.report()))
}

fn judged(subject: &dyn Judge) -> Summary {
    let summary = run_all(&[subject], &cases(), &Filter::default());
    assert_all_pass(subject, &summary);
    summary
}

#[test]
fn passes_natively_and_in_the_sandbox_alike() {
    let native = judged(&native("xon-xoff"));
    let sandboxed = judged(&sandboxed("xon-xoff"));
    assert_eq!(native.digest, sandboxed.digest, "native and sandboxed code do different things");
    let names = |summary: &Summary| -> Vec<String> {
        summary.cases.iter().map(|verdict| verdict.case.clone()).collect()
    };
    assert_eq!(names(&native), names(&sandboxed));
    assert_permutations(&native);
}

/// The permutations that no trace may lack, and those that only some can have.
fn assert_permutations(summary: &Summary) {
    let ids: BTreeSet<&str> =
        summary.cases.iter().filter_map(|case| case.case.split('/').next()).collect();
    assert!(ids.len() >= 28, "only {} traces", ids.len());
    let has =
        |id: &str, name: &str| summary.cases.iter().any(|case| case.case == format!("{id}/{name}"));
    for id in ids {
        for name in ["uncut", "twice", "swap:all", "swap:1"] {
            assert!(has(id, name), "{id} lacks {name}");
        }
    }
    let cut = ["cut:1", "cut:whole", "cut:random-01", "cut:random-32"];
    for name in cut {
        assert!(has("xon-xoff.tx.one-read-xon-xoff", name), "no {name}");
    }
    assert!(has("xon-xoff.tx.window-xoff", "late"));
    assert!(!has("xon-xoff.tx.hold", "cut:1"), "single bytes cannot be cut");
}

#[test]
fn two_runs_give_the_same_report() {
    let few: Vec<Case> = cases().into_iter().take(5).collect();
    let report = || run_all(&[&native("xon-xoff")], &few, &Filter::default());
    assert_eq!(report(), report());
}

#[test]
fn every_trace_is_in_canonical_form() {
    for case in cases() {
        let text = std::fs::read_to_string(&case.path).expect("it was just read");
        let canonical = case.trace.format();
        assert!(text == canonical, "{} is not: run softplug trace fmt", case.path.display());
    }
}
