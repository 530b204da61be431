//! The same converter in other languages, packed and certified; hosts in other languages.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::bench::Bench;
use crate::files::TRACE;
use crate::pack::{BARE, MANIFEST};

/// A file of the repository.
fn repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(path)
}

/// Runs a program that must succeed; what it printed.
fn succeed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    assert!(
        output.status.success(),
        "{command:?}\n{}{}",
        text(&output.stdout),
        text(&output.stderr)
    );
    text(&output.stdout)
}

/// Packs and certifies a module, under both engines; the digest of what it did.
fn certify(bench: &Bench, module: &str, manifest: &str) -> String {
    let manifest = repository(manifest);
    bench.run(&["pack", module, "--manifest", manifest.to_str().unwrap()]).with_code(0);
    digest(bench, module)
}

fn digest(bench: &Bench, plugin: &str) -> String {
    let words = ["certify", plugin, "--profile", "xon-xoff", "--json"];
    let json = bench.run(&words).with_code(0).json();
    assert_eq!(json["verdict"], "conformant", "{json}");
    json["digest"].as_str().unwrap().to_owned()
}

mod needs_clang {
    use super::*;

    /// The build line of the header, word by word.
    fn build(bench: &Bench, define: &[&str]) {
        let source = repository("sdk/c/xon-xoff/xon_xoff.c");
        let header = std::fs::read_to_string(repository("sdk/c/softplug.h")).unwrap();
        let (_, line) = header.split_once(" *     clang ").unwrap();
        let (line, _) = line.split_once("-o my-plugin.wasm").unwrap();
        let words = line.split_whitespace().filter(|word| !matches!(*word, "\\" | "*"));
        let mut clang = Command::new("clang");
        clang.args(words).args(define).args(["-Wall", "-Wextra", "-Werror", "-o"]);
        succeed(clang.arg(bench.path("c.wasm")).arg(source));
    }

    #[test]
    fn c_does_what_rust_does() {
        let bench = Bench::new();
        build(&bench, &[]);
        let done = certify(&bench, "c.wasm", "sdk/c/xon-xoff/xon-xoff.json");
        assert_eq!(done, digest(&bench, "xon-xoff"));
    }

    #[test]
    fn the_core_is_conformant_and_under_4_kib() {
        let bench = Bench::new();
        build(&bench, &["-DXON_XOFF_CORE"]);
        let size = bench.read("c.wasm").len();
        assert!(size < 4096, "{size}");
        certify(&bench, "c.wasm", "sdk/c/xon-xoff/xon-xoff-core.json");
    }
}

mod needs_asc {
    use super::*;

    #[test]
    fn assemblyscript_does_what_rust_does() {
        let bench = Bench::new();
        let mut asc = Command::new("asc");
        asc.current_dir(repository("sdk/assemblyscript"));
        succeed(asc.args(["xon-xoff.ts", "--outFile"]).arg(bench.path("as.wasm")));
        let done = certify(&bench, "as.wasm", "sdk/assemblyscript/xon-xoff.json");
        assert_eq!(done, digest(&bench, "xon-xoff"));
    }
}

/// A module that says "ALARM" and traps at its first event.
fn trapping() -> Vec<u8> {
    let mut module = BARE.to_vec();
    let step = module.windows(5).position(|bytes| bytes == *b"\x04\0\x41\0\x0b").unwrap();
    module[step..step + 5].copy_from_slice(b"\x04\0\0\x01\x0b");
    // The data goes on to the last words: the lengths of the section and of what is in it.
    let data = module.len() - 32;
    module[data + 1] += 33;
    module[data + 7] += 33;
    module.extend([0; 24]);
    module.extend(b"\x05\0\0\0ALARM");
    module
}

/// Writes `m.wasm`, a plug-in that traps at its first event.
pub(crate) fn write_trapping(bench: &Bench) {
    bench.write("m.wasm", trapping());
    let jobs = "\"jobs\": [{\"name\": \"send\", \"text\": \"traps\"}], \"protocol\"";
    bench.write("m.json", MANIFEST.replace("\"protocol\"", jobs));
    bench.run(&["pack", "m.wasm", "--manifest", "m.json"]).with_code(0);
}

/// A host must end an instance that traps, and hear its last words.
fn hears_last_words(mut host: impl FnMut() -> Command) {
    let bench = Bench::new();
    write_trapping(&bench);
    bench.write("xon-xoff/xon-xoff.tx.first.spt", TRACE);
    bench.run(&["replay", "m.wasm", "xon-xoff", "--calls", "calls.jsonl"]).with_code(1);
    let mut calls = String::from_utf8(bench.read("calls.jsonl")).unwrap();
    assert!(calls.contains("\"last_words\":\"ALARM\""), "{calls}");
    // Whoever calls it again hears the same.
    let last = calls.lines().last().unwrap().to_owned();
    calls += &last;
    let count = calls.lines().count() - 1;
    let calls = bench.write("calls.jsonl", calls);
    let said = succeed(host().arg(bench.path("m.wasm")).arg(&calls));
    assert_eq!(said, format!("{count} calls, identical\n"));
    let other = String::from_utf8(bench.read("calls.jsonl")).unwrap().replace("ALARM", "alarm");
    let output = host().arg(bench.path("m.wasm")).arg(bench.write("o.jsonl", other)).output();
    assert_eq!(output.unwrap().status.code(), Some(1));
}

