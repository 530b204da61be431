//! Every rule of the ABI has a test of its name: each test that docs/abi.md names exists.

use std::fs;
use std::path::{Path, PathBuf};

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// A test file with the files of the folder beside it that has its name.
fn sources(file: &Path) -> String {
    let mut text = read(file);
    let Ok(folder) = fs::read_dir(file.with_extension("")) else { return text };
    for entry in folder {
        text += &read(&entry.expect("the folder can be listed").path());
    }
    text
}

/// What stands between back quotes after `label`.
fn quoted<'a>(text: &'a str, label: &str) -> Option<&'a str> {
    text.split_once(label)?.1.split_once('`').map(|(name, _)| name)
}

#[test]
fn every_rule_has_its_test() {
    let page = read(&root().join("docs/abi.md"));
    let listed = read(&root().join("fixtures/abi/rules.txt"));
    let rules: Vec<(&str, &str)> = listed
        .lines()
        .filter(|line| !line.starts_with('#'))
        .map(|line| line.split_once('\t').expect("a line is an id, a tab and a sentence"))
        .collect();
    assert_eq!(rules.len(), 55);
    let mut missing = Vec::new();
    for (id, sentence) in rules {
        let Some((_, entry)) = page.split_once(&format!("**`{id}`** {sentence}")) else {
            missing.push(format!("{id}: the page does not say the same"));
            continue;
        };
        let test = quoted(entry, "Test: `").expect("a test is named after each rule");
        let (file, name) = test.split_once("::").expect("a test is named by file and function");
        let expected = id.trim_start_matches("abi.").replace(['.', '-'], "_");
        if name != expected {
            missing.push(format!("{id}: its test is called {name}"));
        }
        let file = root().join(file);
        if !file.exists() || !sources(&file).contains(&format!("fn {name}(")) {
            missing.push(format!("{id}: there is no test {test}"));
        }
    }
    assert_eq!(missing, Vec::<String>::new());
}
