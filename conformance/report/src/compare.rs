//! Two reports on the same plug-in, held against each other.

use crate::{Report, text};
use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// A field in which two reports differ.
///
/// The example of [`compare()`](crate::compare()) shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Difference {
    /// The field: `verdict`, `cases "xon-xoff.tx.hold" result`, …
    pub field: String,
    /// One sentence: `it is …, and was …`.
    pub sentence: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.field, self.sentence)
    }
}

/// Whether fuel figures of the two reports mean the same: they hold for one engine and
/// version only.
///
/// ```
/// use softplug_report::{compare, fuel_is_comparable, json};
///
/// let text = std::fs::read_to_string("tests/reports/conformant.json")?;
/// let before = json::read(std::path::Path::new("conformance.json"), &text)?;
/// let mut now = before.clone();
/// now.fuel.units += 1;
/// assert_eq!(compare(&before, &now).len(), 1);
/// now.suite.engine = "wasmtime 99.0.0".to_owned();
/// assert!(!fuel_is_comparable(&before, &now));
/// assert_eq!(compare(&before, &now), []);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn fuel_is_comparable(before: &Report, now: &Report) -> bool {
    before.suite.engine == now.suite.engine
}

/// All in which a report differs from an earlier one; nothing: the earlier one is
/// reproduced.
///
/// Name and version of the suite and its engines say who judged, and are no part of
/// the judgement; fuel is compared if both name the same engine.
///
/// ```
/// use softplug_report::{compare, json};
///
/// let text = std::fs::read_to_string("tests/reports/conformant.json")?;
/// let before = json::read(std::path::Path::new("conformance.json"), &text)?;
/// let mut now = before.clone();
/// assert_eq!(compare(&before, &now), []);
/// now.digest = "0".repeat(64);
/// assert_eq!(compare(&before, &now)[0].field, "digest");
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn compare(before: &Report, now: &Report) -> Vec<Difference> {
    let with_fuel = fuel_is_comparable(before, now);
    let [before, now] = [before, now].map(|report| judgement(report, with_fuel));
    let mut differences = Vec::new();
    descend("", &before, &now, &mut differences);
    differences
}

/// The report without what may differ.
fn judgement(report: &Report, with_fuel: bool) -> Value {
    let mut report = report.clone();
    let suite = &mut report.suite;
    for who in [&mut suite.name, &mut suite.version, &mut suite.engine, &mut suite.second_engine] {
        who.clear();
    }
    if !with_fuel {
        report.fuel = crate::Fuel::default();
        report.cases.iter_mut().for_each(|case| case.fuel = 0);
    }
    serde_json::to_value(&report).expect("a report has only names as keys")
}

fn descend(field: &str, before: &Value, now: &Value, differences: &mut Vec<Difference>) {
    match (before, now) {
        _ if before == now => {}
        (Value::Object(before), Value::Object(now)) => {
            let names: BTreeSet<_> = before.keys().chain(now.keys()).collect();
            for name in names {
                let field = if field.is_empty() { name.clone() } else { format!("{field} {name}") };
                let of = |object: &serde_json::Map<String, Value>| object.get(name).cloned();
                let (before, now) = (of(before), of(now));
                descend(&field, &before.into(), &now.into(), differences);
            }
        }
        (Value::Array(old), Value::Array(new)) => {
            if let (Some(old), Some(new)) = (by_id(old), by_id(new)) {
                return rows(field, &old, &new, differences);
            }
            if old.len() == new.len() {
                for (number, (before, now)) in old.iter().zip(new).enumerate() {
                    descend(&format!("{field} {}", number + 1), before, now, differences);
                }
                return;
            }
            let sentence = format!("it has {} entries, and had {}", new.len(), old.len());
            differences.push(Difference::new(field, sentence));
        }
        _ => differences.push(difference(field, before, now)),
    }
}

type Rows<'a> = BTreeMap<&'a str, &'a Value>;

/// Clauses and cases, by their id.
fn by_id(rows: &[Value]) -> Option<Rows<'_>> {
    rows.iter().map(|row| Some((row.get("id")?.as_str()?, row))).collect()
}

fn rows(field: &str, before: &Rows, now: &Rows, differences: &mut Vec<Difference>) {
    let ids: BTreeSet<_> = before.keys().chain(now.keys()).collect();
    for id in ids {
        let field = format!("{field} {}", text::quoted(id));
        match (before.get(id), now.get(id)) {
            (Some(before), Some(now)) => descend(&field, before, now, differences),
            (Some(_), None) => {
                differences.push(Difference::new(&field, "it was there, and is gone"));
            }
            _ => differences.push(Difference::new(&field, "it is there, and was not")),
        }
    }
}

fn difference(field: &str, before: &Value, now: &Value) -> Difference {
    Difference::new(field, format!("it is {}, and was {}", shown(now), shown(before)))
}

/// A value in a sentence.
fn shown(value: &Value) -> String {
    match value {
        Value::Null => "not given".to_owned(),
        Value::String(text) => text::quoted(text),
        other => {
            let text = other.to_string();
            if text.chars().count() > 120 { text::quoted(&text) } else { text::line(&text) }
        }
    }
}

impl Difference {
    fn new(field: &str, sentence: impl Into<String>) -> Self {
        Self { field: field.to_owned(), sentence: sentence.into() }
    }
}