/// A host must refuse what is no plug-in.
fn refuses_what_is_none(mut host: impl FnMut() -> Command) {
    let bench = Bench::new();
    bench.write("calls.jsonl", "{\"calls\":1,\"instance\":1}\n");
    let mut refuses = |module: &[u8], sentence: &str| {
        bench.write("m.wasm", module);
        let output =
            host().arg(bench.path("m.wasm")).arg(bench.path("calls.jsonl")).output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(!output.status.success() && said.contains(sentence), "{said}");
    };
    refuses(b"G1X1", "module");
    refuses(BARE, "it has no manifest");
    refuses(
        &[&BARE[..22], b"\x02\x07\x01\x01e\x01f\0\0", &BARE[22..]].concat(),
        "it imports something",
    );
    let mut grows = BARE.to_vec();
    let memory = grows.windows(4).position(|bytes| bytes == [5, 4, 1, 1]).unwrap();
    grows[memory + 5] = 2;
    grows.extend(b"\0\x14\x11softplug.manifest{}");
    refuses(&grows, "its memory can grow");
    let mut overlaps = BARE.to_vec();
    let mailbox = overlaps.len() - 24;
    overlaps[mailbox + 9] = 4;
    overlaps.extend(b"\0\x14\x11softplug.manifest{}");
    refuses(&overlaps, "the mailbox overlaps");
}

/// Lets a host replay the calls of some traces of every reference plug-in; of these one is
/// falsified afterwards, which it must find.
fn replays_all(mut host: impl FnMut() -> Command) {
    let bench = Bench::new();
    for (plugin, pattern) in [
        ("xon-xoff", "xon-xoff.*"),
        ("r3964", "3964.tx.*"),
        ("r3964", "rk512.*"),
        ("r3964-simplified", "r3964-simplified.*"),
        ("fanuc-rs232", "fanuc-rs232.*"),
        ("heidenhain-fe", "heidenhain-fe.*"),
        ("pulse-lathe", "pulse-lathe.words.*"),
        ("xmodem", "xmodem.*"),
        ("kermit", "kermit.*"),
    ] {
        let traces = pattern.split('.').next().unwrap();
        let traces = repository("fixtures/traces").join(traces);
        let words = ["replay", plugin, traces.to_str().unwrap(), "--only", pattern];
        let calls = ["--no-permutations", "--calls", "calls.jsonl"];
        bench.run(&[&words[..], &calls].concat()).with_code(0);
        let module = crate::bench::plugins().join(format!("{plugin}.wasm"));
        let text = String::from_utf8(bench.read("calls.jsonl")).unwrap();
        let count = text.lines().filter(|line| line.contains("\"kind\"")).count();
        assert!(count > 50, "{pattern}: {count}");
        let said = succeed(host().arg(&module).arg(bench.path("calls.jsonl")));
        assert_eq!(said, format!("{count} calls, identical\n"), "{pattern}");

        let falsified =
            text.replacen("\"result\":0,\"actions\":\"\"", "\"result\":1,\"actions\":\"00\"", 1);
        let falsified = bench.write("false.jsonl", falsified);
        let output = host().arg(&module).arg(falsified).output().unwrap();
        assert_eq!(output.status.code(), Some(1), "{output:?}");
        assert!(String::from_utf8_lossy(&output.stdout).starts_with("expected {"), "{output:?}");
    }
}

mod needs_python_wasmtime {
    use super::*;

    fn host() -> Command {
        let mut python = Command::new("python_wasmtime");
        python.arg(repository("docs/hosts/host.py"));
        python
    }

    #[test]
    fn the_host_in_python_sees_the_same() {
        replays_all(host);
    }

    #[test]
    fn the_host_in_python_is_strict() {
        hears_last_words(host);
        refuses_what_is_none(host);
    }
}

mod needs_node {
    use super::*;

    fn host() -> Command {
        let mut node = Command::new("node");
        node.arg(repository("docs/hosts/host.mjs"));
        node
    }

    #[test]
    fn the_host_in_javascript_sees_the_same() {
        replays_all(host);
    }

    #[test]
    fn the_host_in_javascript_is_strict() {
        hears_last_words(host);
        refuses_what_is_none(host);
    }
}
