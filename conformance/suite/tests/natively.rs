//! Every reference plug-in passes its profiles in every permutation, natively: what the suite
//! does without an engine, quick enough to be run after each of thousands of changes.

mod common;

use common::{assert_all_pass, cases, native};
use softplug_conformance::{Case, Filter, Judge, Summary, run_all};
use softplug_native::NativePlugin;
use std::collections::BTreeSet;

#[test]
fn every_plug_in_passes_in_every_permutation() {
    for plugin in NativePlugin::ALL {
        let subject = native(plugin.name());
        for profile in &subject.manifest().profiles {
            let summary = run_all(&[&subject], &cases(&profile.name), &Filter::default());
            assert_all_pass(&subject, &summary);
            assert_permutations(&summary);
        }
    }
}

/// No trace lacks one that can be made of each.
fn assert_permutations(summary: &Summary) {
    let cases: BTreeSet<&str> = names(summary).into_iter().collect();
    let ids: BTreeSet<&str> = cases.iter().filter_map(|case| case.split('/').next()).collect();
    assert!(!ids.is_empty());
    for id in ids {
        for name in ["uncut", "twice", "swap:all", "swap:1"] {
            assert!(cases.contains(format!("{id}/{name}").as_str()), "{id} lacks {name}");
        }
    }
}

fn names(summary: &Summary) -> Vec<&str> {
    summary.cases.iter().map(|verdict| verdict.case.as_str()).collect()
}

#[test]
fn only_what_can_be_cut_is_cut() {
    let few = Filter::only([
        "xon-xoff.tx.one-read-xon-xoff",
        "xon-xoff.tx.window-xoff",
        "xon-xoff.tx.hold",
    ]);
    let summary = run_all(&[&native("xon-xoff")], &cases("xon-xoff"), &few);
    let has = |case: &str| names(&summary).contains(&case);
    for name in ["cut:1", "cut:whole", "cut:random-01", "cut:random-32"] {
        assert!(has(&format!("xon-xoff.tx.one-read-xon-xoff/{name}")), "no {name}");
    }
    assert!(has("xon-xoff.tx.window-xoff/late"));
    assert!(!has("xon-xoff.tx.hold/cut:1"), "single bytes cannot be cut");
}

#[test]
fn two_runs_give_the_same_report() {
    let few: Vec<Case> = cases("xon-xoff").into_iter().take(5).collect();
    let report = || run_all(&[&native("xon-xoff")], &few, &Filter::default());
    assert_eq!(report(), report());
}
