//! The same converter in other languages, packed and certified; hosts in other languages.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::bench::Bench;

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

    #[test]
    fn the_host_in_python_sees_the_same() {
        replays_all(|| {
            let mut python = Command::new("python_wasmtime");
            python.arg(repository("docs/hosts/host.py"));
            python
        });
    }
}

mod needs_node {
    use super::*;

    #[test]
    fn the_host_in_javascript_sees_the_same() {
        replays_all(|| {
            let mut node = Command::new("node");
            node.arg(repository("docs/hosts/host.mjs"));
            node
        });
    }
}
