//! What a stranger does to a unit, and to whoever looks at one.

use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::os::unix::fs::symlink;

use rustix::process::{Pid, Signal, kill_process};

use crate::bench::Bench;
use crate::languages::write_trapping;
use crate::unit::{Unit, bench};

const KEYS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../conformance/report/tests/keys");

/// Whether a text leaves a terminal as it is.
fn is_plain(text: &str) -> bool {
    !text.chars().any(|c| c != '\n' && (c.is_control() || matches!(c, '\u{202e}' | '\u{2066}')))
}

fn text_of(bench: &Bench) -> String {
    String::from_utf8(bench.read("unit.toml")).unwrap()
}

#[test]
fn two_units_do_not_have_one_memory() {
    let bench = bench("unsigned = true");
    let unit = Unit::start(&bench);
    symlink("state", bench.path("also")).unwrap();
    let other = text_of(&bench).replace("state = \"state\"", "state = \"also\"");
    bench.write("other.toml", other);
    let ran = bench.run(&["unit", "run", "other.toml"]).with_code(2);
    let holder = format!("process {} (softplug)", unit.process.id());
    assert!(
        ran.err.contains("mill.slots of link \"mill\": ") && ran.err.contains(&holder),
        "{ran}"
    );
    drop(unit);
    drop(Unit::start(&bench));
}

#[test]
fn two_links_do_not_have_one_memory() {
    let bench = bench("unsigned = true");
    let text = text_of(&bench) + "memory = \"dmem\"\n[[link]]\nname = \"lathe\"\nport = \"pty:\"\n";
    symlink("dmem", bench.path("link")).unwrap();
    for memory in ["dmem", "./dmem", "link", "state/../dmem", "state/mill.settings"] {
        bench
            .write("unit.toml", format!("{text}memory = \"{memory}\"\nmemory_size = \"256KiB\"\n"));
        let ran = bench.run(&["unit", "check", "unit.toml"]).with_code(2);
        assert!(ran.err.contains("give each its own"), "{memory}: {ran}");
    }
    bench.write("unit.toml", format!("{text}memory = \"other\"\nmemory_size = \"256KiB\"\n"));
    bench.run(&["unit", "check", "unit.toml"]).with_code(0);
}

#[test]
fn a_memory_that_a_full_disk_cut_short_does_not_block_the_unit() {
    let bench = bench("unsigned = true");
    bench.write("state/mill.slots", [0xFF; 8_192]);
    let unit = Unit::start(&bench);
    unit.flash(&bench, &[]).with_code(0);
}

#[test]
fn what_can_be_no_memory_is_found_out_by_looking() {
    let bench = bench("unsigned = true");
    let text = text_of(&bench);
    for (line, part) in [
        ("memory = \"/\"", "neither a file nor an MTD"),
        ("memory = \"/dev/null\"", "no MTD device"),
        ("memory = \"unit.toml/mill\"", "is no folder"),
    ] {
        bench.write("unit.toml", format!("{text}{line}\n"));
        let ran = bench.run(&["unit", "check", "unit.toml"]).with_code(2);
        assert!(ran.err.contains(part), "{line}: {ran}");
    }
    bench.write("unit.toml", text.replace("state = \"state\"", "state = \"/proc/x\""));
    let ran = bench.run(&["unit", "check", "unit.toml"]).with_code(2);
    assert!(ran.err.contains("nobody can make files in /proc"), "{ran}");
    bench.write("unit.toml", text);
    bench.run(&["unit", "check", "unit.toml"]).with_code(0);
    assert_eq!(bench.names(), ["unit.toml"], "it only looks");
}

#[test]
fn files_without_an_end_are_not_read_to_it() {
    let bench = bench("unsigned = true");
    let ran = bench.run(&["unit", "check", "/dev/zero"]).with_code(2);
    assert!(ran.err.contains("it is larger than"), "{ran}");
    let link = "unit://127.0.0.1:1/mill";
    let ran = bench.run(&["unit", "flash", link, "/dev/zero"]).with_code(2);
    assert!(ran.err.contains("/dev/zero"), "{ran}");
    let text = text_of(&bench).replace("unsigned = true", "keys = [\"/dev/zero\"]");
    bench.write("unit.toml", text);
    let ran = bench.run(&["unit", "check", "unit.toml"]).with_code(2);
    assert!(ran.err.contains("the key /dev/zero: it is larger than"), "{ran}");
}

