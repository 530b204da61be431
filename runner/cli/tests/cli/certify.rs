//! Certifying plug-ins, and verifying what was certified.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::bench::{Bench, Ran, snapshot};

/// The smallest profile of a protocol, and a plug-in that claims it.
const SMALL: [&str; 6] = ["certify", "r3964", "--profile", "3964", "--out", "out"];
/// What every plug-in is certified by takes a fifth of the time: for what reports are held to, whatever they are of.
const QUICK: [&str; 6] = ["certify", "r3964", "--profile", "abi", "--out", "out"];

fn with<'a>(words: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    [words, more].concat()
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures")
}

/// A profile's part of the corpus, to change something in it.
fn corpus_of(bench: &Bench, profile: &str) {
    let copy = |from: &str| {
        let path = fixtures().join(from);
        bench.write(&format!("corpus/{from}"), fs::read(path).unwrap());
    };
    copy(&format!("requirements/{profile}.toml"));
    // That of every plug-in has scripts only.
    for entry in fs::read_dir(fixtures().join("traces").join(profile)).into_iter().flatten() {
        let name = entry.unwrap().file_name().into_string().unwrap();
        copy(&format!("traces/{profile}/{name}"));
    }
}

/// A case that no plug-in passes, of a clause of this level.
fn add_hopeless_case(bench: &Bench, profile: &str, level: &str) {
    corpus_of(bench, profile);
    let sentence = "After a block a bell is rung";
    let fingerprint = "3f3509b4477d7e90";
    let clause = format!(
        "\n[[clause]]\nid = \"{profile}.tx.bell\"\nlevel = \"{level}\"\nsentence = \"{sentence}\"\nsha256 = \
         \"{fingerprint}\"\nsince = 1\n"
    );
    let ledger = format!("corpus/requirements/{profile}.toml");
    let clauses = text(bench, &ledger);
    bench.write(&ledger, clauses + &clause);
    let trace = format!(
        "id: {profile}.tx.bell\ntitle: A bell is rung\nprofile: {profile}\nclauses: {profile}.tx.bell\nlevel: \
         {level}\nline: 9600 8E1 depth=1 reaction=0\nconfig: bcc=off\nsince: 1\norigin: \
         hand-written\n---\n> 1.000000 07             ; BEL\n"
    );
    bench.write(&format!("corpus/traces/{profile}/{profile}.tx.bell.spt"), trace);
}

fn text(bench: &Bench, name: &str) -> String {
    String::from_utf8(bench.read(name)).unwrap()
}

#[test]
fn a_conformant_plug_in_gets_every_report() {
    let bench = Bench::new();
    let ran = bench.run(&SMALL).with_code(0);
    snapshot("certify-conformant", &ran);
    let names = Bench::names_in(&bench.path("out"));
    assert_eq!(names, ["badge.json", "conformance.json", "junit.xml", "report.html"]);
    let first: Vec<_> = names.iter().map(|name| bench.read(&format!("out/{name}"))).collect();
    // Another run, on one thread, in another folder: the same bytes.
    let again = ["certify", "r3964", "--profile", "3964", "--out", "again", "--threads", "1"];
    let json = bench.run(&with(&again, &["--json"])).with_code(0).json();
    let second: Vec<_> = names.iter().map(|name| bench.read(&format!("again/{name}"))).collect();
    assert!(first == second);
    assert_eq!(json["verdict"], "conformant");
    assert_eq!(json["counts"]["executed"], json["counts"]["required"]);

    let verified = bench.run(&["verify", "out/conformance.json", "r3964"]).with_code(0);
    assert!(verified.out.starts_with("reproduced: conformant; "), "{verified}");
}

