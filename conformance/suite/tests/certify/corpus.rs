//! Corpora: the one that is compiled in is the one in the repository, and damage has a place.

use crate::common::root;
use crate::common::small::{Small, files, plain_ledger, write};
use softplug_conformance::{Corpus, CorpusError};
use std::path::Path;

const GOOD: Small = Small::good("xon-xoff.a.good");

#[test]
fn what_is_compiled_in_stands_in_the_repository() {
    let embedded = Corpus::embedded();
    let read = Corpus::read(&root().join("fixtures")).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(embedded.digest, read.digest);
    assert_eq!(embedded.ledgers, read.ledgers);
    assert!(embedded.list().len() >= 600);
    assert!(embedded.cases.iter().all(|case| case.path.starts_with("traces")));
    assert!(!embedded.kills.is_empty());
}

#[test]
fn the_digest_holds_names_and_contents() {
    let digest = |spoil: fn(&Path)| {
        let folder = files(&[GOOD]);
        spoil(folder.path());
        Corpus::read(folder.path()).expect("it is whole").digest
    };
    let base = digest(|_| {});
    assert_eq!(base, digest(|_| {}));
    assert_ne!(base, digest(|folder| write(folder, "traces/xon-xoff/note.txt", "")));
    assert_ne!(
        digest(|folder| write(folder, "traces/a.txt", "b")),
        digest(|folder| write(folder, "traces/b.txt", "a"))
    );
    assert_eq!(base, digest(|folder| write(folder, "elsewhere/note.txt", "")));
}

#[test]
fn damage_is_said_with_its_place() {
    let fault = |name: &str, text: &[u8]| {
        let folder = files(&[GOOD]);
        write(folder.path(), name, text);
        let error = Corpus::read(folder.path()).expect_err("it is damaged").to_string();
        error.replace(&folder.path().display().to_string(), "F")
    };
    let ledger = plain_ledger();
    let trace = GOOD.text();
    for (name, text, expected) in [
        (
            "traces/xon-xoff/xon-xoff.a.good.spt",
            trace.replace("clauses", "clasues").into_bytes(),
            "F/traces/xon-xoff/xon-xoff.a.good.spt:4:1: unknown key",
        ),
        (
            "traces/xon-xoff/xon-xoff.a.other.spt",
            trace.clone().into_bytes(),
            "F/traces/xon-xoff/xon-xoff.a.other.spt holds the case",
        ),
        (
            "traces/deep/xon-xoff/xon-xoff.a.good.spt",
            trace.clone().into_bytes(),
            "F/traces/deep/xon-xoff/xon-xoff.a.good.spt and F/traces/xon-xoff/xon-xoff.a.good.spt both",
        ),
        (
            "traces/xon-xoff/xon-xoff.a.good.spt",
            b"id: x\n\xFF\n".to_vec(),
            "F/traces/xon-xoff/xon-xoff.a.good.spt:2:1: this is not UTF-8",
        ),
        (
            "requirements/xon-xoff.toml",
            ledger.replace("level = \"must\"", "level = \"mus\"").into_bytes(),
            "F/requirements/xon-xoff.toml:15:9: unknown variant `mus`",
        ),
        (
            "requirements/other.toml",
            ledger.clone().into_bytes(),
            "F/requirements/other.toml holds the profile \"xon-xoff\"",
        ),
        ("mutants/matrix.toml", b"[[kill]\n".to_vec(), "F/mutants/matrix.toml:1:8"),
    ] {
        let fault = fault(name, &text);
        assert!(fault.starts_with(expected), "{fault}");
    }
}

#[test]
fn what_is_not_there_is_said() {
    let none = Corpus::read(Path::new("/nowhere"));
    assert!(matches!(none, Err(CorpusError::Io { .. })), "{none:?}");
    let empty = tempfile::tempdir().expect("there is room");
    assert!(matches!(Corpus::read(empty.path()), Err(CorpusError::Empty { .. })));
}

#[test]
fn files_that_traces_name_are_part_of_a_corpus() {
    use sha2::{Digest as _, Sha256};
    let digest =
        Sha256::digest(b"AB").iter().fold(String::new(), |text, byte| format!("{text}{byte:02x}"));
    let text = GOOD.text().replace("send 1 \"A\"", &format!("send 1 file:{digest}"));
    let text =
        text.replace("\"A\"", "\"AB\"").replace("0.001042 done 1 sent=1", "0.002084 done 1 sent=2");
    let folder = files(&[GOOD]);
    write(folder.path(), "traces/xon-xoff/xon-xoff.a.good.spt", text);
    let verdict = || {
        let corpus = Corpus::read(folder.path()).unwrap_or_else(|error| panic!("{error}"));
        crate::common::small::run(&corpus, &crate::common::small::options())
    };
    let class = verdict().cases[0].failures[0].class.clone();
    assert_eq!(class, "not-applicable");
    write(folder.path(), &format!("traces/files/{digest}"), "AC");
    assert_eq!(verdict().cases[0].failures[0].class, "not-applicable", "it has another content");
    write(folder.path(), &format!("traces/files/{digest}"), "AB");
    assert!(verdict().cases[0].failures.is_empty());
}
