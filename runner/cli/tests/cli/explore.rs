//! Exploring plug-ins.

use std::process::Stdio;
use std::time::Duration;

use serde_json::Value;

use crate::bench::{Bench, Ran, snapshot};

/// The smallest configuration.
const SMALL: [&str; 6] = ["explore", "xon-xoff", "--profile", "xon-xoff", "--only", "end-mark"];
/// One that takes some seconds with two faults.
const LARGER: [&str; 8] =
    ["explore", "r3964", "--profile", "r3964", "--only", "one-block", "--faults", "2"];

fn with<'a>(words: &[&'a str], more: &[&'a str]) -> Vec<&'a str> {
    [words, more].concat()
}

/// The only configuration of what was explored.
fn only(ran: &Ran) -> Value {
    ran.json()["explored"][0].clone()
}

#[test]
fn a_plug_in_that_keeps_its_promises_is_complete() {
    let ran = Bench::new().run(&SMALL).with_code(0);
    let digest = |line: &&str| !line.trim_start().starts_with("digest");
    let out = ran.out.lines().filter(digest).collect::<Vec<_>>().join("\n");
    snapshot("explore-complete", out);
}

#[test]
fn what_is_found_is_drawn_and_its_traces_run_again() {
    let bench = Bench::new();
    let changed = ["--set", "bcc=off", "--data", "41", "--without-model", "--out", "out"];
    let words = ["explore", "r3964", "--profile", "r3964", "--only", "one-block"];
    let ran = bench.run(&with(&words, &changed)).with_code(1);
    let digest = |line: &&str| !line.trim_start().starts_with("digest");
    snapshot("explore-found", ran.out.lines().filter(digest).collect::<Vec<_>>().join("\n"));

    let names = Bench::names_in(&bench.path("out"));
    assert_eq!(
        names,
        [
            "explored.json",
            "one-block.states",
            "r3964.explored.one-block-altered-0.spt",
            "r3964.explored.one-block-altered-1.spt"
        ]
    );
    // What was explored is what the plug-in does, in whatever way it is run.
    for trace in &names[2..] {
        let path = format!("out/{trace}");
        let ran = bench.run(&["replay", "r3964", &path]).with_code(0);
        assert!(ran.out.starts_with("passed: "), "{ran}");
        bench.run(&["trace", "fmt", "--check", &path]).with_code(0);
    }
}

#[test]
fn whoever_is_killed_goes_on_to_the_same_end() {
    let bench = Bench::new();
    let words = with(&LARGER, &["--json", "--out", "out"]);
    let mut killed = bench.command(&words).stdout(Stdio::null()).spawn().unwrap();
    let states = bench.path("out/one-block.states");
    let is_under_way = || states.metadata().is_ok_and(|file| file.len() > 200_000);
    while !is_under_way() && killed.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(5));
    }
    killed.kill().unwrap();
    killed.wait().unwrap();
    assert!(!bench.path("out/explored.json").exists(), "it was killed in the middle");

    let resumed = only(&bench.run(&with(&words, &["--resume"])).with_code(0));
    let whole = only(&bench.run(&with(&LARGER, &["--json", "--threads", "1"])).with_code(0));
    for field in ["digest", "states", "transitions", "depth", "unavoidable", "complete"] {
        assert_eq!(resumed[field], whole[field], "{field}");
    }
    assert_eq!(whole["complete"], true);
}

/// Whoever was ended in the first configuration has no states of the others.
#[test]
fn configurations_that_were_not_begun_begin() {
    let bench = Bench::new();
    let words = ["explore", "xon-xoff", "--profile", "xon-xoff", "--out", "out", "--json"];
    let whole = bench.run(&words).with_code(0).json();
    for name in Bench::names_in(&bench.path("out")) {
        if name.ends_with(".states") && !name.starts_with("hold") {
            std::fs::remove_file(bench.path(&format!("out/{name}"))).unwrap();
        }
    }
    assert_eq!(bench.run(&with(&words, &["--resume"])).with_code(0).json(), whole);
}

#[test]
fn a_bound_makes_it_incomplete() {
    for bound in [["--states", "50"], ["--depth", "3"]] {
        let ran = Bench::new().run(&with(&SMALL, &with(&bound, &["--json"]))).with_code(5);
        assert_eq!(only(&ran)["complete"], false);
    }
}

#[test]
fn what_cannot_be_explored_is_said() {
    let bench = Bench::new();
    bench.write("out/end-mark.states", "not states");
    bench.write("broken.wasm", "not a module");
    let refused = [
        (&["explore", "r3964", "--profile", "rk512"][..], 2),
        (&with(&SMALL, &["--set", "quiet=1"]), 2),
        (&with(&SMALL, &["--data", "4"]), 2),
        (&with(&SMALL, &["--time", "soon"]), 2),
        (&with(&SMALL, &["--peer-set", "quiet_time=20"]), 2),
        (&with(&SMALL, &["--out", "out", "--resume"]), 2),
        (&["explore", "xon-xoff", "--profile", "xon-xoff", "--only", "all"], 2),
        (&["explore", "broken.wasm", "--profile", "r3964"], 3),
        (&["explore", "r3964", "--profile", "xon-xoff"], 2),
    ];
    let said = refused.map(|(words, code)| bench.run(words).with_code(code).err);
    snapshot("explore-refused", said.join(""));
}

#[test]
fn random_ways_are_those_of_their_seed() {
    let bench = Bench::new();
    let words = ["explore", "xon-xoff", "--profile", "xon-xoff", "--random", "2", "--faults", "3"];
    let [one, two, other] = [("1", "7"), ("2", "7"), ("2", "8")].map(|(threads, seed)| {
        let more = ["--threads", threads, "--seed", seed, "--json"];
        only(&bench.run(&with(&words, &more)).with_code(0))
    });
    assert_eq!((&one["name"], &one["random"]["rounds"]), (&"large".into(), &2.into()));
    assert!(one["random"]["coverage"]["branches"]["executed"].as_u64().unwrap() > 100);
    assert_eq!(one["digest"], two["digest"]);
    assert_ne!(one["digest"], other["digest"]);
    let ran = bench.run(&words).with_code(0);
    assert!(ran.out.starts_with("nothing was found in large"), "{ran}");
    assert!(ran.out.contains("2 rounds, seed 1"), "{ran}");
    bench.run(&with(&words, &["--depth", "3"])).with_code(2);
    bench.run(&with(&SMALL, &["--seed", "3"])).with_code(2);
}

#[test]
fn random_ways_that_time_ends_are_incomplete() {
    let words = ["explore", "xon-xoff", "--profile", "xon-xoff", "--random", "1000000"];
    let ran = Bench::new().run(&with(&words, &["--time", "1s"])).with_code(5);
    assert!(ran.out.starts_with("incomplete: large, "), "{ran}");
}