#[test]
fn a_report_that_names_another_engine_is_not_reproduced_as_a_whole() {
    let bench = Bench::new();
    bench.run(&QUICK).with_code(0);
    let mut report: serde_json::Value =
        serde_json::from_str(&text(&bench, "out/conformance.json")).unwrap();
    let engine = report["suite"]["engine"].as_str().unwrap().to_owned();
    // More fuel than was used, in all places that are to agree: a unit for each byte.
    let more = report["fuel"]["bytes"].as_u64().unwrap();
    let add = |figure: &mut serde_json::Value, more: u64| {
        *figure = (figure.as_u64().unwrap() + more).into();
    };
    add(&mut report["fuel"]["units"], more);
    add(&mut report["fuel"]["tenths_per_byte"], 10);
    let largest = report["fuel"]["largest_case"].clone();
    let cases = report["cases"].as_array_mut().unwrap();
    add(&mut cases.iter_mut().find(|case| case["id"] == largest).unwrap()["fuel"], more);
    let forged = |bench: &Bench, report: &serde_json::Value| {
        bench.write("forged.json", serde_json::to_string_pretty(report).unwrap());
    };
    let verify = ["verify", "forged.json", "r3964"];
    forged(&bench, &report);
    assert!(bench.run(&verify).with_code(1).out.contains("fuel units"));
    report["suite"]["engine"] = "wasmtime 1.0.0".into();
    forged(&bench, &report);
    let ran = bench.run(&verify).with_code(5);
    assert!(ran.out.starts_with("reproduced but for its fuel: "), "{ran}");
    assert!(ran.err.contains("wasmtime 1.0.0 measured it") && ran.err.contains(&engine), "{ran}");
    let json = bench.run(&with(&verify, &["--json"])).with_code(5).json();
    assert_eq!((&json["reproduced"], &json["fuel_compared"]), (&true.into(), &false.into()));
    bench.run(&with(&verify, &["--without-fuel"])).with_code(0);
}

#[test]
fn a_plug_in_of_another_protocol_is_not_conformant() {
    let bench = Bench::new();
    let words = ["certify", "xon-xoff", "--profile", "3964", "--out", "out", "--annotations"];
    let ran = bench.run(&words).with_code(1);
    assert!(ran.out.contains("::error "), "{ran}");
    assert!(ran.out.contains("not conformant: "), "{ran}");
    assert!(ran.out.contains("not claimed by the plug-in"), "{ran}");
    assert!(!text(&bench, "out/badge.json").contains("\"conformant"));
    // Reports of failures are reproduced like others.
    let verify = ["verify", "out/conformance.json"];
    bench.run(&with(&verify, &["xon-xoff"])).with_code(0);
    // Another module is another result.
    let other = bench.run(&with(&verify, &["r3964"])).with_code(1);
    assert!(other.out.contains("plugin") && other.out.contains("NOT REPRODUCED"), "{other}");
}

#[test]
fn what_exploring_says_stands_in_the_report_and_is_reproduced() {
    let bench = Bench::new();
    let ran = bench.run(&with(&SMALL, &["--explore"])).with_code(0);
    let verdict = ran.out.lines().find(|line| line.starts_with("conformant: ")).unwrap();
    assert!(verdict.contains("nothing wrong in any of ") && verdict.ends_with(" with 1 fault"));
    let report: serde_json::Value =
        serde_json::from_str(&text(&bench, "out/conformance.json")).unwrap();
    let explored = &report["explored"];
    assert_eq!(explored["configurations"][0]["name"], "one-block");
    assert!(explored["coverage"]["functions"]["executed"].as_u64().unwrap() > 50);
    assert!(text(&bench, "out/report.html").contains("<h2>Explored</h2>"));
    let verify = ["verify", "out/conformance.json", "r3964"];
    let mut forged = report.clone();
    forged["explored"]["configurations"][0]["digest"] = "0".repeat(32).into();
    bench.write("out/conformance.json", forged.to_string());
    // All but that is reproduced.
    let json = bench.run(&with(&verify, &["--json"])).with_code(1).json();
    let differences = json["differences"].as_array().unwrap();
    assert_eq!(differences.len(), 1, "{json}");
    assert_eq!(differences[0]["field"], "explored configurations 1 digest");
    // Without what was explored the verdict's reason is another one.
    forged.as_object_mut().unwrap().remove("explored");
    bench.write("out/conformance.json", forged.to_string());
    let ran = bench.run(&verify).with_code(2);
    assert!(ran.err.contains("contradicts itself"), "{ran}");
}

