//! Replaying traces.

use crate::bench::{Bench, snapshot};
use crate::files::TRACE;

#[test]
fn a_trace_that_holds_passes_in_every_permutation() {
    let bench = Bench::new();
    bench.write("xon-xoff/xon-xoff.tx.first.spt", TRACE);
    let json = bench.run(&["replay", "xon-xoff", "xon-xoff", "--json"]).with_code(0).json();
    let total = json["total"].as_u64().unwrap();
    assert!(total > 1, "{json}");
    assert_eq!((&json["passed"], &json["failed"]), (&total.into(), &0.into()));
    assert_eq!(json["cases"].as_array().unwrap().len() as u64, total);

    let uncut = ["replay", "xon-xoff", "xon-xoff", "--no-permutations"];
    let ran = bench.run(&uncut).with_code(0);
    assert_eq!(ran.out, "passed: 1 of 1 case passed, from 1 trace\n");
    let both = bench.run(&[&uncut[..], &["--native", "--json"]].concat()).with_code(0).json();
    assert_eq!(both["total"], 2);
    bench.run(&["replay", "native:xon-xoff", "xon-xoff"]).with_code(0);
}

#[test]
fn a_divergence_is_shown_with_the_command_that_shows_it_again() {
    let bench = Bench::new();
    let file = "xon-xoff.tx.first.spt";
    bench.write(file, TRACE.replace("41             ; 'A'", "43             ; 'C'"));
    let ran = bench.run(&["replay", "xon-xoff", file, "--no-permutations"]).with_code(1);
    snapshot("divergence", &ran);
    let again = ran.out.lines().find_map(|line| line.trim().strip_prefix("again: softplug "));
    let words: Vec<_> = again.unwrap().split(' ').collect();
    bench.run(&words).with_code(1);

    bench.run(&["replay", "xon-xoff", file, "--bless", "--force"]).with_code(0);
    assert_eq!(String::from_utf8(bench.read(file)).unwrap(), TRACE);
    bench.run(&["replay", "xon-xoff", file]).with_code(0);
}

#[test]
fn what_selects_nothing_is_no_success() {
    let bench = Bench::new();
    let file = "xon-xoff.tx.first.spt";
    bench.write(file, TRACE);
    bench.write("empty/x.txt", "");
    let mut text = bench.run(&["replay", "xon-xoff", file, "--only", "tx.*"]).with_code(4).err;
    let case = "xon-xoff.tx.first/swap:999";
    text += &bench.run(&["replay", "xon-xoff", file, "--only", case]).with_code(4).err;
    text += &bench.run(&["replay", "xon-xoff", "empty"]).with_code(4).err;
    snapshot("nothing-selected", text);
    bench.run(&["replay", "xon-xoff", file, "--only", "*.first"]).with_code(0);
    let only = ["--only", "xon-xoff.tx.first/twice", "--json"];
    let json = bench.run(&[&["replay", "xon-xoff", file][..], &only].concat()).with_code(0).json();
    assert_eq!(json["total"], 1);
}

#[test]
fn what_cannot_be_read_or_loaded_is_not_judged() {
    let bench = Bench::new();
    bench.write("xon-xoff.tx.first.spt", TRACE);
    bench.write("wrong.spt", "id: x\n");
    bench.write("text.wasm", "G1");
    bench.run(&["replay", "xon-xoff", "none.spt"]).with_code(2);
    bench.run(&["replay", "xon-xoff", "wrong.spt"]).with_code(2);
    bench.run(&["replay", "text.wasm", "xon-xoff.tx.first.spt"]).with_code(3);
    bench.run(&["replay", "none", "xon-xoff.tx.first.spt"]).with_code(2);
}
