//! The protocol page says what the manifest and the traces say.

mod common;

use common::{native, root};
use softplug_conformance::page::{presets_table, settings_table};
use softplug_conformance::{Subject, load};
use std::collections::BTreeSet;

fn page() -> String {
    let path = root().join("docs/protocols/xon-xoff.md");
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// What stands between two comments of the page.
fn part(page: &str, name: &str) -> String {
    let (_, rest) = page.split_once(&format!("<!-- {name} -->\n")).expect("the part begins");
    let (part, _) = rest.split_once(&format!("<!-- /{name} -->")).expect("the part ends");
    part.trim().to_owned()
}

#[test]
fn tables_are_those_of_the_manifest() {
    let page = page();
    let subject = native("xon-xoff");
    let tables = [
        ("settings", settings_table(subject.manifest())),
        ("presets", presets_table(subject.manifest())),
    ];
    for (name, table) in tables {
        let is_same = part(&page, name) == table.trim();
        assert!(is_same, "put this between the comments \"{name}\" of the page:\n\n{table}");
    }
}

#[test]
fn clauses_are_those_that_the_traces_cite() {
    let cases = load([root().join("fixtures/traces/xon-xoff")]).expect("the traces are sound");
    let cited: BTreeSet<&str> =
        cases.iter().flat_map(|case| case.trace.front.clauses.iter().map(String::as_str)).collect();
    let page = page();
    let listed: BTreeSet<&str> = page
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split('`').next())
        .filter(|name| name.starts_with("xon-xoff."))
        .collect();
    assert_eq!(listed, cited);
}

#[test]
fn examples_stand_in_the_traces() {
    let cases = load([root().join("fixtures/traces/xon-xoff")]).expect("the traces are sound");
    let texts: Vec<String> = cases.iter().map(|case| case.trace.format()).collect();
    let page = page();
    let mut examples = 0;
    for block in page.split("```spt\n").skip(1) {
        let (example, _) = block.split_once("```").expect("the block ends");
        assert!(texts.iter().any(|text| text.contains(example)), "in no trace:\n{example}");
        examples += 1;
    }
    assert!(examples >= 3);
}