#[test]
fn only_what_is_conformant_is_explored_and_only_where_there_is_something_to() {
    let bench = Bench::new();
    let words = ["--case", "3964.tx.*", "--explore", "2"];
    let ran = bench.run(&with(&SMALL, &words)).with_code(5);
    assert!(ran.err.contains("only a conformant plug-in is"), "{ran}");
    let ran = bench.run(&["certify", "r3964", "--profile", "abi", "--explore"]).with_code(2);
    assert!(ran.err.contains("profile \"abi\" cannot be explored"), "{ran}");
    bench.run(&with(&SMALL, &["--explore", "9"])).with_code(2);
}

#[test]
fn a_failure_is_told_with_all_that_is_needed() {
    let bench = Bench::new();
    add_hopeless_case(&bench, "3964", "must");
    let ran = bench.run(&with(&SMALL, &["--corpus", "corpus"])).with_code(1);
    snapshot("certify-failed", &ran);
    let course = text(&bench, "out/failures/3964.tx.bell-uncut.spt");
    assert!(course.contains("id: 3964.tx.bell"), "{course}");
    let again = ran.out.lines().find_map(|line| line.trim().strip_prefix("again: softplug "));
    let words: Vec<_> = again.unwrap().split(' ').collect();
    bench.run(&words).with_code(1);
}

#[test]
fn what_should_pass_warns_and_fails_when_strict() {
    let bench = Bench::new();
    add_hopeless_case(&bench, "abi", "should");
    let ran = bench.run(&with(&QUICK, &["--corpus", "corpus"])).with_code(0);
    assert!(ran.out.contains("conformant with warnings: "), "{ran}");
    let ran = bench.run(&with(&QUICK, &["--corpus", "corpus", "--strict"])).with_code(1);
    assert!(ran.out.contains("not conformant: "), "{ran}");
}

#[test]
fn expected_failures_must_fail_as_expected() {
    let bench = Bench::new();
    add_hopeless_case(&bench, "abi", "must");
    let words = with(&QUICK, &["--corpus", "corpus", "--baseline", "baseline.toml"]);
    let entry = |case: &str, class: &str, reason: &str| {
        let entry = format!(
            "[[expected]]\ncase = \"{case}\"\nclass = \"{class}\"\nreason = \"{reason}\"\n"
        );
        bench.write("baseline.toml", entry);
    };
    entry("abi.tx.bell", "diverged", "the bell is broken");
    let ran = bench.run(&words).with_code(5);
    assert!(ran.out.contains("partial: ") && ran.out.contains("as the baseline expects"), "{ran}");
    bench.run(&["verify", "out/conformance.json", "r3964", "--corpus", "corpus"]).with_code(2);
    let verify = ["verify", "out/conformance.json", "r3964", "--corpus", "corpus"];
    bench.run(&with(&verify, &["--baseline", "baseline.toml"])).with_code(0);
    // Another class, a case that passes, a case that is not there.
    entry("abi.tx.bell", "trapped", "the bell is broken");
    bench.run(&words).with_code(1);
    bench.write(
        "baseline.toml",
        "[[expected]]\ncase = \"abi.tx.bell\"\nclass = \"diverged\"\nreason = \"x\"\n\
         [[expected]]\ncase = \"abi.tx.nothing\"\nclass = \"diverged\"\nreason = \"x\"\n",
    );
    bench.run(&words).with_code(1);
    entry("abi.tx.bell", "diverged", "");
    bench.run(&words).with_code(1);
}

