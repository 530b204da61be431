//! Changes of a module: what notices them.

use crate::common::small::{Small, claiming, plugin, small};
use softplug_conformance::Corpus;
use softplug_conformance::score::{ScoreError, ScoreOptions, score};
use softplug_report::{Score, Shown};
use std::sync::atomic::AtomicBool;

const GOOD: Small = Small::good("xon-xoff.a.good");

fn few(threads: usize) -> ScoreOptions {
    ScoreOptions { sample: Some(40), seed: 7, sessions: 0, permutations: 400, crossed: 20, threads }
}

fn scored(module: &[u8], corpus: &Corpus, options: &ScoreOptions) -> Result<Score, ScoreError> {
    score(module, corpus, options, &|_, _| {}, &AtomicBool::new(false))
}

#[test]
fn changes_are_noticed_or_survive_or_stand_where_nothing_is_executed() {
    let corpus = small(&[GOOD]);
    let score = scored(&plugin(), &corpus, &few(2)).expect("it is conformant");
    assert!(score.adds_up());
    assert_eq!((score.tried, score.seed), (40, 7));
    assert!(score.noticed.cases > 0, "{score:?}");
    // One case executes little of the module.
    assert!(score.survived(Shown::NotExecuted) > 10, "{score:?}");
    assert_eq!(scored(&plugin(), &corpus, &few(1)).expect("as before"), score);
}

#[test]
fn crossed_traces_tell_what_no_case_shows() {
    let corpus = small(&[GOOD]);
    let told = |crossed| {
        let options = ScoreOptions { sample: Some(120), crossed, ..few(2) };
        let score = scored(&plugin(), &corpus, &options).expect("it is conformant");
        (score.noticed.all(), score.survived(Shown::NotExecuted), score.survived(Shown::Different))
    };
    let (without, with) = (told(0), told(100));
    assert_eq!((without.0, without.1), (with.0, with.1), "what the runs notice stays");
    assert!(without.2 < with.2, "{without:?} {with:?}");
}

#[test]
fn only_a_plug_in_that_passes_has_a_score() {
    let bad = small(&[GOOD, Small::bad("xon-xoff.b.bad")]);
    let error = scored(&plugin(), &bad, &few(2)).unwrap_err();
    assert!(matches!(&error, ScoreError::Fails { run } if run == "xon-xoff.b.bad"), "{error}");
    let other = claiming(r#"{"name":"other","features":[]}"#);
    let error = scored(&other, &small(&[GOOD]), &few(2)).unwrap_err();
    assert!(matches!(error, ScoreError::NoProfile), "{error}");
}

#[test]
fn whoever_stops_it_gets_no_score() {
    let stop = AtomicBool::new(true);
    let stopped = score(&plugin(), &small(&[GOOD]), &few(2), &|_, _| {}, &stop);
    assert!(matches!(stopped, Err(ScoreError::Stopped)));
}
