//! `conformance.json`: written, read back, and refused where it is damaged or
//! contradicts itself.

use crate::common;
use crate::common::{SAMPLES, sample, text};
use serde_json::{Value, json};
use softplug_report::json::{self as report_json, ReadError};
use softplug_report::{Report, VerdictKind, check};
use std::path::Path;

fn read(text: &str) -> Result<Report, ReadError> {
    report_json::read(Path::new("conformance.json"), text)
}

/// The error of a sample that was changed at one place.
fn changed(name: &str, pointer: &str, value: Value) -> String {
    let mut report: Value = serde_json::from_str(&text(name)).unwrap();
    *report.pointer_mut(pointer).unwrap_or_else(|| panic!("no {pointer}")) = value;
    read(&report.to_string()).unwrap_err().to_string()
}

#[test]
fn what_is_written_is_read_and_written_the_same() {
    for (name, verdict) in SAMPLES {
        let report = sample(name);
        assert_eq!(report.verdict, verdict, "{name}");
        assert_eq!(report_json::write(&report), text(name), "{name}");
    }
}

#[test]
fn hostile_texts_are_kept_as_they_are() {
    let report = common::hostile();
    let text = report_json::write(&report);
    assert_eq!(read(&text), Ok(report));
}

#[test]
fn a_file_of_another_shape_is_refused_with_its_place() {
    let good = text("conformant");
    let unknown = good.replacen("\"suite\": {", "\"suite\": {\n    \"host\\u001b\": 1,", 1);
    let error = read(&unknown).unwrap_err().to_string();
    assert!(error.starts_with("conformance.json:4:"), "{error}");
    assert!(error.contains("unknown field `host\\u{1B}`"), "{error}");

    let cut = &good[..good.len() / 2];
    assert!(matches!(read(cut), Err(ReadError::Malformed { line: 90.., .. })), "{:?}", read(cut));
    let twice = good.replacen("\"schema\": 1,", "\"schema\": 1,\n  \"schema\": 1,", 1);
    assert!(read(&twice).unwrap_err().to_string().contains("duplicate field `schema`"));
    let more = format!("{good}{{}}");
    assert!(read(&more).unwrap_err().to_string().contains("trailing characters"));
    let deep = "[".repeat(100_000);
    assert!(matches!(read(&deep), Err(ReadError::Malformed { line: 1, .. })));
    assert!(matches!(read(""), Err(ReadError::Malformed { .. })));
    let large = " ".repeat(report_json::LARGEST + 1);
    assert_eq!(
        read(&large).unwrap_err().to_string(),
        "conformance.json: a report has at most 64 MiB"
    );
}

#[test]
fn a_report_of_another_schema_is_named_as_that() {
    let newer = text("conformant").replacen("\"schema\": 1,", "\"schema\": 2,", 1).replacen(
        "\"lint\": [],",
        "\"lint\": {},",
        1,
    );
    let error = read(&newer).unwrap_err();
    assert!(matches!(error, ReadError::OtherSchema { schema: 2, .. }), "{error}");
    let same_shape = text("conformant").replacen("\"schema\": 1,", "\"schema\": 2,", 1);
    assert!(read(&same_shape).unwrap_err().to_string().contains("schema: is 2"));
}

#[test]
fn a_verdict_better_than_its_rows_is_refused() {
    let wishes =
        ["conformant", "conformant-with-warnings", "partial", "not-conformant", "not-judged"];
    for (name, verdict) in SAMPLES {
        for wish in wishes {
            let mut report: Value = serde_json::from_str(&text(name)).unwrap();
            if report["verdict"] == wish {
                continue;
            }
            report["verdict"] = json!(wish);
            // A stale baseline cannot be seen in the rows; it never makes a report better.
            let result = read(&report.to_string());
            let is_worse = wish == "not-conformant" && !report["selection"]["baseline"].is_null();
            assert_eq!(result.is_ok(), is_worse, "{name} is {verdict:?}, not {wish}: {result:?}");
            if let Err(error) = result {
                let error = error.to_string();
                assert!(error.contains("verdict: is ") || error.contains("reason: "), "{error}");
            }
        }
    }
}

#[test]
fn every_count_follows_from_the_rows() {
    for name in SAMPLES.map(|(name, _)| name) {
        let report: Value = serde_json::from_str(&text(name)).unwrap();
        for (field, number) in report["counts"].as_object().unwrap() {
            let error =
                changed(name, &format!("/counts/{field}"), json!(number.as_u64().unwrap() + 1));
            assert!(error.contains(&format!("counts.{field}: is ")), "{error}");
        }
        for field in ["cited", "executed", "failed"] {
            let error = changed(name, &format!("/clauses/4/{field}"), json!(99));
            assert!(error.contains("clauses[4] (\"xon-xoff.tx.obey-xoff\"): says "), "{error}");
        }
    }
}