#[test]
fn a_filtered_run_reads_conformant_nowhere() {
    let bench = Bench::new();
    let ran = bench.run(&with(&SMALL, &["--case", "3964.tx.*", "--annotations"])).with_code(5);
    assert!(ran.out.contains("partial: "), "{ran}");
    assert_not_green(&bench, &ran);
    bench.run(&with(&SMALL, &["--case", "nothing.*"])).with_code(4);
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_reads_conformant_nowhere() {
    let bench = Bench::new();
    // The plug-in with the most cases: it is far from its end when the signal comes.
    let words = ["certify", "fanuc-rs232", "--profile", "fanuc-rs232", "--out", "out"];
    let words = with(&words, &["--annotations", "--threads", "1"]);
    let child = bench.command(&words).spawn().unwrap();
    while !bench.path("out").is_dir() {
        std::thread::yield_now();
    }
    let killed = Command::new("kill").arg("-INT").arg(child.id().to_string()).status().unwrap();
    assert!(killed.success());
    let ran = Ran::from(child.wait_with_output().unwrap()).with_code(5);
    assert!(ran.out.contains("partial: "), "{ran}");
    assert_not_green(&bench, &ran);
}

/// No form of the report can be taken for that of a conformant plug-in.
fn assert_not_green(bench: &Bench, ran: &Ran) {
    let json: serde_json::Value =
        serde_json::from_slice(&bench.read("out/conformance.json")).unwrap();
    assert_eq!(json["verdict"], "partial");
    let badge: serde_json::Value = serde_json::from_slice(&bench.read("out/badge.json")).unwrap();
    assert!(badge["message"].as_str().unwrap().contains("partial"), "{badge}");
    assert_ne!(badge["color"], "brightgreen");
    let junit = text(bench, "out/junit.xml");
    assert!(junit.contains("<error") || junit.contains("<failure"), "{junit}");
    let html = text(bench, "out/report.html");
    assert!(html.contains("partial"), "{html}");
    assert!(ran.out.contains("::error") || ran.out.contains("::warning"), "{ran}");
    for text in [&junit, &html, &badge.to_string(), &ran.out] {
        let words = text.to_ascii_lowercase();
        assert!(!words.contains(">conformant<") && !words.contains("\nconformant: "), "{text}");
    }
}

#[test]
fn what_cannot_be_judged_says_why() {
    let bench = Bench::new();
    bench.write("text.wasm", "G1");
    let ran = bench.run(&["certify", "text.wasm", "--profile", "3964", "--out", "out"]);
    let ran = ran.with_code(3);
    assert!(ran.out.contains("not judged: "), "{ran}");
    assert!(text(&bench, "out/junit.xml").contains("<error"));
}

#[test]
fn what_cannot_be_read_is_named_by_its_place() {
    let bench = Bench::new();
    let mut told =
        bench.run(&["certify", "r3964", "--profile", "3946", "--out", "o"]).with_code(2).err;
    told +=
        &bench.run(&["certify", "none.wasm", "--profile", "3964", "--out", "o"]).with_code(2).err;
    bench.write("baseline.toml", "[[expected]]\ncase = 5\n");
    told += &bench.run(&with(&SMALL, &["--baseline", "baseline.toml"])).with_code(2).err;
    bench.write("key.pem", "-----BEGIN PRIVATE KEY-----\nG1\n");
    told += &bench.run(&with(&SMALL, &["--key", "key.pem"])).with_code(2).err;
    corpus_of(&bench, "3964");
    let ledger = text(&bench, "corpus/requirements/3964.toml").replacen("level = ", "level : ", 1);
    bench.write("corpus/requirements/3964.toml", ledger);
    told += &bench.run(&with(&SMALL, &["--corpus", "corpus"])).with_code(2).err;
    corpus_of(&bench, "3964");
    bench.write("corpus/traces/3964/3964.tx.x.spt", "id: 3964.tx.x\nG1\n");
    told += &bench.run(&with(&SMALL, &["--corpus", "corpus"])).with_code(2).err;
    add_hopeless_case(&bench, "3964", "must");
    fs::remove_file(bench.path("corpus/traces/3964/3964.tx.x.spt")).unwrap();
    let case = text(&bench, "corpus/traces/3964/3964.tx.bell.spt");
    let uncited = case.replace("clauses: 3964.tx.bell", "clauses: 3964.tx.gong");
    bench.write("corpus/traces/3964/3964.tx.bell.spt", uncited);
    told += &bench.run(&[&SMALL[..4], &["--corpus", "corpus"]].concat()).with_code(2).err;
    bench.write("conformance.json", "{\"schema\": 1,\n x}");
    told += &bench.run(&["verify", "conformance.json", "r3964"]).with_code(2).err;
    told += &bench.run(&["verify", "none.json", "r3964"]).with_code(2).err;
    bench.write("out", "a file");
    told += &bench.run(&SMALL).with_code(2).err;
    snapshot("certify-unreadable", told);
}

#[test]
fn a_signed_result_is_verified_and_tampering_found() {
    let bench = Bench::new();
    let keys = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../conformance/report/tests/keys");
    for name in ["private.pem", "public.pem", "other-public.pem"] {
        bench.write(name, fs::read(keys.join(name)).unwrap());
    }
    bench.run(&with(&QUICK, &["--key", "private.pem"])).with_code(0);
    let verify = ["verify", "out/conformance.json", "r3964", "--key", "public.pem"];
    let ran = bench.run(&verify).with_code(0);
    assert!(ran.out.contains("signed with the key "), "{ran}");
    let other = ["verify", "out/conformance.json", "r3964", "--key", "other-public.pem"];
    bench.run(&other).with_code(1);

    let report = text(&bench, "out/conformance.json");
    bench.write("out/conformance.json", report.replacen("\"version\": \"", "\"version\": \"9", 1));
    let ran = bench.run(&verify).with_code(1);
    assert!(ran.err.contains("was changed"), "{ran}");
    bench.write("out/conformance.json", report);
    let envelope = text(&bench, "out/attestation.json");
    bench.write("out/attestation.json", envelope.replacen("\"sig\": \"", "\"sig\": \"AA", 1));
    bench.run(&verify).with_code(1);
    // A new run without a key leaves no old signature behind.
    bench.run(&QUICK).with_code(0);
    assert!(!bench.path("out/attestation.json").exists());
    bench.run(&verify).with_code(2);
}

#[test]
fn cases_are_listed_and_explained() {
    let bench = Bench::new();
    let ran = bench.run(&["cases", "3964.*", "--profile", "3964"]).with_code(0);
    assert!(ran.out.lines().count() > 16, "{ran}");
    let json = bench.run(&["cases", "--json"]).with_code(0).json();
    assert!(json["cases"].as_array().unwrap().len() > 600);
    bench.run(&["cases", "nothing*"]).with_code(4);
    bench.run(&["cases", "--profile", "none"]).with_code(2);
    bench.run(&["cases", "--lint"]).with_code(0);

    let explained = bench.run(&["explain", "r3964.tx.late-dle", "--ascii"]).with_code(0);
    snapshot("explain", &explained);
    let json = bench.run(&["explain", "r3964.tx.late-dle/cut:1", "--json"]).with_code(0).json();
    assert!(json["trace"].as_str().unwrap().starts_with("id: r3964.tx.late-dle\n"));
    let ran = bench.run(&["explain", "r3964.tx.late-del"]).with_code(2);
    assert!(ran.err.contains("did you mean \"r3964.tx.late-dle\"?"), "{ran}");
}

#[test]
fn the_corpus_in_the_command_is_the_one_of_the_repository() {
    let bench = Bench::new();
    let embedded = bench.run(&["cases", "--json"]).with_code(0).json();
    let folder = fixtures();
    let read = ["cases", "--json", "--corpus", folder.to_str().unwrap()];
    assert_eq!(bench.run(&read).with_code(0).json(), embedded);
}
