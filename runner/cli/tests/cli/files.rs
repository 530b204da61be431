//! Verbs that work on files alone: trace fmt, dry runs, ports.

use std::io::Write as _;
use std::process::Stdio;

use crate::bench::{Bench, Ran, snapshot};

pub(crate) const TRACE: &str = "\
id: xon-xoff.tx.first
title: The program leaves at once
profile: xon-xoff
clauses: xon-xoff.tx.at-once
level: must
line: 9600 8N1 depth=1 reaction=0
since: 1
origin: hand-written
---
? 0.000000 send 1 \"AB\"
> 0.000000 41             ; 'A'
= 0.000000 check 1 good
> 0.001042 42             ; 'B'
= 0.002084 done 1 sent=2
. 0.100000
";

#[test]
fn traces_are_brought_into_form() {
    let bench = Bench::new();
    bench.write("good.spt", TRACE);
    bench.run(&["trace", "fmt", "--check", "good.spt"]).with_code(0);
    let untidy = TRACE.replace("             ; 'A'", "").replace("> 0.000000", ">   0.0");
    bench.write("traces/untidy.spt", &untidy);
    bench.write("traces/notes.txt", "not looked at");
    let ran = bench.run(&["trace", "fmt", "--check", "traces", "good.spt"]).with_code(1);
    assert_eq!(ran.out, "traces/untidy.spt\n");
    assert_eq!(bench.read("traces/untidy.spt"), untidy.as_bytes());
    let json = bench.run(&["trace", "fmt", "--json", "traces", "good.spt"]).with_code(0).json();
    assert_eq!(json["changed"], serde_json::json!(["traces/untidy.spt"]));
    assert_eq!(bench.read("traces/untidy.spt"), TRACE.as_bytes());
    bench.run(&["trace", "fmt", "--check", "traces"]).with_code(0);
}

#[test]
fn a_trace_that_cannot_be_parsed_is_shown_and_left() {
    let bench = Bench::new();
    let wrong = TRACE.replace(" 41 ", " 4Z ");
    bench.write("wrong.spt", &wrong);
    bench.write("bytes.spt", b"id: \xff\n");
    bench.write("good.spt", TRACE.replace("             ; 'A'", ""));
    let ran = bench.run(&["trace", "fmt", "wrong.spt", "bytes.spt", "good.spt"]).with_code(2);
    snapshot("trace-faults", ran);
    assert_eq!(bench.read("wrong.spt"), wrong.as_bytes());
    assert_eq!(bench.read("good.spt"), TRACE.as_bytes());
    bench.run(&["trace", "fmt", "none.spt"]).with_code(2);
    bench.write("empty/x.txt", "");
    bench.run(&["trace", "fmt", "empty"]).with_code(4);
}

#[test]
fn a_dry_run_shows_the_wire() {
    let bench = Bench::new();
    bench.write("O1.nc", "%\nO0001 (PART A)\nG1X1\nM30\n%\n");
    let run = |more: &[&str]| {
        let words = ["send", "--dry-run", "--plugin", "xon-xoff", "O1.nc"];
        bench.run(&[&words[..], more].concat())
    };
    snapshot("dry-run", run(&["--set", "send_line_end=crlf"]).with_code(0));
    let raw = run(&["--raw", "--set", "feed_start=12", "--set", "feed_end=14"]).with_code(0).out;
    assert_eq!(raw, "\x12%\nO0001 (PART A)\nG1X1\nM30\n%\n\x14");
    let json = run(&["--json", "--set", "wait_for_xon=on"]).with_code(0).json();
    assert_eq!((&json["result"], &json["bytes"]), (&"done".into(), &28.into()));
    assert!(json["wire"].as_str().unwrap().starts_with("250a4f303030"));
    assert_eq!(json["held_seconds"], 0.0);
}

#[test]
fn a_dry_run_of_pulses_draws_the_part_and_says_where_it_ends() {
    let bench = Bench::new();
    bench.write(
        "ring.nc",
        "G91 S20 T1 M3\nG00 X-12 Z-5\nG01 X-4 Z-20 F300\nG02 X10 Z-5 I5 F200\nM30\n",
    );
    let words = ["send", "--dry-run", "--plugin", "pulse-lathe", "--set", "input=iso", "ring.nc"];
    let picture = ["--picture", "ring.svg"];
    snapshot("dry-run-pulse-lathe", bench.run(&[&words[..], &picture].concat()).with_code(0));
    let svg = String::from_utf8(bench.read("ring.svg")).unwrap();
    assert!(svg.contains("id=\"way\"") && svg.contains("id=\"part\""), "{svg}");
    let json = bench.run(&[&words[..], &["--json"]].concat()).with_code(0).json();
    assert_eq!(json["lathe"]["x_millimetres"], -3.0);
    assert_eq!(json["lathe"]["z_millimetres"], -30.0);
    // The program itself is no place for it.
    let before = bench.read("ring.nc");
    let over = bench.run(&[&words[..], &["--picture", "ring.nc"]].concat()).with_code(2);
    assert!(over.err.contains("is no picture"), "{over}");
    let simulated = bench.run(&["simulate", "pulse-lathe", "--once", "--picture", "ring.nc"]);
    assert!(simulated.with_code(2).err.contains("is no picture"));
    assert_eq!(bench.read("ring.nc"), before);
    let none = ["send", "--dry-run", "--plugin", "xon-xoff", "ring.nc"];
    let ran = bench.run(&[&none[..], &picture].concat()).with_code(2);
    assert!(ran.err.contains("no feed pulses"), "{ran}");
}

