//! Modules that are no good plug-in, each judged by the suite: what cannot be judged is
//! not judged, what does wrong is not conformant, and none is taken for the other.

use softplug_conformance::Corpus;
use softplug_conformance::certify::{CertifyOptions, Loaded, certify};
use softplug_native::NativePlugin;
use softplug_report::{CaseResult, Report, VerdictKind};
use std::collections::BTreeSet;
use std::sync::LazyLock;
use std::sync::atomic::AtomicBool;

static CORPUS: LazyLock<Corpus> = LazyLock::new(Corpus::embedded);

/// Codes of events, as the ABI has them.
const SETTINGS: u32 = 1;
const RECEIVED: u32 = 4;

/// A module that keeps the lint's rules unless a part is replaced.
struct Control {
    manifest: Option<String>,
    memory: &'static str,
    extra: &'static str,
    /// Body of the function that tells where the mailbox is.
    mailbox: &'static str,
    /// Body of the step: the event's code, its length, the time.
    step: String,
}

impl Control {
    /// A converter that does nothing at all.
    fn new() -> Self {
        Self {
            manifest: Some(manifest()),
            memory: r#"(memory (export "memory") 1 1)"#,
            extra: "",
            mailbox: "(i32.const 16)",
            step: "(i32.const 0)".to_owned(),
        }
    }

    /// One that does this at one kind of event.
    fn at(event: u32, body: &str) -> Self {
        let is_it = format!("(i32.eq (local.get 0) (i32.const {event}))");
        let step = format!("(if {is_it} (then {body})) (i32.const 0)");
        Self { step, ..Self::new() }
    }

    /// One that does this at every event but the settings.
    fn after_settings(body: &str) -> Self {
        let is_it = format!("(i32.ne (local.get 0) (i32.const {SETTINGS}))");
        let step = format!("(if {is_it} (then {body})) (i32.const 0)");
        Self { step, ..Self::new() }
    }

    fn module(&self) -> Vec<u8> {
        let escaped = |text: &String| text.replace('\\', "\\\\").replace('"', "\\\"");
        let manifest = self.manifest.as_ref().map_or_else(String::new, |manifest| {
            format!("(@custom \"softplug.manifest\" \"{}\")", escaped(manifest))
        });
        let Self { memory, extra, mailbox, step, .. } = self;
        // Input at 0x1000, output at 0x2000, last words at 0x3000.
        let text = format!(
            r#"(module {manifest} {extra} {memory}
              (global (export "__heap_base") i32 (i32.const 65536))
              (data (i32.const 16) "\00\10\00\00\00\08\00\00\00\20\00\00\00\10\00\00\00\30\00\00\00\01\00\00")
              (func (export "softplug_v1") (result i32) {mailbox})
              (func (export "softplug_v1_step") (param i32 i32 i64) (result i32)
                (local $at i32) (local $random i32) {step}))"#
        );
        wat::parse_str(&text).unwrap_or_else(|error| panic!("{error}\n{text}"))
    }

    fn report(&self) -> Report {
        judged(&self.module())
    }
}

/// That of XON/XOFF, which claims its profile, without a state.
fn manifest() -> String {
    let plugin = NativePlugin::from_name("xon-xoff").expect("there is one");
    let state = r#","state":{"saves":1,"accepts":[1]}"#;
    let manifest = plugin.manifest().replace(state, "");
    assert_ne!(manifest, plugin.manifest(), "the state stands there in other words");
    manifest
}

fn judged(module: &[u8]) -> Report {
    let options = CertifyOptions::new("xon-xoff");
    let loaded = Loaded::new(module).unwrap_or_else(|error| panic!("{error}"));
    certify(&loaded, &CORPUS, &options, &|_| {}, &AtomicBool::new(false))
        .unwrap_or_else(|error| panic!("{error}"))
}

fn classes(report: &Report) -> BTreeSet<&str> {
    let failures = report.cases.iter().flat_map(|case| &case.failures);
    failures.map(|failure| failure.class.as_str()).collect()
}

fn passed(report: &Report) -> Vec<&str> {
    let passed = report.cases.iter().filter(|case| case.result == CaseResult::Passed);
    passed.map(|case| case.id.as_str()).collect()
}

/// Nothing of it was run, and the reason says why.
fn assert_not_judged(report: &Report, why: &str) {
    assert_eq!(report.verdict, VerdictKind::NotJudged, "{}", report.reason);
    assert_eq!((report.counts.executed, report.counts.passed, report.counts.runs), (0, 0, 0));
    let said = format!("{} {}", report.reason, report.lint.join(" "));
    assert!(said.contains(why), "{said}");
}

/// Cases were run, and all that failed did so in this way.
fn assert_not_conformant(report: &Report, class: &str) {
    assert_eq!(report.verdict, VerdictKind::NotConformant, "{}", report.reason);
    assert!(report.counts.executed > 50, "only {} executed", report.counts.executed);
    assert_eq!(classes(report), BTreeSet::from([class]));
}

/// Whether the case demands anything of a plug-in.
fn demands(id: &str) -> bool {
    let case = CORPUS.cases.iter().find(|case| case.trace.front.id == id);
    let text = case.expect("the report names cases of the corpus").trace.format();
    text.lines().any(|line| line.starts_with("> ") || line.starts_with("= "))
}

/// Whether the case gives the plug-in characters that it gets whole.
fn gives_bytes(id: &str) -> bool {
    let case = CORPUS.cases.iter().find(|case| case.trace.front.id == id);
    let text = case.expect("the report names cases of the corpus").trace.format();
    text.lines().any(|line| line.starts_with('<') && !line.contains('~'))
}

