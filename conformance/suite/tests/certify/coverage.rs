//! What no run has executed is told.

use crate::common::small::{Small, options, plugin, run, small};
use softplug_conformance::certify::CertifyOptions;
use softplug_report::{VerdictKind, check};

const GOOD: Small = Small::good("xon-xoff.a.good");

#[test]
fn what_nothing_executes_is_named_in_the_report() {
    let report = run(&small(&[GOOD]), &options());
    let coverage = report.coverage.as_ref().expect("it is conformant");
    let functions = coverage.functions;
    assert!(0 < functions.executed && functions.executed < functions.of, "{functions:?}");
    assert!(0 < coverage.branches.executed && coverage.branches.executed < coverage.branches.of);
    // One byte that is sent is no reason to receive any.
    let never = |name: &str| {
        let of = |place: &&softplug_report::Place| place.name.as_deref() == Some(name);
        coverage.places.iter().find(of).map(|place| place.what.as_str())
    };
    assert_eq!(never("end"), Some("the function is never called"));
    let expected = format!(
        "all 1 required cases passed; {} places of the module never executed",
        coverage.places.len()
    );
    assert_eq!((report.verdict, &report.reason), (VerdictKind::Conformant, &expected));
    check(&report).unwrap();
}

#[test]
fn a_strict_run_wants_everything_to_be_executed() {
    let report = run(&small(&[GOOD]), &CertifyOptions { strict: true, ..options() });
    assert_eq!(report.verdict, VerdictKind::Partial);
    assert!(report.reason.ends_with("places of the module never executed"), "{}", report.reason);
    check(&report).unwrap();
}

#[test]
fn more_cases_execute_more_and_threads_change_nothing() {
    let of = |cases: &[Small], threads| {
        let options = CertifyOptions { threads, ..options() };
        run(&small(cases), &options).coverage.expect("it is conformant")
    };
    let escaped = Small { id: "xon-xoff.b.escaped", clause: "xon-xoff.tx.escaped", ..GOOD };
    let (few, more) = (of(&[GOOD], 1), of(&[GOOD, escaped], 1));
    assert!(few.branches.executed <= more.branches.executed);
    assert_eq!(of(&[GOOD], 4), few);
}

#[test]
fn a_plug_in_that_fails_has_no_coverage() {
    let report = run(&small(&[GOOD, Small::bad("xon-xoff.b.bad")]), &options());
    assert_eq!(report.coverage, None);
    assert!(!plugin().is_empty());
}