#[test]
fn a_dry_run_has_a_willing_partner() {
    let bench = Bench::new();
    bench.write("block.bin", b"AB\x10C");
    bench.write("words.bin", [0x12, 0x34]);
    bench.write("O1.nc", "%\nO1\nM30\n%\n");
    bench.write("1.h", "0 BEGIN PGM 1 MM\n");
    let run = |line: &str| {
        let words = ["send", "--dry-run", "--plugin"];
        bench.run(&[&words[..], &line.split(' ').collect::<Vec<_>>()].concat()).with_code(0)
    };
    snapshot("dry-run-3964r", run("r3964 block.bin"));
    snapshot("dry-run-heidenhain-fe", run("heidenhain-fe 1.h"));
    snapshot("dry-run-xmodem", run("xmodem O1.nc"));
    snapshot("dry-run-kermit", run("kermit O1.nc"));
    let exchange = |line: &str| {
        let json = run(&format!("{line} --json")).json();
        assert_eq!(json["result"], "done", "{line}");
        let pieces = json["exchange"].as_array().unwrap().clone();
        let text = |piece: &serde_json::Value| {
            let arrow = if piece["from"] == "partner" { "<" } else { ">" };
            format!("{arrow}{}", piece["hex"].as_str().unwrap())
        };
        (pieces.iter().map(text).collect::<Vec<_>>().join(" "), json["answered"].clone())
    };
    let quiet = "--set nak_at_start=off";
    let block = ">02 <10 >41421010431003";
    assert_eq!(exchange(&format!("r3964 {quiet} block.bin")).0, format!("{block}53 <10"));
    let without = format!("r3964 {quiet} --set preset=3964 block.bin");
    assert_eq!(exchange(&without).0, format!("{block} <10"));
    let at_once = "r3964-simplified --set handshake=off block.bin";
    assert_eq!(exchange(at_once).0, ">024142101043100353 <10");
    let place = "--field area=DB --field block=5 --field offset=10";
    let rk512 = format!("r3964 {quiet} --set layer=rk512 {place}");
    assert_eq!(
        exchange(&format!("{rk512} --job write words.bin")).0,
        ">02 <10 >00004144050a0001ffff123410033e <1002 >10 <00000000100313 >10"
    );
    assert_eq!(exchange(&format!("{rk512} --job read --field count=7")).1, 14);
    // GTD and EOD.
    let packets = exchange("fanuc-rs232 --set preset=15-remote-a O1.nc").0;
    assert!(packets.contains("45434754440d"), "{packets}");
    assert!(packets.contains("4535454f440d"), "{packets}");
    let raw = run("fanuc-rs232 --raw O1.nc");
    assert_eq!(raw.out, "%\nO1\nM30\n%");
}

#[test]
fn a_second_program_in_a_file_is_refused_at_its_place() {
    let bench = Bench::new();
    bench.write("two.nc", "%\nO1\nM30\n%\n%\nO2\nM30\n%\n");
    let words = ["send", "--dry-run", "--plugin", "fanuc-rs232", "two.nc"];
    let ran = bench.run(&words).with_code(1);
    assert_eq!(ran.out, "");
    let said = "two.nc, line 5, column 1 cannot be sent: text behind the closing %";
    assert!(ran.err.contains(said), "{ran}");
    let json = bench.run(&[&words[..], &["--json"]].concat()).with_code(1).json();
    assert_eq!((&json["failure"], &json["status"]["code"]), (&"bad-job".into(), &4.into()));
    let first = bench.run(&[&words[..], &["--raw", "--set", "after_end=drop"]].concat());
    assert_eq!(first.with_code(0).out, "%\nO1\nM30\n%");
}

#[test]
fn a_dry_run_is_the_same_in_the_sandbox_and_native() {
    let bench = Bench::new();
    bench.write("O1.nc", crate::bench::program("surfacing.nc"));
    let run = |plugin| {
        let words = ["send", "--dry-run", "--raw", "--quiet", "--plugin", plugin, "O1.nc"];
        bench.run(&words).with_code(0).out
    };
    let wire = run("xon-xoff");
    assert_eq!(wire.as_bytes(), bench.read("O1.nc"));
    assert_eq!(run("native:xon-xoff"), wire);
}

#[test]
fn a_control_byte_in_the_program_is_found_before_anything_is_sent() {
    let bench = Bench::new();
    bench.write("O1.nc", b"%\nG1X1\x13\n%\n");
    let words = ["send", "--dry-run", "--plugin", "xon-xoff", "O1.nc"];
    let ran = bench.run(&words).with_code(1);
    assert_eq!(ran.out, "");
    snapshot("control-byte", ran.err);
    let json = bench.run(&[&words[..], &["--json"]].concat()).with_code(1).json();
    assert_eq!(json["result"], "check-failed");
    assert_eq!(json["failure"], "unsupported-character");
}

#[test]
fn standard_input_is_a_program_too() {
    let bench = Bench::new();
    let words = ["send", "--dry-run", "--raw", "--plugin", "xon-xoff", "-"];
    let mut child = bench.command(&words).stdin(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"G1X1\n").unwrap();
    let ran = Ran::from(child.wait_with_output().unwrap()).with_code(0);
    assert_eq!(ran.out, "G1X1\n");
    let ran = bench.run(&words).with_code(2);
    assert_eq!(ran.err, "error: standard input is empty: there is nothing to send\n");
}

#[cfg(target_os = "linux")]
#[test]
fn ports_are_listed_for_machines() {
    let bench = Bench::new();
    bench.run(&["ports"]).with_code(0);
    let json = bench.run(&["ports", "--json"]).with_code(0).json();
    for port in json["ports"].as_array().unwrap() {
        assert!(std::path::Path::new(port["path"].as_str().unwrap()).exists(), "{port}");
    }
}
