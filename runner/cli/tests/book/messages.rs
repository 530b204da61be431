//! Messages that the page on troubleshooting quotes stand in the source.

use std::fs;
use std::path::Path;

use crate::page::{Page, repository};

/// All that the programs can say: the texts in the source, with `…` for what they insert.
fn sayings() -> String {
    let mut all = String::new();
    for folder in ["sdk", "plugins", "conformance", "runner"] {
        gather(&repository().join(folder), &mut all);
    }
    all
}

fn gather(folder: &Path, all: &mut String) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() && !["tests", "target", "node_modules"].contains(&name.as_str()) {
            gather(&path, all);
        } else if Path::new(&name).extension().is_some_and(|end| end == "rs") {
            *all += &said(&fs::read_to_string(&path).unwrap());
        }
    }
}

/// Source without line breaks in texts, without escapes, with `…` for `{…}`.
fn said(source: &str) -> String {
    let mut joined = String::new();
    let mut lines = source.lines();
    while let Some(line) = lines.next() {
        joined += line;
        while joined.ends_with('\\') {
            joined.pop();
            joined += lines.next().unwrap_or_default().trim_start();
        }
        joined.push('\n');
    }
    let mut said = String::new();
    let mut rest = joined.as_str();
    while let Some((before, after)) = rest.split_once('{') {
        said += before;
        // A block of code goes over lines; what a text inserts does not.
        match after.split_once('}') {
            Some((inserted, after)) if !inserted.contains('\n') => {
                said.push('…');
                rest = after;
            }
            _ => {
                said.push('{');
                rest = after;
            }
        }
    }
    said += rest;
    said.replace("\\\"", "\"")
}

#[test]
fn quoted_messages_stand_in_the_source() {
    let page = Page::read("docs/troubleshooting.md");
    let sayings = sayings();
    let missing: Vec<String> = page
        .quotes
        .iter()
        .filter(|(_, quote)| !sayings.contains(quote.as_str()))
        .map(|(line, quote)| format!("{}:{line}: nothing says \"{quote}\"", page.path))
        .collect();
    assert!(missing.is_empty(), "{}", missing.join("\n"));
    assert!(page.quotes.len() > 20, "{} quotes", page.quotes.len());
}

#[test]
fn texts_are_found_in_source() {
    let source = "#[error(\"no {name}; \\\n    give \\\"{}\\\"\")]\nfn a() {\n    b(\"c\");\n}\n";
    assert!(said(source).contains("(\"no …; give \"…\"\")"), "{}", said(source));
    assert!(said(source).contains("fn a() {\n    b"), "{}", said(source));
}
