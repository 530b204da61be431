//! Each verdict, and each way to be incomplete.

use crate::common::module;
use crate::common::small::{Small, claiming, judge, options, patched, plugin, run, small};
use softplug_conformance::Corpus;
use softplug_conformance::certify::{
    ABI, CertifyError, CertifyOptions, Loaded, Progress, certify, observe,
};
use softplug_report::{CaseResult, VerdictKind, check, json};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

const GOOD: Small = Small::good("xon-xoff.a.good");
const BAD: Small = Small::bad("xon-xoff.b.bad");

#[test]
fn all_passed_is_conformant() {
    let report = run(&small(&[GOOD]), &options());
    assert_eq!(report.verdict, VerdictKind::Conformant);
    assert!(report.reason.starts_with("all 1 required cases passed; "), "{}", report.reason);
    assert_eq!(report.cases[0].result, CaseResult::Passed);
    // uncut, wasmi, twice, swap:all and at least one single swap.
    assert!(report.cases[0].runs >= 5);
    assert!(report.suite.engine.starts_with("wasmtime "), "{}", report.suite.engine);
    assert!(report.suite.second_engine.starts_with("wasmi "), "{}", report.suite.second_engine);
}

/// The manifest's claims make room for the key; what follows closes the list.
fn using(bytes: u32) -> Vec<u8> {
    let claims = format!(
        r#"{{"name":"xon-xoff","features":["transparent"]}}],"memory_bytes":{bytes},"line_when":["#
    );
    let module = claiming(&claims);
    let abi = b"\"abi\":\"1.0\"";
    let at = module.windows(abi.len()).position(|window| window == abi).expect("it has an ABI");
    patched(&module, at, abi.len(), "\"abi\":\"1.1\"")
}

#[test]
fn a_plug_in_that_says_how_much_memory_it_uses_gets_no_more() {
    let of = |bytes| judge(&using(bytes), &small(&[GOOD]), &options()).expect("the engines work");
    let report = of(65_536);
    assert_eq!(report.verdict, VerdictKind::Conformant, "{}", report.reason);
    assert!(report.suite.second_engine.starts_with("softplug"), "{}", report.suite.second_engine);
    // The mailbox ends behind 35,840, and the data before 26,624.
    let report = of(30_720);
    assert_eq!(report.verdict, VerdictKind::NotConformant, "{}", report.reason);
    assert_eq!(report.cases[0].failures[0].run, "xon-xoff.a.good/interpreter");
    let module = using(30_720);
    let run = ["xon-xoff.a.good/interpreter"];
    assert_eq!(observe(&loaded(&module), &small(&[GOOD]), run, &options()).len(), 1);
    assert_eq!(of(20_480).verdict, VerdictKind::NotJudged);
}

#[test]
fn a_failure_says_all_that_there_is_to_say() {
    let corpus = small(&[GOOD, BAD]);
    let report = run(&corpus, &options());
    assert_eq!(report.verdict, VerdictKind::NotConformant);
    assert_eq!((report.counts.required, report.counts.failed), (2, 1));
    let failed = &report.cases[1].failures[0];
    assert_eq!(failed.run, "xon-xoff.b.bad/uncut");
    assert_eq!(failed.class, "diverged");
    assert_eq!(
        (failed.file.as_str(), failed.line),
        ("traces/xon-xoff/xon-xoff.b.bad.spt", Some(12))
    );
    assert_eq!((failed.expected_bytes.as_str(), failed.observed_bytes.as_str()), ("42", "41"));
    assert!(failed.before.iter().any(|line| line.contains("send 1")), "{:?}", failed.before);
    let again = "softplug certify PLUGIN --profile xon-xoff --case xon-xoff.b.bad";
    assert_eq!(failed.again, again);
    assert_eq!(report.cases[1].failures[1].run, "xon-xoff.b.bad/wasmi");
    assert!(report.cases[1].more_failures > 0);
    assert_eq!((report.clauses[0].cited, report.clauses[0].failed), (2, 1));

    let runs = ["xon-xoff.b.bad/uncut", "xon-xoff.b.bad/swap:all", "nothing/uncut", "nothing"];
    let observed = observe(&loaded(&plugin()), &corpus, runs, &CertifyOptions::new("xon-xoff"));
    assert_eq!(observed.len(), 2);
    let trace = softplug_trace::Trace::parse(&observed[0].text).expect("it is a trace");
    assert!(trace.format().contains("> 0.000000 41"), "{}", observed[0].text);
}

#[test]
fn levels_fail_warn_and_inform() {
    let should = Small { level: "should", ..BAD };
    let may = Small { level: "may", ..BAD };
    let strict = CertifyOptions { strict: true, ..options() };
    let of = |case: &Small, options: &CertifyOptions| {
        let report = run(&small(&[GOOD, case.clone()]), options);
        let counts = report.counts;
        (report.verdict, [counts.failed, counts.warned, counts.informed])
    };
    assert_eq!(of(&should, &options()), (VerdictKind::ConformantWithWarnings, [0, 1, 0]));
    assert_eq!(of(&should, &strict), (VerdictKind::NotConformant, [1, 0, 0]));
    assert_eq!(of(&may, &options()), (VerdictKind::Conformant, [0, 0, 1]));
    // One case leaves much of the module without execution.
    assert_eq!(of(&may, &strict), (VerdictKind::Partial, [0, 0, 1]));
}

