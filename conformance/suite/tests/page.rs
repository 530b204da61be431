//! The protocol pages say what the manifests and the traces say.

use crate::common::{native, root};
use softplug_abi::manifest::Manifest;
use softplug_conformance::page::{presets_table, settings_table};
use softplug_conformance::script::{self, Script};
use softplug_conformance::{Case, Corpus, Subject, load};
use std::collections::BTreeSet;

/// A page of `docs/protocols`, the plug-ins whose tables stand in it, and the
/// profiles whose clauses it lists.
struct Page {
    file: &'static str,
    plugins: &'static [&'static str],
    profiles: &'static [&'static str],
}

#[test]
fn xon_xoff() {
    assert_sound(&Page { file: "xon-xoff.md", plugins: &["xon-xoff"], profiles: &["xon-xoff"] });
}

#[test]
fn r3964() {
    assert_sound(&Page {
        file: "3964r.md",
        plugins: &["r3964", "r3964-simplified"],
        profiles: &["r3964", "3964", "r3964-simplified", "rk512"],
    });
}

#[test]
fn fanuc_rs232() {
    assert_sound(&Page {
        file: "fanuc-rs232.md",
        plugins: &["fanuc-rs232"],
        profiles: &["fanuc-rs232"],
    });
}

#[test]
fn heidenhain_fe() {
    assert_sound(&Page {
        file: "heidenhain-fe.md",
        plugins: &["heidenhain-fe"],
        profiles: &["heidenhain-fe"],
    });
}

#[test]
fn pulse_lathe() {
    assert_sound(&Page {
        file: "pulse-lathe.md",
        plugins: &["pulse-lathe"],
        profiles: &["pulse-lathe"],
    });
}

#[test]
fn kermit() {
    assert_sound(&Page { file: "kermit.md", plugins: &["kermit"], profiles: &["kermit"] });
}

#[test]
fn xmodem() {
    assert_sound(&Page { file: "xmodem.md", plugins: &["xmodem"], profiles: &["xmodem"] });
}

fn assert_sound(page: &Page) {
    let path = root().join("docs/protocols").join(page.file);
    let text = std::fs::read_to_string(&path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    assert_tables(page, &text);
    let folders = page.profiles.iter().map(|profile| root().join("fixtures/traces").join(profile));
    let cases = load(folders).unwrap_or_else(|error| panic!("{}", error.report()));
    assert_clauses(page, &text, &cases);
    assert_examples(&text, &cases);
    assert_names(page, &text, &cases);
}

/// Tables are those of the manifests.
fn assert_tables(page: &Page, text: &str) {
    for plugin in page.plugins {
        let subject = native(plugin);
        let manifest = subject.manifest();
        assert_table(page, text, plugin, "settings", &settings_table(manifest));
        assert_table(page, text, plugin, "presets", &presets_table(manifest));
        assert_statuses(text, manifest);
    }
}

/// Where a page describes several plug-ins, the comments around a table name its own.
fn assert_table(page: &Page, text: &str, plugin: &str, what: &str, table: &str) {
    let name = match page.plugins {
        [_] => what.to_owned(),
        _ => format!("{what} {plugin}"),
    };
    let is_same = part(text, &name) == table.trim();
    let file = page.file;
    assert!(is_same, "put this between the comments \"{name}\" of {file}:\n\n{table}");
}

/// What stands between two comments of the page.
fn part(page: &str, name: &str) -> String {
    let begin = format!("<!-- {name} -->\n");
    let (_, rest) = page.split_once(&begin).unwrap_or_else(|| panic!("no {begin}"));
    let (part, _) = rest.split_once(&format!("<!-- /{name} -->")).expect("the part ends");
    part.trim().to_owned()
}

/// Every status code of the plug-in has a row, in decimal or as four hex digits,
/// whichever its manuals use.
fn assert_statuses(text: &str, manifest: &Manifest) {
    for status in &manifest.status {
        let code = status.code;
        let is_there = [format!("| `{code:04X}` |"), format!("| `{code}` |")]
            .iter()
            .any(|row| text.contains(row));
        assert!(is_there, "{}: no row for status {code:04X} ({code})", manifest.name);
    }
}

fn cited<'a>(page: &Page, cases: &'a [Case], scripts: &'a [Script]) -> BTreeSet<&'a str> {
    let of_page = scripts.iter().filter(|script| page.profiles.contains(&script.profile));
    let by_code = of_page.flat_map(|script| &script.clauses);
    let by_trace = cases.iter().flat_map(|case| &case.trace.front.clauses);
    by_trace.chain(by_code).map(String::as_str).collect()
}

/// The clauses are those that the cases cite, traces and scripts.
fn assert_clauses(page: &Page, text: &str, cases: &[Case]) {
    let scripts = script::all();
    let cited = cited(page, cases, &scripts);
    let is_clause = |name: &&str| {
        let profile = name.split_once('.').map(|(profile, _)| profile);
        profile.is_some_and(|profile| page.profiles.contains(&profile))
    };
    let listed: Vec<&str> = text
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split('`').next())
        .filter(is_clause)
        .collect();
    let set: BTreeSet<&str> = listed.iter().copied().collect();
    assert_eq!(set, cited, "{}", page.file);
    assert_eq!(set.len(), listed.len(), "{}: a clause is listed twice", page.file);
    assert_sentences(page, text, &set);
}

/// The ledgers have the same clauses, word for word.
fn assert_sentences(page: &Page, text: &str, listed: &BTreeSet<&str>) {
    let corpus = Corpus::embedded();
    let ledgers = page.profiles.iter().map(|profile| {
        corpus.ledger(profile).unwrap_or_else(|| panic!("there is no ledger for {profile}"))
    });
    let clauses: Vec<_> = ledgers.flat_map(|ledger| &ledger.clauses).collect();
    let named: BTreeSet<&str> = clauses.iter().map(|clause| clause.id.as_str()).collect();
    assert_eq!(&named, listed, "{}: ledger and page have different clauses", page.file);
    for clause in clauses {
        let row = format!("| `{}` | {} |\n", clause.id, clause.sentence);
        assert!(text.contains(&row), "{}: another sentence than the ledger's:\n{row}", page.file);
    }
}

/// Examples stand in the traces.
fn assert_examples(text: &str, cases: &[Case]) {
    let traces: Vec<String> = cases.iter().map(|case| case.trace.format()).collect();
    let mut examples = 0;
    for block in text.split("```spt\n").skip(1) {
        let (example, _) = block.split_once("```").expect("the block ends");
        assert!(traces.iter().any(|trace| trace.contains(example)), "in no trace:\n{example}");
        examples += 1;
    }
    assert!(examples >= 3);
}

/// Traces and clauses that the text names exist.
fn assert_names(page: &Page, text: &str, cases: &[Case]) {
    let scripts = script::all();
    let mut known = cited(page, cases, &scripts);
    known.extend(cases.iter().map(|case| case.trace.front.id.as_str()));
    let named = text.split('`').skip(1).step_by(2).filter(|word| {
        let mut parts = word.split('.');
        let begins = parts.next().is_some_and(|profile| page.profiles.contains(&profile));
        let is_plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || ".-".contains(c);
        begins && parts.count() >= 2 && word.chars().all(is_plain)
    });
    for name in named {
        assert!(known.contains(name), "{}: there is no {name}", page.file);
    }
}
