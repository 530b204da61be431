//! What a project's folder gives to the verbs that judge by a corpus, and what they write there.

use crate::bench::{Bench, Ran};
use crate::kit::{edit, in_folder, project};

const NAME: &str = "own-corpus";
const LEDGER: &str = "own-corpus/requirements/own-corpus.toml";

fn run(bench: &Bench, words: &[&str]) -> Ran {
    in_folder(bench, NAME, words)
}

/// The first clause of the ledger.
fn clause(bench: &Bench) -> String {
    let ledger = String::from_utf8(bench.read(LEDGER)).unwrap();
    let clause = ledger.split("[[clause]]").nth(1).unwrap();
    clause.split("id = \"").nth(1).unwrap().split('"').next().unwrap().to_owned()
}

#[test]
fn hashes_are_written_and_nothing_else() {
    let bench = project(NAME, "c");
    let clause = clause(&bench);
    let right = bench.read(LEDGER);
    assert!(run(&bench, &["cases", "--lint", "--fix"]).with_code(0).out.starts_with("sound"));
    assert_eq!(bench.read(LEDGER), right, "nothing was to be mended");

    edit(&bench, LEDGER, "sentence = \"", "sentence = \"Always: ");
    let lint = run(&bench, &["cases", "--lint"]).with_code(1);
    assert!(lint.out.contains(&format!("{clause}: the sentence was changed")), "{lint}");
    let changed = String::from_utf8(bench.read(LEDGER)).unwrap();
    let fixed = run(&bench, &["cases", "--lint", "--fix", "--json"]).with_code(0).json();
    assert_eq!(fixed["fixed"], serde_json::json!([clause]));
    let ledger = String::from_utf8(bench.read(LEDGER)).unwrap();
    let differing = ledger.lines().zip(changed.lines()).filter(|(new, old)| new != old);
    let differing: Vec<_> = differing.map(|(new, _)| new).collect();
    assert!(matches!(&differing[..], [line] if line.starts_with("sha256 = ")), "{differing:?}");

    // A new clause has no hash yet.
    let line = ledger.lines().find(|line| line.starts_with("sha256 = ")).unwrap().to_owned();
    edit(&bench, LEDGER, &format!("{line}\n"), "");
    let lint = run(&bench, &["cases", "--lint"]).with_code(1);
    assert!(
        lint.out.contains(&format!("{clause}: its sentence has no hash; write {line}")),
        "{lint}"
    );
    run(&bench, &["cases", "--lint", "--fix"]).with_code(0);
}

#[test]
fn the_ledgers_in_the_command_are_not_written() {
    let ran = Bench::new().run(&["cases", "--lint", "--fix"]).with_code(2);
    assert!(ran.err.contains("cannot be changed") && ran.err.contains("--corpus DIR"), "{ran}");
}

/// A trace that is a link to a file counts like any other; a link to a folder is refused, and not passed over.
#[cfg(unix)]
#[test]
fn no_trace_is_passed_over_for_being_a_link() {
    use std::os::unix::fs::symlink;
    let bench = project(NAME, "c");
    let cases = |code| {
        let ran = run(&bench, &["cases", "--profile", NAME, "--json"]).with_code(code);
        if code == 0 { ran.json()["cases"].as_array().unwrap().len() } else { 0 }
    };
    let all = cases(0);
    let folder = bench.path(&format!("{NAME}/traces/{NAME}"));
    let trace = std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path());
    let trace = trace.filter(|path| path.extension().is_some_and(|is| is == "spt")).min().unwrap();
    let elsewhere = bench.path("elsewhere.spt");
    std::fs::rename(&trace, &elsewhere).unwrap();
    assert_eq!(cases(0), all - 1);
    symlink(&elsewhere, &trace).unwrap();
    assert_eq!(cases(0), all);
    symlink("..", folder.join("round")).unwrap();
    cases(2);
}