#[test]
fn mistakes_are_told_in_one_line_with_their_place() {
    let bench = bench("unsigned = true");
    let text = text_of(&bench);
    let lines = text.lines().count() + 1;
    for (line, column, said) in [
        ("buffer = nan", 10, "write a number of bytes: 512, \"16KiB\" or \"64MiB\""),
        ("depht = 3", 1, "unknown field `depht`"),
        ("most_erases = -1", 15, "invalid value"),
        ("\"\\u001b[2J\\u202e\" = 1", 1, "unknown field `\\u{1b}[2J\\u{202e}`"),
    ] {
        bench.write("unit.toml", format!("{text}{line}\n"));
        let ran = bench.run(&["unit", "check", "unit.toml"]).with_code(2);
        let begin = format!("error: unit.toml:{lines}:{column}: {said}");
        assert!(ran.err.starts_with(&begin), "{begin}: {ran}");
        assert_eq!(ran.err.lines().count(), 1, "{ran}");
    }
    bench.write("unit.toml", text.replace("\"mill\"", "\"mi/ll\""));
    let ran = bench.run(&["unit", "run", "unit.toml"]).with_code(2);
    assert!(ran.err.starts_with("error: unit.toml:7:1: \"mi/ll\" is no name"), "{ran}");
}

#[test]
fn names_of_files_and_units_leave_a_terminal_as_it_is() {
    let bench = bench("unsigned = true");
    let file = "a\u{1b}[2J\u{9b}\u{202e}\u{2066}.toml";
    bench.write(file, "listen = 7\n");
    for words in [
        vec!["unit", "check", file],
        vec!["unit", "run", file],
        vec!["plan", file],
        vec!["unit", "list", "a\u{1b}[2J\u{202e}:1"],
        vec!["unit", "list", "a\u{1b}[2J\u{202e}"],
        vec!["unit", "flash", "unit://a\u{1b}[2J:1/mill", file],
        vec!["gateway", "check", file],
        vec!["send", file, "--port", "pty:", "--plugin", file],
    ] {
        let ran = bench.run(&words);
        assert!(ran.code != 0 && is_plain(&ran.out) && is_plain(&ran.err), "{words:?}: {ran:?}");
    }
    bench.write(file, bench.read("unit.toml"));
    let ran = bench.run(&["unit", "check", file]).with_code(0);
    assert!(is_plain(&ran.out), "{ran:?}");
}

#[test]
fn another_version_is_answered_before_the_connection_ends() {
    let bench = bench("unsigned = true");
    let unit = Unit::start(&bench);
    for said in [&[2, 1, 14, 0, 0, 0, 0, 0][..], b"GET / HTTP/1.1\r\n\r\n"] {
        let mut stream = TcpStream::connect(&unit.address).unwrap();
        stream.write_all(said).unwrap();
        let mut answer = Vec::new();
        stream.read_to_end(&mut answer).unwrap();
        // Version 1, *Refuse*, 13 bytes, and reason 2.
        assert_eq!((answer.len(), &answer[..4], answer[16]), (33, &[1, 3, 13, 0][..], 2));
    }
    // And whoever speaks this one is served.
    unit.list(&bench);
}

#[test]
fn a_terminal_that_is_closed_does_not_end_a_unit() {
    let bench = bench("unsigned = true");
    let mut unit = Unit::start(&bench);
    kill_process(Pid::from_child(&unit.process), Signal::HUP).unwrap();
    unit.list(&bench);
    kill_process(Pid::from_child(&unit.process), Signal::TERM).unwrap();
    assert!(unit.process.wait().unwrap().success());
}

#[test]
fn a_plug_in_that_ends_by_a_fault_is_told_so() {
    let bench = bench("unsigned = true");
    let unit = Unit::start(&bench);
    write_trapping(&bench);
    let link = format!("unit://{}/mill", unit.address);
    let ran = bench.run(&["unit", "flash", &link, "m.wasm"]).with_code(1);
    assert!(ran.err.contains("does not run it: it has ended by a fault: "), "{ran}");
    let link = unit.list(&bench)["units"][0]["links"][0].clone();
    assert!(link["trouble"].as_str().is_some(), "{link}");
}

#[test]
fn why_nothing_runs_is_listed() {
    let bench = bench("unsigned = true");
    let unit = Unit::start(&bench);
    unit.flash(&bench, &[]).with_code(0);
    drop(unit);
    let trouble = || {
        let unit = Unit::start(&bench);
        let link = unit.list(&bench)["units"][0]["links"][0].clone();
        assert!(link["runs"].is_null(), "{link}");
        let ran = bench.run(&["unit", "list", &unit.address]).with_code(0);
        let trouble = link["trouble"].as_str().unwrap().to_owned();
        assert!(ran.out.contains(&trouble), "{ran}");
        trouble
    };
    let text = text_of(&bench);
    let keys = format!("keys = [\"{KEYS}/public.pem\"]");
    bench.write("unit.toml", text.replace("unsigned = true", &keys));
    assert!(trouble().contains("without a signature"), "{}", trouble());
    bench.write("unit.toml", text);
    let file = bench.path("state/mill.slots");
    let mut bytes = fs::read(&file).unwrap();
    // The begin of a module behind the areas of slot A.
    let at = bytes.windows(4).position(|bytes| bytes == b"\0asm").unwrap();
    bytes[at + 100] ^= 1;
    fs::write(&file, bytes).unwrap();
    assert!(trouble().contains("no longer has its digest"), "{}", trouble());
}