#[test]
fn later_cases_run_unscored() {
    let later = Small { since: 2, ..BAD };
    let corpus = small(&[GOOD, later]);
    let report = run(&corpus, &options());
    assert_eq!(report.verdict, VerdictKind::Conformant, "{}", report.reason);
    assert_eq!((report.counts.required, report.counts.unscored), (1, 1));
    assert_eq!(report.cases[1].result, CaseResult::Unscored { passed: false });
    let newest = run(&corpus, &CertifyOptions { revision: None, ..options() });
    assert_eq!((newest.verdict, newest.profile.revision), (VerdictKind::NotConformant, 2));
}

#[test]
fn a_filter_makes_a_run_partial() {
    let corpus = small(&[GOOD, BAD]);
    let only = |pattern: &str| CertifyOptions { cases: vec![pattern.to_owned()], ..options() };
    let report = run(&corpus, &only("*.good"));
    assert_eq!(report.verdict, VerdictKind::Partial);
    assert_eq!(report.cases[1].result, CaseResult::Skipped { reason: "filtered".to_owned() });
    // Also one that takes all of them.
    assert_eq!(run(&small(&[GOOD]), &only("*")).verdict, VerdictKind::Partial);
    assert_eq!(run(&corpus, &only("*.bad")).verdict, VerdictKind::NotConformant);
    let nothing = judge(&plugin(), &corpus, &only("*.ugly")).unwrap_err();
    assert!(matches!(nothing, CertifyError::NothingSelected { .. }), "{nothing}");
}

#[test]
fn an_interrupted_run_is_partial() {
    let corpus = small(&[GOOD, Small::good("xon-xoff.c.good")]);
    let stopped = AtomicBool::new(true);
    let report = certify(&loaded(&plugin()), &corpus, &options(), &|_| {}, &stopped)
        .expect("it can be judged");
    assert_eq!(check(&report), Ok(()));
    assert_eq!((report.verdict, report.counts.executed), (VerdictKind::Partial, 0));
    assert!(report.selection.interrupted);

    let stop = AtomicBool::new(false);
    let after_one = |_| stop.store(true, Ordering::Relaxed);
    let report = certify(&loaded(&plugin()), &corpus, &options(), &after_one, &stop)
        .expect("it can be judged");
    assert_eq!(check(&report), Ok(()));
    assert_eq!((report.verdict, report.counts.executed), (VerdictKind::Partial, 1));
    assert_eq!(report.cases[1].result, CaseResult::Skipped { reason: "interrupted".to_owned() });

    // All cases have passed, but what those of every plug-in execute is not known yet.
    let mut one = small(&[GOOD]);
    let Corpus { ledgers, scripts, .. } = Corpus::embedded();
    one.ledgers.extend(ledgers.into_iter().filter(|ledger| ledger.profile == ABI));
    one.scripts.extend(scripts.into_iter().filter(|script| script.profile == ABI));
    let stop = AtomicBool::new(false);
    let at_the_end = |_| stop.store(true, Ordering::Relaxed);
    let report = certify(&loaded(&plugin()), &one, &options(), &at_the_end, &stop)
        .expect("it can be judged");
    assert_eq!(check(&report), Ok(()));
    assert_eq!((report.verdict, report.counts.passed), (VerdictKind::Partial, 1));
    assert!(report.reason.starts_with("it was ended before it was known"), "{}", report.reason);
}

#[test]
fn features_that_are_not_claimed_are_not_demanded() {
    let escaped = Small { clause: "xon-xoff.tx.escaped", ..BAD };
    let foreign = Small { clause: "xon-xoff.tx.foreign", ..Small::bad("xon-xoff.c.bad") };
    let report = run(&small(&[GOOD, foreign.clone()]), &options());
    assert_eq!((report.verdict, report.counts.unclaimed), (VerdictKind::Conformant, 1));
    let reason = "the feature \"unheard-of\" is not claimed".to_owned();
    assert_eq!(report.cases[1].result, CaseResult::Skipped { reason });
    // One that is claimed is.
    assert_eq!(run(&small(&[GOOD, escaped]), &options()).verdict, VerdictKind::NotConformant);
    // Nothing was demanded at all.
    let report = run(&small(&[foreign]), &options());
    assert_eq!((report.verdict, report.counts.required), (VerdictKind::Partial, 0));
}

