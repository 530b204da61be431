//! JUnit, annotations and badge: right, and never green for what is not.

use crate::common::{HOSTILE, SAMPLES, hostile, sample};
use serde_json::Value;
use softplug_report::{annotations, badge, junit};

#[test]
fn junit_of_every_verdict() {
    for (name, _) in SAMPLES {
        insta::assert_snapshot!(format!("junit-{name}"), junit::write(&sample(name)));
    }
}

#[test]
fn annotations_of_every_verdict() {
    let all: String = SAMPLES
        .map(|(name, _)| format!("# {name}\n{}", annotations::write(&sample(name))))
        .concat();
    insta::assert_snapshot!(all);
}

#[test]
fn badges_of_every_verdict() {
    let all: String = SAMPLES.map(|(name, _)| badge::write(&sample(name))).concat();
    insta::assert_snapshot!(all);
}

/// `failures` and `errors` of the whole file, as a CI system reads them.
fn red(junit: &str) -> u32 {
    let root = junit.split("<testsuites").nth(1).unwrap().split('>').next().unwrap();
    let number = |name: &str| -> u32 {
        let from = root.split(&format!(" {name}=\"")).nth(1).unwrap();
        from.split('"').next().unwrap().parse().unwrap()
    };
    number("failures") + number("errors")
}

#[test]
fn nothing_but_a_conformant_run_is_green() {
    for (name, verdict) in SAMPLES {
        let report = sample(name);
        assert_eq!(red(&junit::write(&report)) == 0, verdict.is_conformant(), "{name}");
        let has_error = annotations::write(&report).contains("::error ");
        assert_eq!(has_error, !verdict.is_conformant(), "{name}");
        let badge: Value = serde_json::from_str(&badge::write(&report)).unwrap();
        let is_green = badge["color"].as_str().unwrap().contains("green");
        assert_eq!(is_green, verdict.is_conformant(), "{name}");
        assert_eq!(badge["isError"], !verdict.is_conformant(), "{name}");
    }
}

#[test]
fn hostile_texts_stay_texts() {
    let report = hostile();
    let junit = junit::write(&report);
    assert!(!junit.contains("<script"), "{junit}");
    assert!(junit.contains("&lt;script&gt;alert(1)"));
    assert!(junit.chars().all(|c| c == '\n' || !c.is_control() && c != '\u{202E}'));
    assert!(junit.contains("\\u{1B}[2J\\u{202E}"));
    let annotations = annotations::write(&report);
    let failed = report.cases.iter().filter(|case| !case.failures.is_empty()).count();
    assert_eq!(annotations.lines().count(), 1 + failed);
    assert!(annotations.lines().all(|line| line.starts_with("::")));
    assert!(annotations.chars().all(|c| c == '\n' || !c.is_control()));
    assert!(annotations.contains("%250A"), "a percent sign of the text is escaped itself");
    let badge: Value = serde_json::from_str(&badge::write(&report)).unwrap();
    assert!(!badge["label"].as_str().unwrap().contains(['\u{1B}', '\u{202E}', '\n']));
    assert!(HOSTILE.contains('\u{1B}'));
}

/// A file read by a parser that is not the writer's.
#[test]
fn junit_is_xml_with_the_counts_that_it_names() {
    let junit = junit::write(&sample("not-conformant"));
    let count = |text: &str| junit.matches(text).count();
    assert_eq!(count("<testcase "), 1 + 7);
    assert_eq!(count("<failure "), 1 + 3);
    assert_eq!(count("<skipped "), 2);
    assert_eq!(red(&junit), 4);
    assert!(!junit.contains(" time"), "a clock would make two runs differ");
}
