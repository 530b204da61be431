//! What we build on is what `deny.toml` allows: licences, sources, one version of each.
//!
//! `cargo deny` checks the same, and advisories. It takes minutes to build, and its database has to be
//! fetched: it is run where it is installed, and this in every run.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use cargo_metadata::{Metadata, MetadataCommand, Package};
use toml::Table;

fn rules() -> Table {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../deny.toml");
    std::fs::read_to_string(file).unwrap().parse().unwrap()
}

fn texts(rules: &Table, table: &str, key: &str) -> BTreeSet<String> {
    let list = rules[table][key].as_array().unwrap();
    list.iter()
        .map(|entry| entry.get("crate").unwrap_or(entry).as_str().unwrap().to_owned())
        .collect()
}

fn metadata() -> Metadata {
    MetadataCommand::new().other_options(["--locked".to_owned()]).exec().unwrap()
}

fn strangers(metadata: &Metadata) -> impl Iterator<Item = &Package> {
    metadata.packages.iter().filter(|package| package.source.is_some())
}

/// Whether an SPDX expression, or the slash of older crates, can be met with these licences.
fn is_met(expression: &str, allowed: &BTreeSet<String>) -> bool {
    let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
    let mut words = spaced.split_whitespace().collect::<Vec<_>>().into_iter().peekable();
    let met = either(&mut words, allowed);
    assert!(words.next().is_none(), "this licence cannot be read: {expression}");
    met
}

type Words<'a> = std::iter::Peekable<std::vec::IntoIter<&'a str>>;

fn either(words: &mut Words<'_>, allowed: &BTreeSet<String>) -> bool {
    let mut met = both(words, allowed);
    while words.next_if_eq(&"OR").is_some() {
        met |= both(words, allowed);
    }
    met
}

fn both(words: &mut Words<'_>, allowed: &BTreeSet<String>) -> bool {
    let mut met = one(words, allowed);
    while words.next_if_eq(&"AND").is_some() {
        met &= one(words, allowed);
    }
    met
}

fn one(words: &mut Words<'_>, allowed: &BTreeSet<String>) -> bool {
    let word = words.next().expect("a licence follows");
    if word == "(" {
        let met = either(words, allowed);
        assert_eq!(words.next(), Some(")"), "a bracket is closed");
        return met;
    }
    let mut licence = word.to_owned();
    if words.next_if_eq(&"WITH").is_some() {
        licence = format!("{licence} WITH {}", words.next().expect("an exception follows"));
    }
    allowed.contains(&licence)
}

#[test]
fn every_licence_is_allowed() {
    let allowed = texts(&rules(), "licenses", "allow");
    let metadata = metadata();
    let is_wrong = |package: &&Package| {
        !package.license.as_deref().is_some_and(|licence| is_met(licence, &allowed))
    };
    let wrong: Vec<_> = strangers(&metadata)
        .filter(is_wrong)
        .map(|package| format!("{} {}: {:?}", package.name, package.version, package.license))
        .collect();
    assert_eq!(wrong, Vec::<String>::new(), "not allowed by deny.toml");
    // The allowance for a notice within its own files is for this one.
    let mpl: Vec<_> = strangers(&metadata)
        .filter(|package| package.license.as_deref() == Some("MPL-2.0"))
        .map(|package| package.name.as_str())
        .collect();
    assert_eq!(mpl, ["serialport"]);
}

#[test]
fn every_crate_is_from_where_it_may_be() {
    let allowed = texts(&rules(), "sources", "allow-registry");
    let metadata = metadata();
    let is_wrong = |package: &&Package| {
        let source = package.source.as_ref().map(ToString::to_string).unwrap_or_default();
        !source.strip_prefix("registry+").is_some_and(|registry| allowed.contains(registry))
    };
    let wrong: Vec<_> = strangers(&metadata)
        .filter(is_wrong)
        .map(|package| format!("{} from {:?}", package.name, package.source))
        .collect();
    assert_eq!(wrong, Vec::<String>::new());
}

#[test]
fn a_crate_is_there_in_one_version_or_is_listed() {
    let listed = texts(&rules(), "bans", "skip");
    let metadata = metadata();
    let mut versions: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    for package in strangers(&metadata) {
        versions.entry(&package.name).or_default().insert(package.version.to_string());
    }
    let wrong: Vec<_> = versions
        .iter()
        .filter(|(name, versions)| versions.len() > 1 && !listed.contains(**name))
        .collect();
    assert!(wrong.is_empty(), "in several versions, and not listed in deny.toml: {wrong:?}");
}

#[test]
fn expressions_are_read_as_spdx_has_them() {
    let allowed = BTreeSet::from(["MIT".to_owned(), "Apache-2.0 WITH LLVM-exception".to_owned()]);
    for met in ["MIT", "GPL-3.0-only OR MIT", "GPL-3.0/MIT", "(MIT OR X) AND MIT", "X AND Y OR MIT"]
    {
        assert!(is_met(met, &allowed), "{met}");
    }
    for refused in [
        "GPL-3.0-only",
        "MIT AND X",
        "Apache-2.0",
        "(MIT OR X) AND Y",
        "X OR MIT AND Y",
        "MIT WITH X",
    ] {
        assert!(!is_met(refused, &allowed), "{refused}");
    }
    assert!(is_met("Apache-2.0 WITH LLVM-exception", &allowed));
}