#[test]
fn a_foreign_plug_in_is_judged_by_the_core() {
    let escaped = Small { clause: "xon-xoff.tx.escaped", ..BAD };
    let stranger = claiming(r#"{"name":"something-else"}"#);
    let report = judge(&stranger, &small(&[GOOD, escaped]), &options()).expect("it can be judged");
    assert_eq!(report.verdict, VerdictKind::Conformant);
    assert!(!report.profile.claimed && report.profile.features.is_empty());
    assert_eq!(report.counts.unclaimed, 1);
    // By a profile that it does not speak it fails; it lacks the settings too.
    let options =
        CertifyOptions { cases: vec!["rk512.line.*".to_owned()], ..CertifyOptions::new("rk512") };
    let report = judge(&stranger, &Corpus::embedded(), &options).expect("it can be judged");
    assert_eq!(report.verdict, VerdictKind::NotConformant);
    assert_eq!(
        report.cases.iter().flat_map(|case| &case.failures).next().unwrap().class,
        "not-applicable"
    );
}

#[test]
fn what_is_no_plug_in_is_not_judged() {
    let corpus = small(&[GOOD]);
    let whole = plugin();
    for (module, reason) in [
        (b"".to_vec(), "not a WebAssembly module"),
        (b"\0asm\x01\0\0\0".to_vec(), "no memory"),
        (whole[..whole.len() / 2].to_vec(), "ends in the middle"),
        (claiming(r#"{"name":"xon-xoff","features":["telepathy"]}"#), "\"telepathy\""),
    ] {
        let report = judge(&module, &corpus, &options()).expect("there is a report");
        assert_eq!(report.verdict, VerdictKind::NotJudged);
        assert!(report.reason.contains(reason), "{}", report.reason);
        assert_eq!(report.lint, std::slice::from_ref(&report.reason));
        assert_eq!((report.counts.required, report.counts.executed), (1, 0));
        assert!(!report.selection.interrupted);
    }
}

#[test]
fn a_setting_of_another_unit_is_another_setting() {
    let module = module("xon-xoff");
    let setting =
        br#""name":"held_timeout","type":"int","default":0,"min":0,"max":86400000,"unit":"ms""#;
    let at = module.windows(setting.len()).position(|window| window == setting);
    let unit = at.expect("the manifest has this setting") + setting.len() - 3;
    let seconds = patched(&module, unit, 3, "s\"");
    let report = judge(&seconds, &Corpus::embedded(), &options()).expect("there is a report");
    assert_eq!(report.verdict, VerdictKind::NotJudged);
    assert!(report.reason.contains("held_timeout"), "{}", report.reason);
}

#[test]
fn what_does_not_exist_is_an_error() {
    let corpus = small(&[GOOD]);
    let of = |options: &CertifyOptions| judge(&plugin(), &corpus, options).unwrap_err();
    let error = of(&CertifyOptions::new("xon-xof"));
    assert_eq!(error.to_string(), "there is no profile \"xon-xof\"; there are xon-xoff");
    for revision in [0, 3] {
        let error = of(&CertifyOptions { revision: Some(revision), ..options() });
        assert!(matches!(error, CertifyError::UnknownRevision { newest: 2, .. }), "{error}");
    }
    let stray = Small { clause: "xon-xoff.tx.stray", ..GOOD };
    let error = judge(&plugin(), &small(&[stray]), &options()).unwrap_err();
    assert!(matches!(error, CertifyError::UnknownClause { .. }), "{error}");
}

#[test]
fn threads_order_and_seed_change_nothing() {
    let corpus = Corpus::embedded();
    let base = CertifyOptions { cases: vec!["xon-xoff.rx.*".to_owned()], ..options() };
    let text = |options: &CertifyOptions| json::write(&run_real(&corpus, options));
    let expected = text(&base);
    let others = [
        CertifyOptions { threads: 2, ..base.clone() },
        CertifyOptions { threads: 64, shuffle: Some(7), ..base.clone() },
        CertifyOptions { shuffle: Some(8), cut_seed: 9, ..base.clone() },
    ];
    for options in others {
        assert!(text(&options) == expected, "{options:?} changes the report");
    }
}

fn loaded(module: &[u8]) -> Loaded<'_> {
    Loaded::new(module).expect("the engines work")
}

fn run_real(corpus: &Corpus, options: &CertifyOptions) -> softplug_report::Report {
    judge(&module("xon-xoff"), corpus, options).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn progress_is_told_after_each_case() {
    let told = Mutex::new(Vec::new());
    let tell = |progress: Progress| told.lock().expect("nobody panics").push(progress);
    let options = CertifyOptions { threads: 2, ..options() };
    let corpus = small(&[GOOD, BAD]);
    certify(&loaded(&plugin()), &corpus, &options, &tell, &AtomicBool::new(false))
        .expect("it can be judged");
    let mut told = told.into_inner().expect("nobody panics");
    told.sort_by_key(|progress| progress.done);
    let done: Vec<_> = told.iter().map(|progress| (progress.done, progress.cases)).collect();
    assert_eq!(done, [(1, 2), (2, 2)]);
    assert_eq!(told.iter().map(|progress| progress.failed).max(), Some(1));
}
