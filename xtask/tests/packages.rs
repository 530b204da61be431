//! What would be published: every crate packs, and carries what its users need.

use std::process::Command;

use cargo_metadata::{MetadataCommand, Package};

fn published() -> Vec<Package> {
    let metadata = MetadataCommand::new().no_deps().exec().unwrap();
    metadata.packages.into_iter().filter(|package| package.publish.is_none()).collect()
}

fn cargo_package(more: &[&str]) -> String {
    let mut command = Command::new(env!("CARGO"));
    let folder = std::path::Path::new(env!("CARGO_TARGET_TMPDIR")).join("packages");
    command.args(["package", "--allow-dirty", "--offline", "--quiet", "--target-dir"]);
    let output = command.arg(folder).args(more).output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo package {more:?}: {said}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn every_crate_packs_with_the_others() {
    cargo_package(&["--workspace", "--exclude", "xtask", "--no-verify"]);
}

#[test]
fn every_package_has_its_licences_and_changes() {
    for package in published() {
        let list = cargo_package(&["--list", "-p", &package.name]);
        let files: Vec<&str> = list.lines().collect();
        for file in ["Cargo.toml", "LICENSE-APACHE", "LICENSE-MIT", "CHANGELOG.md"] {
            assert!(files.contains(&file), "{} lacks {file}", package.name);
        }
    }
}

#[test]
fn every_package_says_what_it_is() {
    for package in published() {
        let name = &package.name;
        assert!(package.description.is_some(), "{name} lacks a description");
        assert_eq!(package.license.as_deref(), Some("MIT OR Apache-2.0"), "{name}");
        assert!(package.repository.is_some(), "{name} lacks its repository");
        assert!(!package.keywords.is_empty(), "{name} lacks keywords");
        assert!(!package.categories.is_empty(), "{name} lacks categories");
    }
}
