//! Whatever stands in a report, reading and writing it never breaks off.

use crate::common::{HOSTILE, SAMPLES, leaves, text};
use serde_json::{Value, json};
use softplug_report::{
    Report, annotations, badge, check, compare, explain, html, json as report_json, junit,
};
use std::collections::BTreeSet;
use std::path::Path;

/// Every form of it; they are made of reports that were never checked, too.
fn write_all(report: &Report, other: &Report) {
    let forms = [
        report_json::write(report),
        junit::write(report),
        html::write(report),
        annotations::write(report),
        badge::write(report),
    ];
    assert!(forms.iter().all(|form| form.ends_with('\n')));
    for case in &report.cases {
        assert!(!explain(report, case).is_empty());
    }
    compare(other, report);
}

#[test]
fn every_leaf_may_hold_the_worst_of_its_type() {
    let worst = [
        json!(HOSTILE),
        json!(""),
        json!("\u{1F600}".repeat(5000)),
        json!(0),
        json!(u32::MAX),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(true),
        json!(null),
    ];
    let (mut tried, mut taken) = (0, 0);
    let mut fields = BTreeSet::new();
    for name in ["not-conformant", "expected-failure"] {
        let good: Value = serde_json::from_str(&text(name)).unwrap();
        let other: Report = serde_json::from_value(good.clone()).unwrap();
        for pointer in leaves(&good) {
            // The same field of another row is read and written by the same code.
            if !fields.insert(pointer.replace(|c: char| c.is_ascii_digit(), "")) {
                continue;
            }
            for value in &worst {
                let mut changed = good.clone();
                *changed.pointer_mut(&pointer).unwrap() = value.clone();
                let read = report_json::read(Path::new("a.json"), &changed.to_string());
                let Ok(report) = serde_json::from_value::<Report>(changed) else {
                    assert!(read.is_err(), "{pointer}");
                    continue;
                };
                tried += 1;
                taken += u32::from(read.is_ok());
                assert_eq!(read.is_ok(), check(&report).is_ok(), "{pointer}");
                write_all(&report, &other);
            }
        }
    }
    assert!(tried > 150 && taken > 60, "{tried} reports, {taken} of them sound");
}

#[test]
fn lists_may_be_empty() {
    for (name, _) in SAMPLES {
        let mut report: Report = serde_json::from_str(&text(name)).unwrap();
        let other = report.clone();
        report.cases.iter_mut().for_each(|case| case.failures.clear());
        write_all(&report, &other);
        report.cases.iter_mut().for_each(|case| case.clauses.clear());
        write_all(&report, &other);
        report.clauses.clear();
        write_all(&report, &other);
        report.cases.clear();
        write_all(&report, &other);
    }
}

#[test]
fn a_file_cut_anywhere_is_refused() {
    let whole = text("warnings");
    for end in (0..whole.trim_end().len()).step_by(7).filter(|end| whole.is_char_boundary(*end)) {
        report_json::read(Path::new("a.json"), &whole[..end]).unwrap_err();
    }
}
