//! Every reference plug-in passes its profiles in every permutation, natively: what the suite
//! does without an engine, quick enough to be run after each of thousands of changes.

use crate::common::{assert_all_pass, cases, native};
use softplug_conformance::{Case, Filter, Judge, Summary, run_all};
use softplug_native::NativePlugin;
use std::collections::BTreeSet;

/// A test for each plug-in, by its name: a change to one needs no other.
macro_rules! passes_in_every_permutation {
    ($($test:ident $plugin:literal),* $(,)?) => {
        $(
            #[test]
            fn $test() {
                assert_passes($plugin);
            }
        )*

        #[test]
        fn no_plug_in_is_left_out() {
            let tested = BTreeSet::from([$($plugin),*]);
            let all: BTreeSet<_> = NativePlugin::ALL.iter().map(|plugin| plugin.name()).collect();
            assert_eq!(tested, all);
        }
    };
}

passes_in_every_permutation! {
    xon_xoff "xon-xoff",
    r3964 "r3964",
    r3964_simplified "r3964-simplified",
    fanuc_rs232 "fanuc-rs232",
    heidenhain_fe "heidenhain-fe",
    pulse_lathe "pulse-lathe",
    xmodem "xmodem",
    kermit "kermit",
}

fn assert_passes(plugin: &str) {
    let subject = native(plugin);
    for profile in &subject.manifest().profiles {
        let summary = run_all(&[&subject], &cases(&profile.name), &Filter::default());
        assert_all_pass(&subject, &summary);
        assert_permutations(&summary);
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
