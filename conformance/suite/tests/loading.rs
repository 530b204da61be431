//! Traces are found, and what is wrong with them is said with its place.

use softplug_conformance::{LoadError, load};
use std::fs;
use std::path::Path;

const TRACE: &str = "\
id: a.first
title: Something
profile: a
clauses: a.x
level: must
line: 9600 8N1 depth=1 reaction=0
since: 1
origin: hand-written
---
. 1.000000
";

fn write(folder: &Path, name: &str, text: &str) {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().expect("it has a folder")).expect("it can be made");
    fs::write(path, text).expect("it can be written");
}

#[test]
fn folders_are_searched_and_the_result_is_sorted() {
    let folder = tempfile::tempdir().expect("there is room");
    write(folder.path(), "deep/a/a.second.spt", &TRACE.replace("a.first", "a.second"));
    write(folder.path(), "deep/a/a.first.spt", TRACE);
    write(folder.path(), "deep/a/notes.txt", "no trace");
    let cases = load([folder.path()]).expect("both can be read");
    let ids: Vec<&str> = cases.iter().map(|case| case.trace.front.id.as_str()).collect();
    assert_eq!(ids, ["a.first", "a.second"]);
    // The same file by two ways is one case.
    let file = folder.path().join("deep/a/a.first.spt");
    assert_eq!(load([folder.path(), &file]).expect("both can be read").len(), 2);
}

#[test]
fn faults_have_file_line_and_column() {
    let folder = tempfile::tempdir().expect("there is room");
    write(folder.path(), "a/a.first.spt", &TRACE.replace("clauses", "clasues"));
    let error = load([folder.path()]).expect_err("a key is misspelt");
    let path = folder.path().join("a/a.first.spt");
    assert_eq!(
        error.to_string(),
        format!("{}:4:1: unknown key \"clasues\"; did you mean \"clauses\"?", path.display())
    );
    assert!(error.report().contains("4 | clasues: a.x"), "{}", error.report());
}

#[test]
fn names_doubles_and_nothing_are_refused() {
    let folder = tempfile::tempdir().expect("there is room");
    assert!(matches!(load([folder.path()]), Err(LoadError::Nothing { .. })));
    assert!(matches!(load([folder.path().join("none.spt")]), Err(LoadError::Io { .. })));
    write(folder.path(), "one/a/a.first.spt", TRACE);
    write(folder.path(), "two/a/a.first.spt", TRACE);
    assert!(matches!(load([folder.path()]), Err(LoadError::Twice { .. })));
    write(folder.path(), "three/a/a.other.spt", TRACE);
    let third = folder.path().join("three");
    assert!(matches!(load([third]), Err(LoadError::Name(_))));
}