#[test]
fn the_corpus_of_the_folder_is_found_for_what_only_it_has() {
    let bench = project(NAME, "c");
    let clause = clause(&bench);
    let explained = run(&bench, &["cases", "--profile", NAME, "--json"]).with_code(0).json();
    let case = explained["cases"][0]["id"].as_str().unwrap().to_owned();
    let explained = run(&bench, &["explain", &case]).with_code(0);
    assert!(explained.out.contains(NAME), "{explained}");
    assert!(explained.err.contains("the corpus is this folder"), "{explained}");
    run(&bench, &["build"]).with_code(0);
    let found = run(&bench, &["certify", NAME, "--profile", NAME, "--json"]).with_code(0).json();
    let words = ["certify", NAME, "--profile", NAME, "--corpus", ".", "--json"];
    assert_eq!(found["digest"], run(&bench, &words).with_code(0).json()["digest"]);
    // What the command has is judged by what the command has.
    let abi = run(&bench, &["certify", NAME, "--profile", "abi"]).with_code(0);
    assert!(!abi.err.contains("the corpus is this folder"), "{abi}");

    // A new case stands in its place, and is one once something is given there.
    let id = format!("{NAME}.tx.fresh");
    let words =
        ["trace", "new", &id, "--clause", &clause, "--like", &case, "--title", "A fresh one"];
    let made = run(&bench, &words).with_code(0);
    let file = made.out.trim_end().to_owned();
    assert!(file.ends_with(&format!("traces/{NAME}/{id}.spt")), "{made}");
    run(&bench, &["trace", "fmt", "--check", "traces"]).with_code(0);
    run(&bench, &["replay", NAME, &file, "--bless"]).with_code(0);
    run(&bench, &["replay", NAME, &file]).with_code(0);
    run(&bench, &["cases", "--lint"]).with_code(0);
    let again = run(&bench, &words).with_code(2);
    assert!(again.err.contains("there is a case"), "{again}");
}

#[test]
fn the_first_case_of_a_project_is_begun_where_there_is_none_yet() {
    let bench = project(NAME, "c");
    let clause = clause(&bench);
    std::fs::remove_dir_all(bench.path(&format!("{NAME}/traces"))).unwrap();
    let lint = run(&bench, &["cases", "--lint"]).with_code(1);
    assert!(
        lint.out.contains(&format!("{clause}: it is a must, and no case of level must cites it")),
        "{lint}"
    );
    edit(&bench, LEDGER, "sentence = \"", "sentence = \"Always: ");
    run(&bench, &["cases", "--lint", "--fix"]).with_code(1);
    let made = run(&bench, &["trace", "new", &clause]).with_code(0);
    let file = made.out.trim_end().to_owned();
    assert!(file.ends_with(&format!("traces/{NAME}/{clause}.spt")), "{made}");
    run(&bench, &["trace", "fmt", "--check", "traces"]).with_code(0);
    let nothing = run(&bench, &["certify", NAME, "--profile", "own-corpu"]).with_code(2);
    assert!(nothing.err.contains("own-corpus"), "{nothing}");
}

#[test]
fn a_case_that_shows_no_clause_is_not_begun() {
    let bench = Bench::new();
    let ran = bench.run(&["trace", "new", "xon-xoff.tx.odd"]).with_code(2);
    assert!(ran.err.contains("which clause does it show?"), "{ran}");
    assert!(ran.err.contains("xon-xoff.tx.obey-xoff"), "{ran}");
    let words = ["trace", "new", "xon-xoff.tx.odd", "--clause", "xon-xoff.tx.obey-xof"];
    let ran = bench.run(&words).with_code(2);
    assert!(ran.err.contains("did you mean \"xon-xoff.tx.obey-xoff\"?"), "{ran}");
    let ran = bench.run(&["trace", "new", "xonxoff.tx.odd"]).with_code(2);
    assert!(ran.err.contains("there is no profile \"xonxoff\""), "{ran}");
    assert_eq!(bench.names(), [""; 0]);
}
