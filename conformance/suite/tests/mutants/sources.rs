//! The plug-ins' code and the catalogues name the same mutants.

use crate::catalogues;
use crate::common::root;
use softplug_conformance::mutants::{PatchError, wake};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

#[test]
fn code_and_catalogues_name_the_same_mutants() {
    let mut sources = String::new();
    read(&root().join("plugins"), &mut sources);
    let in_code: BTreeSet<&str> = names(&sources).collect();
    let catalogues = catalogues();
    let listed = catalogues.iter().flat_map(|catalogue| &catalogue.mutants);
    let listed: BTreeSet<&str> = listed.map(|mutant| mutant.id.as_str()).collect();
    let unlisted: Vec<_> = in_code.difference(&listed).collect();
    assert!(unlisted.is_empty(), "in no catalogue of fixtures/mutants: {unlisted:?}");
    let missing: Vec<_> = listed.difference(&in_code).collect();
    assert!(missing.is_empty(), "no code under plugins asks for: {missing:?}");
}

#[test]
fn names_are_found_over_any_line_break() {
    let code =
        "if mutant!(\"a.b/c\") || softplug_plugin::mutant!(\n    \"d.e/f\"\n) { mutant!(name) }";
    assert_eq!(names(code).collect::<Vec<_>>(), ["a.b/c", "d.e/f"]);
}

#[test]
fn a_real_module_holds_no_mutants() {
    for plugin in ["fanuc-rs232", "heidenhain-fe", "r3964", "r3964-simplified", "xon-xoff"] {
        // The module that the others of these tests judge.
        let module = crate::common::module(plugin);
        assert_eq!(wake(&module, "a.b/c"), Err(PatchError::NoMarker), "{plugin}");
    }
}

/// The text of all files with code in and below a folder.
fn read(folder: &Path, text: &mut String) {
    for entry in fs::read_dir(folder).expect("the plug-ins' folder can be read") {
        let path = entry.expect("its entries can be read").path();
        if path.is_dir() {
            read(&path, text);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            text.push_str(&fs::read_to_string(&path).expect("code is text"));
        }
    }
}

/// What stands between the quotes behind `mutant!(`.
fn names(code: &str) -> impl Iterator<Item = &str> {
    code.split("mutant!(").skip(1).filter_map(|rest| {
        let (name, _) = rest.trim_start().strip_prefix('"')?.split_once('"')?;
        Some(name)
    })
}
