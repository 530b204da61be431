//! The contents of the book: every page once, and every page tested.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use crate::page::{Page, repository};

fn pages_of(folder: &Path, below: &str, pages: &mut BTreeSet<String>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = format!("{below}{}", path.file_name().unwrap().to_str().unwrap());
        if path.is_dir() {
            pages_of(&path, &format!("{name}/"), pages);
        } else if Path::new(&name).extension().is_some_and(|end| end == "md")
            && name != "SUMMARY.md"
        {
            pages.insert(name);
        }
    }
}

#[test]
fn every_page_is_in_the_contents_once_and_is_executed() {
    let mut pages = BTreeSet::new();
    pages_of(&repository().join("docs"), "", &mut pages);
    let summary = Page::read("docs/SUMMARY.md");
    let listed: BTreeSet<String> = summary.links.iter().map(|link| link.target.clone()).collect();
    assert_eq!(listed, pages, "docs/SUMMARY.md");
    assert_eq!(listed.len(), summary.links.len(), "docs/SUMMARY.md lists a page twice");
    let tested: BTreeSet<String> = crate::pages().into_iter().map(str::to_owned).collect();
    assert_eq!(tested, pages, "each page needs its line in runner/cli/tests/book/main.rs");
}

/// A file that moves is named anew in the pages that lead to it.
#[test]
fn pages_for_contributors_name_files_that_are_there() {
    const TOP: [&str; 7] =
        ["conformance/", "docs/", "fixtures/", "plugins/", "runner/", "sdk/", "xtask/"];
    let mut missing = Vec::new();
    let mut named = 0;
    for page in ["docs/architecture.md", "docs/glossary.md", "CONTRIBUTING.md"] {
        let text = fs::read_to_string(repository().join(page)).unwrap();
        // Fences have three of these signs, so what is between two stays so behind them.
        let words = text.split('`').skip(1).step_by(2);
        let is_path = |word: &&str| TOP.iter().any(|top| word.starts_with(top));
        let is_pattern =
            |word: &str| word.contains(['*', ' ']) || word.contains(|c: char| c.is_uppercase());
        for path in words.filter(is_path).filter(|word| !is_pattern(word)) {
            named += 1;
            if !repository().join(path).exists() {
                missing.push(format!("{page}: {path}"));
            }
        }
    }
    assert!(named > 100, "{named} paths are found");
    assert_eq!(missing, Vec::<String>::new());
}

/// What the tests leave out, with the reason: a new one shows in the snapshot.
#[test]
fn what_cannot_run_is_named() {
    let mut left_out = String::new();
    for path in crate::pages() {
        for block in Page::read(&format!("docs/{path}")).blocks {
            let Some(reason) = block.lacks() else { continue };
            let first = block.text.lines().next().unwrap_or_default();
            writeln!(left_out, "{path}: {reason}: {first}").unwrap();
        }
    }
    let mut settings = insta::Settings::clone_current();
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.bind(|| insta::assert_snapshot!("left-out", left_out));
}
