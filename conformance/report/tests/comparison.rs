//! Two reports, held against each other.

use crate::common::{SAMPLES, leaves, sample};
use serde_json::Value;
use softplug_report::{Report, compare, fuel_is_comparable};

fn sentences(before: &Report, now: &Report) -> Vec<String> {
    compare(before, now).iter().map(ToString::to_string).collect()
}

#[test]
fn a_report_is_reproduced_by_itself() {
    for (name, _) in SAMPLES {
        assert_eq!(sentences(&sample(name), &sample(name)), Vec::<String>::new(), "{name}");
    }
}

#[test]
fn differences_are_sentences() {
    let before = sample("conformant");
    let mut now = sample("warnings");
    now.cases.remove(5);
    now.plugin.version = "0.2.0\u{1B}".into();
    insta::assert_snapshot!(sentences(&before, &now).join("\n"));
}

#[test]
fn fuel_counts_on_one_engine_only_and_the_judge_does_not() {
    let before = sample("conformant");
    let mut now = before.clone();
    now.fuel.units += 10;
    now.cases[0].fuel += 10;
    assert_eq!(sentences(&before, &now).len(), 2);
    now.suite.engine = "wasmtime 49.0.0".into();
    now.suite.version = "0.2.0".into();
    assert!(!fuel_is_comparable(&before, &now));
    assert_eq!(sentences(&before, &now), Vec::<String>::new());
}

/// Whatever is not named as left out is compared.
#[test]
fn every_other_field_counts() {
    let report = sample("not-conformant");
    let value = serde_json::to_value(&report).unwrap();
    let pointers = leaves(&value);
    assert!(pointers.len() > 200, "{}", pointers.len());
    for pointer in pointers {
        let mut changed = value.clone();
        let leaf = changed.pointer_mut(&pointer).unwrap();
        *leaf = match &*leaf {
            Value::String(text) => Value::String(format!("{text}1")),
            Value::Number(number) => Value::from(number.as_i64().unwrap() + 1),
            Value::Bool(flag) => Value::Bool(!*flag),
            Value::Null => continue,
            other => panic!("{other} is no leaf"),
        };
        // A changed word of a fixed list is no report at all.
        let Ok(changed) = serde_json::from_value::<Report>(changed) else { continue };
        let is_judge = ["name", "version", "engine", "second_engine"]
            .iter()
            .any(|field| pointer == format!("/suite/{field}"));
        let count = compare(&report, &changed).len();
        let is_id = pointer.ends_with("/id");
        let is_fuel = pointer.contains("/fuel") && !fuel_is_comparable(&report, &changed);
        let expected = if is_judge || is_fuel { 0 } else { 1 + usize::from(is_id) };
        assert_eq!(count, expected, "{pointer}");
    }
}
