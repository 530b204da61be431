//! The published schema: every report fits it, damaged ones do not, and every
//! property is described.

use crate::common::{SAMPLES, hostile, leaves, text};
use jsonschema::Validator;
use serde_json::{Value, json};

const SCHEMA: &str = include_str!("../../../docs/report/conformance-1.schema.json");

fn schema() -> Value {
    serde_json::from_str(SCHEMA).unwrap()
}

fn validator() -> Validator {
    jsonschema::draft202012::new(&schema()).unwrap()
}

fn report(name: &str) -> Value {
    serde_json::from_str(&text(name)).unwrap()
}

#[test]
fn it_is_a_schema_of_2020_12() {
    assert!(jsonschema::draft202012::meta::is_valid(&schema()));
    assert_eq!(schema()["$schema"], "https://json-schema.org/draft/2020-12/schema");
}

#[test]
fn reports_of_every_verdict_fit() {
    let validator = validator();
    let all = SAMPLES.map(|(name, _)| (name, report(name)));
    for (name, report) in all.into_iter().chain([("hostile", json!(hostile()))]) {
        let errors: Vec<_> = validator.iter_errors(&report).map(|e| e.to_string()).collect();
        assert_eq!(errors, Vec::<String>::new(), "{name}");
    }
}

#[test]
fn a_report_without_or_with_a_further_property_does_not_fit() {
    /// Reports of earlier suites have no random sessions.
    const MAY_BE_MISSING: [&str; 3] = ["sessions", "sessions_needed", "seed"];
    let validator = validator();
    let good = report("not-conformant");
    for pointer in objects("", &good) {
        let fields: Vec<String> =
            good.pointer(&pointer).unwrap().as_object().unwrap().keys().cloned().collect();
        for field in fields {
            let mut damaged = good.clone();
            damaged.pointer_mut(&pointer).unwrap().as_object_mut().unwrap().remove(&field);
            let may_be_missing =
                pointer == "/selection" && MAY_BE_MISSING.contains(&field.as_str());
            assert_eq!(validator.is_valid(&damaged), may_be_missing, "{pointer} without {field}");
        }
        let mut damaged = good.clone();
        damaged.pointer_mut(&pointer).unwrap()["host"] = json!("x");
        assert!(!validator.is_valid(&damaged), "{pointer} with more");
    }
}

#[test]
fn a_value_of_another_type_does_not_fit() {
    let validator = validator();
    for name in ["not-conformant", "expected-failure", "not-judged"] {
        let good = report(name);
        for pointer in leaves(&good) {
            let mut damaged = good.clone();
            *damaged.pointer_mut(&pointer).unwrap() = json!([0.5]);
            assert!(!validator.is_valid(&damaged), "{name}: {pointer}");
        }
    }
}

#[test]
fn values_out_of_range_do_not_fit() {
    let validator = validator();
    let cases = [
        ("/schema", json!(2)),
        ("/verdict", json!("green")),
        ("/digest", json!("A".repeat(64))),
        ("/plugin/sha256", json!("a".repeat(63))),
        ("/counts/required", json!(-1)),
        ("/counts/required", json!(1_u64 << 32)),
        ("/cases/0/level", json!("MUST")),
        ("/cases/0/result", json!("skipped")),
        ("/cases/0/result", json!({"skipped": {}})),
        ("/cases/5/failures/0/line", json!(0)),
        ("/cases/5/failures/0/expected_bytes", json!("4")),
    ];
    for (pointer, value) in cases {
        let mut damaged = report("not-conformant");
        *damaged.pointer_mut(pointer).unwrap() = value;
        assert!(!validator.is_valid(&damaged), "{pointer}");
    }
}

#[test]
fn every_property_is_described() {
    let mut count = 0;
    described("", &schema(), &mut count);
    assert!(count > 70, "{count} properties");
}

fn described(place: &str, value: &Value, count: &mut u32) {
    let Some(fields) = value.as_object() else { return };
    for (name, value) in fields.get("properties").and_then(Value::as_object).into_iter().flatten() {
        let text = value["description"].as_str().unwrap_or_default();
        assert!(text.len() > 5 && text.ends_with(['.', '…']), "{place}/{name}: {text:?}");
        *count += 1;
    }
    for (name, value) in fields {
        let place = format!("{place}/{name}");
        described(&place, value, count);
        value.as_array().into_iter().flatten().for_each(|item| described(&place, item, count));
    }
}

/// JSON pointers to all objects.
fn objects(pointer: &str, value: &Value) -> Vec<String> {
    let (mut found, below): (Vec<String>, Vec<(String, &Value)>) = match value {
        Value::Object(fields) => {
            let below = fields.iter().map(|(name, value)| (name.clone(), value));
            (vec![pointer.to_owned()], below.collect())
        }
        Value::Array(items) => {
            let below = items.iter().enumerate().map(|(number, item)| (number.to_string(), item));
            (Vec::new(), below.collect())
        }
        _ => return Vec::new(),
    };
    for (name, value) in below {
        found.extend(objects(&format!("{pointer}/{name}"), value));
    }
    found
}