#[test]
fn rows_that_contradict_themselves_are_refused() {
    let not = "not-conformant";
    let skipped = json!({"skipped": {"reason": "filtered"}});
    let cases = [
        ("conformant", "/cases/0/result", json!("failed"), "lists 0 failed runs"),
        ("conformant", "/cases/0/result", skipped.clone(), "has 9 runs"),
        ("conformant", "/cases/0/runs", json!(0), "has 0 runs"),
        ("conformant", "/cases/3/result", json!("passed"), "feature that is not claimed"),
        ("conformant", "/cases/6/result", json!("passed"), "is newer than the revision"),
        ("conformant", "/cases/0/since", json!(2), "is newer than the revision"),
        ("conformant", "/cases/0/result", json!({"unscored": {"passed": true}}), "is not newer"),
        ("conformant", "/cases/0/clauses/0", json!("xon-xoff.x"), "which is not listed"),
        ("conformant", "/cases/1/clauses/1", json!("xon-xoff.tx.obey-xoff"), "twice"),
        ("conformant", "/cases/0/id", json!("zz"), "they are sorted"),
        ("conformant", "/clauses/0/id", json!("zz"), "they are sorted"),
        ("conformant", "/cases/1/id", json!("xon-xoff.line.end-mark"), "none is there twice"),
        ("conformant", "/profile/features", json!(["b", "a"]), "they are sorted"),
        ("explored", "/verdict", json!("conformant"), "the rows give not conformant"),
        ("explored", "/explored/configurations/1/digest", json!("0"), "32 digits"),
        ("explored", "/explored/configurations", json!([]), "no configuration"),
        ("explored", "/explored/configurations/1/found", json!(null), "the rows give conformant"),
        ("explored", "/counts/executed", json!(4), "counts.executed"),
        (not, "/cases/5/result", json!("passed"), "lists 3 failed runs"),
        (not, "/cases/5/more_failures", json!(14), "lists 3 failed runs and 14 more of 16"),
        (not, "/cases/2/more_failures", json!(1), "lists 1 failed runs and 1 more of 11"),
        (not, "/cases/5/failures/0/run", json!("xon-xoff.tx.hold"), "is not one of its own"),
        (not, "/cases/5/failures/0/run", json!("xon-xoff.tx.hold/"), "is not one of its own"),
        (not, "/cases/5/failures/0/run", json!("xon-xoff.tx.holds/uncut"), "not one of its own"),
        (not, "/cases/5/failures/0/line", json!(0), "lines count from 1"),
        (not, "/cases/5/failures/0/expected_bytes", json!("4"), "no hex digits"),
        (not, "/cases/5/failures/0/observed_bytes", json!("00".repeat(4097)), "or too many"),
        ("not-judged", "/cases/0/fuel", json!(1), "without being executed"),
        ("conformant", "/lint", json!(["x"]), "verdict: is conformant, although the module"),
        ("conformant", "/fuel/units", json!(1), "fuel.units"),
        ("conformant", "/fuel/tenths_per_byte", json!(1), "fuel.tenths_per_byte"),
        ("conformant", "/fuel/largest_event", json!(1_000_000_000), "fuel.largest_event"),
        ("conformant", "/fuel/largest_case", json!("x"), "fuel.largest_case"),
        ("conformant", "/digest", json!("x"), "digest: is no SHA-256"),
        ("conformant", "/plugin/sha256", json!("A".repeat(64)), "plugin.sha256: is no SHA-256"),
        ("conformant", "/suite/corpus", json!(""), "suite.corpus: is no SHA-256"),
        ("stale-baseline", "/selection/baseline", json!("0"), "selection.baseline: is no"),
        ("stale-baseline", "/selection/baseline", json!(null), "is not conformant, but the rows"),
        ("stale-baseline", "/reason", json!(" "), "gives no reason"),
        ("not-judged", "/reason", json!(""), "gives no reason"),
        ("conformant", "/reason", json!("all is well"), "reason: does not follow"),
        (
            "conformant",
            "/selection/cases",
            json!(["*"]),
            "is conformant, but the rows give partial",
        ),
        ("conformant", "/selection/interrupted", json!(true), "the rows give partial"),
        ("warnings", "/selection/strict", json!(true), "counts.failed: is 0, but the rows give 1"),
    ];
    for (name, pointer, value, expected) in cases {
        let error = changed(name, pointer, value);
        assert!(error.starts_with("conformance.json: the report contradicts itself: "), "{error}");
        assert!(error.contains(expected), "{pointer}: {error}");
    }
}

#[test]
fn a_trap_decides_at_every_level() {
    for level in ["should", "may"] {
        let mut report: Value = serde_json::from_str(&text("warnings")).unwrap();
        report["cases"][4]["level"] = json!(level);
        report["cases"][4]["failures"][0]["class"] = json!("trapped");
        let error = read(&report.to_string()).unwrap_err().to_string();
        assert!(error.contains("counts.failed: is 0, but the rows give 1"), "{error}");
    }
}

#[test]
fn a_baseline_that_only_excuses_is_never_green() {
    let report = sample("expected-failure");
    assert_eq!(report.verdict, VerdictKind::Partial);
    assert_eq!(report.counts.executed, report.counts.required);
    assert_eq!(check(&report), Ok(()));
}
