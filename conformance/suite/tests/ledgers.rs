//! The ledgers fit the cases, and lint finds each way in which they could not.

use crate::common;
use crate::common::small::{Small, files, ledger, plain_ledger, write};
use softplug_conformance::Corpus;
use softplug_conformance::ledger::{Ledger, LedgerError, fingerprint};
use softplug_conformance::lint::{Finding, lint};
use std::collections::BTreeSet;
use std::path::Path;

#[test]
fn the_corpus_is_without_findings() {
    let corpus = Corpus::embedded();
    let findings = lint(&corpus.ledgers, &corpus);
    let lines: Vec<_> = findings.iter().map(ToString::to_string).collect();
    assert!(lines.is_empty(), "{}", lines.join("\n"));
    let clauses: usize = corpus.ledgers.iter().map(|ledger| ledger.clauses.len()).sum();
    assert!(clauses >= 200, "only {clauses} clauses");
}

#[test]
fn every_feature_is_claimed_by_a_reference_plug_in() {
    let corpus = Corpus::embedded();
    let claimed: BTreeSet<(String, String)> = softplug_native::NativePlugin::ALL
        .iter()
        .flat_map(|plugin| {
            let subject = common::native(plugin.name());
            softplug_conformance::Subject::manifest(&subject).profiles.clone()
        })
        .flat_map(|profile| {
            let name = profile.name;
            profile.features.into_iter().map(move |feature| (name.clone(), feature))
        })
        .collect();
    let listed: BTreeSet<(String, String)> = corpus
        .ledgers
        .iter()
        .flat_map(|ledger| {
            let feature = |feature: &softplug_conformance::ledger::Feature| {
                (ledger.profile.clone(), feature.name.clone())
            };
            ledger.features.iter().map(feature)
        })
        .collect();
    assert_eq!(claimed, listed);
}

/// The small corpus' own ledger says too much for one case.
const LEDGER: [(&str, &str, &str); 1] = [("xon-xoff.tx.at-once", "must", "")];
const GOOD: Small = Small::good("xon-xoff.a.good");

fn findings(ledger: &str, cases: &[Small]) -> Vec<Finding> {
    lints(ledger, &cases.iter().map(|case| (case.id, case.text())).collect::<Vec<_>>())
}

fn lints(ledger: &str, cases: &[(&str, String)]) -> Vec<Finding> {
    let folder = files(&[]);
    write(folder.path(), "requirements/xon-xoff.toml", ledger);
    for (id, text) in cases {
        let profile = id.split('.').next().expect("an id has a profile");
        write(folder.path(), &format!("traces/{profile}/{id}.spt"), text);
    }
    let corpus = Corpus::read(folder.path()).unwrap_or_else(|error| panic!("{error}"));
    lint(&corpus.ledgers, &corpus)
}

#[test]
fn what_fits_has_no_findings() {
    assert_eq!(findings(&ledger(1, &LEDGER), &[GOOD]), []);
}

#[test]
fn each_finding_is_found() {
    let plain = ledger(1, &LEDGER);
    let case = || GOOD.id.to_owned();
    let clause = || "xon-xoff.tx.at-once".to_owned();
    let feature = |name: &str| ledger(1, &[("xon-xoff.tx.at-once", "must", name)]);

    let foreign = ("r3964.a.good", GOOD.text().replace("xon-xoff", "r3964"));
    let found = lints(&plain, &[(GOOD.id, GOOD.text()), foreign]);
    let profile = "r3964".to_owned();
    assert_eq!(found, [Finding::UnknownProfile { case: "r3964.a.good".to_owned(), profile }]);

    let unknown = Small { clause: "xon-xoff.tx.at-onec", ..Small::good("xon-xoff.b.good") };
    let found = findings(&plain, &[GOOD, unknown]);
    let (b, onec) = ("xon-xoff.b.good".to_owned(), "xon-xoff.tx.at-onec".to_owned());
    assert_eq!(found, [Finding::UnknownClause { case: b.clone(), clause: onec.clone() }]);

    let block = "{ alt xon-xoff.tx.at-onec\n> 0.000000 \"A\"\n|\n}\n= 0.001042";
    let choice = GOOD.text().replace("> 0.000000 \"A\"\n= 0.001042", block);
    let found = lints(&plain, &[(GOOD.id, choice)]);
    assert_eq!(found, [Finding::UnknownClause { case: case(), clause: onec }]);

    let excluded = format!("{plain}excluded = \"Nobody can see it.\"\n");
    let found = findings(&excluded, &[GOOD]);
    assert_eq!(found, [Finding::ExcludedClause { case: case(), clause: clause() }]);

    let found = findings(&plain.replace("\"must\"", "\"may\""), &[GOOD]);
    let level = softplug_report::Level::Must;
    assert_eq!(found, [Finding::TooStrong { case: case(), level }]);

    let found = findings(&plain, &[GOOD, Small { since: 2, ..Small::good("xon-xoff.b.good") }]);
    assert_eq!(found, [Finding::WrongSince { case: b, since: 2, low: 1, high: 1 }]);
    let newer = ledger(2, &LEDGER).replace("since = 1", "since = 2");
    let found = findings(&newer, &[GOOD]);
    assert_eq!(found, [Finding::WrongSince { case: case(), since: 1, low: 2, high: 2 }]);

    let set = GOOD.text().replace("since: 1", "config: speak=off preset=parity\nsince: 1");
    let found = lints(&plain, &[(GOOD.id, set.clone())]);
    assert_eq!(found, [Finding::UnknownSetting { case: case(), setting: "speak".to_owned() }]);
    let speak = "\n[[setting]]\nname = \"speak\"\ntype = \"bool\"\n";
    assert_eq!(lints(&format!("{plain}{speak}"), &[(GOOD.id, set)]), []);
    let found = findings(&format!("{plain}{speak}"), &[GOOD]);
    let profile = || "xon-xoff".to_owned();
    assert_eq!(found, [Finding::IdleSetting { profile: profile(), setting: "speak".to_owned() }]);

    let found = findings(&plain.replace("Words.", "Other words."), &[GOOD]);
    let expected = fingerprint("Other words.");
    assert_eq!(found, [Finding::ChangedSentence { clause: clause(), expected }]);

    let silent = ledger(1, &[LEDGER[0], ("xon-xoff.tx.silent", "must", "")]);
    let found = findings(&silent, &[GOOD]);
    assert_eq!(found, [Finding::WithoutCase { clause: "xon-xoff.tx.silent".to_owned() }]);
    // A weaker case does not show it; a reason does.
    let weak = Small { level: "should", ..GOOD };
    assert_eq!(findings(&plain, &[weak]), [Finding::WithoutCase { clause: clause() }]);
    assert_eq!(findings(&format!("{silent}excluded = \"Nobody can.\"\n"), &[GOOD]), []);

    let unlisted = format!("{plain}feature = \"new\"\n");
    let found = findings(&unlisted, &[GOOD]);
    let name = || "new".to_owned();
    assert_eq!(found, [Finding::UnknownFeature { clause: clause(), feature: name() }]);
    let idle = feature("new").replace("\nfeature = \"new\"", "");
    let found = findings(&idle, &[GOOD]);
    assert_eq!(found, [Finding::IdleFeature { profile: profile(), feature: name() }]);
}