#[test]
fn what_is_no_module_is_not_judged() {
    assert_not_judged(&judged(b""), "not a WebAssembly module");
    assert_not_judged(&judged(b"#!/bin/sh\n"), "not a WebAssembly module");
    assert_not_judged(&judged(b"\0asm\x01\0\0\0"), "no memory");
}

#[test]
fn what_breaks_a_rule_of_the_lint_is_not_judged() {
    let no_manifest = Control { manifest: None, ..Control::new() };
    assert_not_judged(&no_manifest.report(), "manifest");
    let other = manifest().replace(r#""abi":"1.0""#, r#""abi":"2.0""#);
    let other_abi = Control { manifest: Some(other), ..Control::new() };
    assert_not_judged(&other_abi.report(), "2.0");
    let import = r#"(import "env" "clock" (func (result i64)))"#;
    let with_import = Control { extra: import, ..Control::new() };
    assert_not_judged(&with_import.report(), "env.clock");
    let large = Control { memory: r#"(memory (export "memory") 5 5)"#, ..Control::new() };
    assert_not_judged(&large.report(), "5 pages");
    let start = Control { extra: "(func $start) (start $start)", ..Control::new() };
    assert_not_judged(&start.report(), "start function");
}

#[test]
fn what_traps_before_the_first_case_is_not_judged() {
    let mailbox = Control { mailbox: "unreachable", ..Control::new() };
    assert_not_judged(&mailbox.report(), "unreachable");
    assert_not_judged(&Control::at(SETTINGS, "unreachable").report(), "unreachable");
    assert_not_judged(&Control::at(SETTINGS, "(loop (br 0))").report(), "budget");
}

#[test]
fn one_that_traps_at_the_first_byte_passes_no_case_with_bytes() {
    let report = Control::at(RECEIVED, "unreachable").report();
    assert_eq!(report.verdict, VerdictKind::NotConformant);
    assert!(classes(&report).contains("trapped"));
    let passed = passed(&report);
    let wrong: Vec<_> = passed.iter().filter(|id| gives_bytes(id)).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn a_trap_a_loop_and_a_refusal_satisfy_no_case_whatever_it_wants() {
    for (body, class) in [
        ("unreachable", "trapped"),
        ("(loop (br 0))", "budget-exhausted"),
        // The code for an event that is unknown.
        ("(return (i32.const -2))", "event-refused"),
    ] {
        let report = Control::after_settings(body).report();
        assert_not_conformant(&report, class);
        assert_eq!(passed(&report), Vec::<&str>::new(), "{class}");
    }
    let report = Control::at(SETTINGS, "(return (i32.const -3))").report();
    assert_ne!(report.verdict, VerdictKind::Conformant);
    assert_eq!(passed(&report), Vec::<&str>::new());
}

#[test]
fn an_endless_loop_at_the_first_byte_is_named_as_such() {
    let report = Control::at(RECEIVED, "(loop (br 0))").report();
    assert_eq!(report.verdict, VerdictKind::NotConformant);
    assert!(classes(&report).contains("budget-exhausted"));
    assert!(!classes(&report).contains("trapped"));
    assert!(passed(&report).iter().all(|id| !gives_bytes(id)));
}

#[test]
fn one_that_does_nothing_passes_only_cases_that_demand_nothing() {
    let report = Control::new().report();
    assert_eq!(report.verdict, VerdictKind::NotConformant);
    // One case asks for a swap, which this one has nothing for.
    assert_eq!(classes(&report), BTreeSet::from(["diverged", "swap-failed"]));
    let wrong: Vec<_> = passed(&report).into_iter().filter(|id| demands(id)).collect();
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn an_echo_does_wrong() {
    // Transmit: kind, length, mark 0, the bytes.
    let echo = "
        (i32.store16 (i32.const 0x2000) (i32.const 1))
        (i32.store16 (i32.const 0x2002) (i32.add (local.get 1) (i32.const 4)))
        (i32.store (i32.const 0x2004) (i32.const 0))
        (loop
          (i32.store8 offset=0x2008 (local.get $at) (i32.load8_u offset=0x1000 (local.get $at)))
          (br_if 0 (i32.lt_u
            (local.tee $at (i32.add (local.get $at) (i32.const 1))) (local.get 1))))
        (return (i32.add (local.get 1) (i32.const 8)))";
    let report = Control::at(RECEIVED, echo).report();
    assert_eq!(report.verdict, VerdictKind::NotConformant);
    assert!(classes(&report).contains("diverged"));
    assert!(passed(&report).into_iter().all(|id| !demands(id)));
}

#[test]
fn random_bytes_break_the_encoding() {
    let random = "
        (local.set $random (i32.add (local.get 1) (i32.const 12345)))
        (loop
          (local.set $random (i32.add
            (i32.mul (local.get $random) (i32.const 1664525)) (i32.const 1013904223)))
          (i32.store8 offset=0x2000 (local.get $at)
            (i32.shr_u (local.get $random) (i32.const 24)))
          (br_if 0 (i32.lt_u
            (local.tee $at (i32.add (local.get $at) (i32.const 1))) (i32.const 64))))
        (return (i32.const 64))";
    let report = Control::at(RECEIVED, random).report();
    assert_eq!(report.verdict, VerdictKind::NotConformant);
    assert!(classes(&report).contains("rule-broken"));
    assert!(passed(&report).into_iter().all(|id| !gives_bytes(id)));
    assert_not_judged(&Control::at(SETTINGS, random).report(), "");
}
