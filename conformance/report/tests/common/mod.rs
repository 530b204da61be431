//! The reports that the tests work with: one for each way a run can end.

use serde_json::Value;
use softplug_report::{Report, VerdictKind, check, json};
use std::path::{Path, PathBuf};

/// The samples with their verdicts.
pub(crate) const SAMPLES: [(&str, VerdictKind); 8] = [
    ("conformant", VerdictKind::Conformant),
    ("warnings", VerdictKind::ConformantWithWarnings),
    ("partial", VerdictKind::Partial),
    ("expected-failure", VerdictKind::Partial),
    ("not-conformant", VerdictKind::NotConformant),
    ("explored", VerdictKind::NotConformant),
    ("stale-baseline", VerdictKind::NotConformant),
    ("not-judged", VerdictKind::NotJudged),
];

/// The file of a sample.
pub(crate) fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("tests/reports/{name}.json"))
}

pub(crate) fn text(name: &str) -> String {
    std::fs::read_to_string(path(name)).unwrap()
}

pub(crate) fn sample(name: &str) -> Report {
    json::read(&path(name), &text(name)).unwrap()
}

/// What a plug-in may try with its texts.
pub(crate) const HOSTILE: &str = "</script><script>alert(1)</script><img src=x onerror=alert(2)>\"'&\u{0}\u{1B}[2J\u{202E}\r\n::error::x ]]> %0A";

/// A failed report in which every text that a plug-in or a corpus brings is hostile.
pub(crate) fn hostile() -> Report {
    let mut report = sample("not-conformant");
    let text = || HOSTILE.to_owned();
    report.suite.engine = text();
    // In front of an id it leaves the order as it is.
    let id = |id: &str| format!("{HOSTILE}{id}");
    report.fuel.largest_case = id(&report.fuel.largest_case);
    report.plugin.name = text();
    report.plugin.version = text();
    report.plugin.abi = text();
    report.profile.name = text();
    report.profile.features = vec![text()];
    for clause in &mut report.clauses {
        clause.sentence = text();
        clause.id = id(&clause.id);
        clause.feature = clause.feature.as_ref().map(|name| id(name));
    }
    for case in &mut report.cases {
        case.id = id(&case.id);
        case.title = text();
        case.clauses.iter_mut().for_each(|clause| *clause = id(clause));
        for run in &mut case.failures {
            run.run = format!("{}/uncut", case.id);
            for field in [
                &mut run.class,
                &mut run.message,
                &mut run.file,
                &mut run.expected,
                &mut run.observed,
                &mut run.again,
            ] {
                *field = text();
            }
            run.before = vec![text(), format!("> 0.000001 {HOSTILE}")];
        }
    }
    assert_eq!(check(&report), Ok(()), "it is a report like any other");
    report
}

/// JSON pointers to all that is no object and no list.
pub(crate) fn leaves(value: &Value) -> Vec<String> {
    let below = |name: &str, value: &Value| -> Vec<String> {
        leaves(value).into_iter().map(|pointer| format!("/{name}{pointer}")).collect()
    };
    match value {
        Value::Object(fields) => {
            fields.iter().flat_map(|(name, value)| below(name, value)).collect()
        }
        Value::Array(items) => {
            let numbered = items.iter().enumerate();
            numbered.flat_map(|(number, value)| below(&number.to_string(), value)).collect()
        }
        _ => vec![String::new()],
    }
}