#[test]
fn a_case_that_stands_twice_is_found() {
    let folder = files(&[GOOD]);
    let mut corpus = Corpus::read(folder.path()).expect("it is whole");
    corpus.cases.push(corpus.cases[0].clone());
    corpus.cases[1].trace.front.clauses.clear();
    let found = lint(&corpus.ledgers, &corpus);
    let case = GOOD.id.to_owned();
    assert!(found.contains(&Finding::SameCase { case: case.clone() }));
    assert!(found.contains(&Finding::NoClause { case }));
}

#[test]
fn a_damaged_ledger_is_an_error_with_its_place() {
    let plain = ledger(1, &LEDGER);
    let fault = |from: &str, to: &str| -> LedgerError {
        let text = plain.replace(from, to);
        Ledger::parse(Path::new("x.toml"), &text).expect_err("it is damaged")
    };
    for (from, to, place) in [
        (
            "profile = \"xon-xoff\"",
            "profile = \"Xon\"",
            "x.toml:1:11: \"Xon\" is no name of a profile",
        ),
        ("revision = 1", "revision = 0", "x.toml:2:12: revisions count from 1"),
        ("revision = 1", "revision = \"1\"", "x.toml:2:12: invalid type"),
        ("title", "tilte", "x.toml:3:1: unknown field"),
        ("[[clause]]", "[[clause]", "x.toml:5:10: "),
        (
            "xon-xoff.tx.at-once",
            "r3964.tx.at-once",
            "x.toml:5:1: the clause \"r3964.tx.at-once\" must",
        ),
        ("since = 1", "since = 2", "x.toml:5:1: xon-xoff.tx.at-once: since must be 1 to 1"),
        ("Words.", " ", "x.toml:5:1: xon-xoff.tx.at-once: the sentence is empty"),
        (
            "since = 1",
            "since = 1\nexcluded = \"\"",
            "x.toml:5:1: xon-xoff.tx.at-once: excluded needs",
        ),
        ("\"must\"", "\"can\"", "x.toml:7:9: unknown variant"),
    ] {
        let fault = fault(from, to).to_string();
        assert!(fault.starts_with(place), "{fault}");
    }
    let twice = ledger(1, &[LEDGER[0], LEDGER[0]]);
    let fault = Ledger::parse(Path::new("x.toml"), &twice).expect_err("it is damaged").to_string();
    assert!(
        fault.starts_with("x.toml:12:1: the clause \"xon-xoff.tx.at-once\" stands here twice"),
        "{fault}"
    );
    let long = format!("#{}", "x".repeat(5 << 20));
    let fault = Ledger::parse(Path::new("x.toml"), &long).expect_err("it is too long").to_string();
    assert!(fault.starts_with("x.toml:1:1: the file has more than"), "{fault}");
    // Nothing of a file steers a terminal.
    let fault = Ledger::parse(Path::new("x.toml"), "\"a\\u001Bb\" = 1").expect_err("no such key");
    assert!(!fault.message.contains('\u{1B}'), "{fault:?}");
    assert!(Ledger::parse(Path::new("x.toml"), &plain_ledger()).is_ok());
}
