//! The author's kit: a new project builds, passes its own tests and is conformant.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::bench::{Bench, Ran, snapshot};

/// The clone that this test stands in.
fn clone() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

/// Built by all tests together: the SDK once.
fn target() -> PathBuf {
    Path::new(env!("CARGO_TARGET_TMPDIR")).join("kit")
}

/// A bench with a new project.
pub(crate) fn project(name: &str, language: &str) -> Bench {
    let bench = Bench::new();
    let ran = in_folder(&bench, "", &["new", name, "--lang", language]).with_code(0);
    assert!(ran.out.contains("softplug build"), "{ran}");
    bench
}

/// Runs the command in a folder of the bench, without a network.
pub(crate) fn in_folder(bench: &Bench, folder: &str, words: &[&str]) -> Ran {
    let mut command = bench.command(words);
    alone(command.current_dir(bench.path(folder))).output().unwrap().into()
}

/// As on an author's machine, but for the SDK and the network.
pub(crate) fn alone(command: &mut Command) -> &mut Command {
    for (name, _) in std::env::vars_os() {
        let name = name.to_string_lossy().into_owned();
        if name.starts_with("CARGO") || name.starts_with("RUST") && name != "RUSTUP_TOOLCHAIN" {
            command.env_remove(name);
        }
    }
    if let Some(home) = std::env::var_os("CARGO_HOME") {
        command.env("CARGO_HOME", home);
    }
    command
        .env("SOFTPLUG_SDK", clone())
        .env("CARGO_TARGET_DIR", target())
        .env("CARGO_NET_OFFLINE", "true")
        .env_remove("SOFTPLUG_PLUGINS")
}

/// Replaces a part of a file, in one step, as whoever watches the folder sees it.
pub(crate) fn edit(bench: &Bench, file: &str, from: &str, to: &str) {
    let text = String::from_utf8(bench.read(file)).unwrap();
    assert!(text.contains(from), "{file} has no {from}");
    bench.write("edited", text.replacen(from, to, 1));
    fs::rename(bench.path("edited"), bench.path(file)).unwrap();
}

/// Builds, replays and certifies a project.
fn is_conformant(bench: &Bench, name: &str) {
    let built = in_folder(bench, name, &["build", "--json"]).with_code(0).json();
    let file = format!("target/plugins/{name}.wasm");
    assert!(built["file"].as_str().unwrap().ends_with(&file), "{built}");
    assert!(built["total"].as_u64().unwrap() < 40_000, "{built}");
    in_folder(bench, name, &["cases", "--lint", "--corpus", "."]).with_code(0);
    in_folder(bench, name, &["trace", "fmt", "--check", "traces"]).with_code(0);
    in_folder(bench, name, &["replay", name, "traces"]).with_code(0);
    let certify = ["certify", name, "--json", "--profile"];
    let abi = in_folder(bench, name, &[&certify[..], &["abi"]].concat()).with_code(0).json();
    assert_eq!(abi["verdict"], "conformant");
    let words = [&certify[..], &[name, "--corpus", ".", "--out", "report"]].concat();
    let own = in_folder(bench, name, &words).with_code(0).json();
    assert_eq!(own["verdict"], "conformant");
}

/// A project in Rust is conformant, passes its own tests, and is short enough to be read at once; it and its module,
/// manifest and all, have at most 12 KiB.
fn begins_like(kind: &str) {
    let bench = Bench::new();
    let name = format!("kit-{kind}");
    let words = ["new", &name, "--like", kind, "--json"];
    let made = in_folder(&bench, "", &words).with_code(0).json();
    let mut bytes = 0;
    for file in made["files"].as_array().unwrap() {
        let file = format!("{name}/{}", file.as_str().unwrap());
        let text = String::from_utf8(bench.read(&file)).unwrap();
        // Where the SDK is does not count.
        let sdk = serde_json::json!(clone().join("sdk/plugin")).to_string();
        bytes += text.replace(&format!("path = {sdk}"), "version = \"0.1.0\"").len();
    }
    assert!(bytes <= 12 * 1024, "{bytes} bytes");
    is_conformant(&bench, &name);
    let module = bench.path(&format!("{name}/target/plugins/{name}.wasm"));
    let bytes = std::fs::metadata(module).unwrap().len();
    assert!(bytes <= 12 * 1024, "the module has {bytes} bytes");
    for words in [["test", "--quiet"], ["fmt", "--check"]] {
        let mut cargo = Command::new(env!("CARGO"));
        cargo.args(words).current_dir(bench.path(&name));
        let ran: Ran = alone(&mut cargo).output().unwrap().into();
        assert_eq!(ran.code, 0, "{ran}");
    }
    match kind {
        "line" => {
            answers_behind(&bench, &name, "tx.lines", "\"x\\n\"");
            outlives_a_burst(&bench, &name, "rx.line", "\"x\\n\"");
        }
        "block" => {
            answers_behind(&bench, &name, "tx.blocks", "02 01 78 78");
            outlives_a_burst(&bench, &name, "rx.blocks", "02 01 78 78");
        }
        _ => {}
    }
}

/// What comes while something long is sent is answered behind it, however small the room is.
fn answers_behind(bench: &Bench, name: &str, clause: &str, received: &str) {
    let data = "A".repeat(128);
    let trace = format!(
        "id: {name}.tx.behind\ntitle: An answer behind what is sent\nprofile: {name}\n\
         clauses: {name}.{clause}\nlevel: must\nline: 9600 8N1 depth=1 reaction=0\nsince: 1\n\
         origin: hand-written\n---\n? 0.000000 send 1 \"{data}\"\n< 0.020000 {received}\n. 1.000000\n"
    );
    let blessed = blessed(bench, name, &trace);
    let sent = blessed.lines().rfind(|line| line.starts_with('>')).unwrap();
    assert!(sent.contains(" 06  ; "), "{blessed}");
    in_folder(bench, name, &["replay", name, "own.spt"]).with_code(0);

    // More of them in one read than answers can wait.
    let (before, given) = trace.split_once("---\n").unwrap();
    assert!(given.starts_with("? "));
    let many = vec![received; 40].join(" ");
    let trace = format!("{before}---\n< 0.020000 {many}\n. 1.000000\n");
    let all = self::blessed(bench, name, &trace);
    let sent: Vec<_> = all.lines().filter(|line| line.starts_with('>')).collect();
    assert_eq!(sent.join(" ").matches(" 06").count(), 40, "{all}");
}

/// Far more of them in one read than can be answered end nothing: the next one is heard. How many
/// are answered hangs on the rooms.
fn outlives_a_burst(bench: &Bench, name: &str, clause: &str, received: &str) {
    let many = vec![received; 300].join(" ");
    let trace = format!(
        "id: {name}.rx.burst\ntitle: A burst\nprofile: {name}\nclauses: {name}.{clause}\nlevel: must\n\
         line: 9600 8N1 depth=1 reaction=0\nsince: 1\norigin: hand-written\n\
         permute: cuts swap twice later after\n---\n< 0.020000 {many}\n\
         < 9.000000 {received}\n. 10.000000\n"
    );
    let all = blessed(bench, name, &trace);
    assert!(
        all.lines().any(|line| line.starts_with("= 9.0") || line.starts_with("> 9.0")),
        "{all}"
    );
    in_folder(bench, name, &["replay", name, "own.spt"]).with_code(0);
}

/// A trace of the project's own, with what the plug-in does.
fn blessed(bench: &Bench, name: &str, trace: &str) -> String {
    let file = format!("{name}/own.spt");
    bench.write(&file, trace);
    in_folder(bench, name, &["replay", name, "own.spt", "--bless"]).with_code(0);
    String::from_utf8(bench.read(&file)).unwrap()
}

#[test]
fn a_project_like_line_is_conformant_and_passes_its_own_tests() {
    begins_like("line");
}

#[test]
fn a_project_like_block_is_conformant_and_passes_its_own_tests() {
    begins_like("block");
}

#[test]
fn a_project_like_stream_is_conformant_and_passes_its_own_tests() {
    begins_like("stream");
}

#[test]
fn a_project_like_request_reply_is_conformant_and_passes_its_own_tests() {
    begins_like("request-reply");
}

/// A project begun from a profile's reference plug-in is conformant to it, by the corpus that comes with it: the
/// suite's own.
fn begins_from(profile: &str, language: &str) {
    let bench = Bench::new();
    let name = format!("kit-{profile}-{language}");
    let words = ["new", &name, "--from", profile, "--lang", language];
    let said = in_folder(&bench, "", &words).with_code(0);
    assert!(said.out.contains(&format!("--profile {profile} ")), "{said}");
    for part in [format!("requirements/{profile}.toml"), format!("traces/{profile}")] {
        let (own, suite) = (bench.path(&name).join(&part), clone().join("fixtures").join(&part));
        assert_eq!(contents(&own), contents(&suite));
    }
    in_folder(&bench, &name, &["build"]).with_code(0);
    let words = ["certify", &name, "--json", "--profile", profile, "--corpus", "."];
    let report = in_folder(&bench, &name, &words).with_code(0).json();
    assert_eq!(report["verdict"], "conformant");
    let shown = in_folder(&bench, &name, &["inspect", &name, "--json"]).with_code(0).json();
    assert_eq!(shown["manifest"]["name"], name);
    in_folder(&bench, &name, &["cases", "--lint", "--corpus", "."]).with_code(0);
}

/// What a file has, or each of a folder's.
fn contents(path: &Path) -> BTreeMap<String, String> {
    let files = match fs::read_dir(path) {
        Ok(entries) => entries.map(|entry| entry.unwrap().path()).collect(),
        Err(_) => vec![path.to_owned()],
    };
    let named = |file: PathBuf| {
        let name = file.file_name().unwrap().to_string_lossy().into_owned();
        (name, fs::read_to_string(file).unwrap())
    };
    files.into_iter().map(named).collect()
}

#[test]
fn a_project_begins_from_a_reference_plug_in() {
    // One that needs another crate of ours, one that needs a foreign one, one that needs none.
    for profile in ["rk512", "fanuc-rs232", "heidenhain-fe"] {
        begins_from(profile, "rust");
    }
}

#[test]
fn what_a_new_project_has() {
    let mut text = String::new();
    for words in [
        &[][..],
        &["--like", "block"],
        &["--like", "stream"],
        &["--like", "request-reply"],
        &["--lang", "c"],
    ] {
        let bench = Bench::new();
        let all = [&["new", "my-machine", "--json"][..], words].concat();
        let json = in_folder(&bench, "", &all).with_code(0).json();
        writeln!(text, "--- {}", words.join(" ")).unwrap();
        for file in json["files"].as_array().unwrap() {
            let file = file.as_str().unwrap();
            let content = bench.read(&format!("my-machine/{file}"));
            let content = String::from_utf8(content).unwrap();
            assert!(!content.contains("my-protocol") && !content.contains("my_protocol"), "{file}");
            writeln!(text, "{file}").unwrap();
        }
        assert_eq!(bench.names(), ["my-machine"]);
    }
    snapshot("new-files", text);
}

#[test]
fn what_is_there_is_never_touched() {
    let bench = Bench::new();
    bench.write("my-machine/mine", "kept");
    bench.write("file", "kept");
    let mut text = String::new();
    for words in [
        &["new", "my-machine"][..],
        &["new", "file"],
        &["new", "My_Machine"],
        &["new", "../other"],
        &["new", "fn"],
        &["new", "xon-xoff"],
        &["new", "softplug-x"],
        &["new", "other", "--from", "abi"],
        &["new", "other", "--from", "r3964", "--lang", "c"],
        &["new", "other", "--like", "block", "--lang", "c"],
        &["new", "other", "--like", "paper"],
        &["new", "other", "--like", "block", "--from", "r3964"],
        &["new", "other", "--sdk", "my-machine"],
        &["new", "other", "--sdk", "none"],
        &["build"],
        &["build", "none"],
    ] {
        let ran = in_folder(&bench, "", words).with_code(2);
        write!(text, "$ softplug {}\n{}", words.join(" "), ran.err).unwrap();
    }
    snapshot("new-refusals", text);
    assert_eq!(bench.names(), ["file", "my-machine"]);
    assert_eq!(Bench::names_in(&bench.path("my-machine")), ["mine"]);
    assert_eq!(bench.read("my-machine/mine"), b"kept");
}

/// What `softplug build` says of a project with one mistake in it.
fn mistakes(name: &str, language: &str, mistakes: &[(&str, &str, &str)], codes: &[i32]) -> String {
    let bench = project(name, language);
    let mut text = String::new();
    for ((file, from, to), code) in mistakes.iter().zip(codes) {
        let file = format!("{name}/{file}");
        let good = bench.read(&file);
        edit(&bench, &file, from, to);
        let ran = in_folder(&bench, name, &["build"]).with_code(*code);
        write!(text, "--- {from} -> {to}\n{}", own_words(&ran.err)).unwrap();
        assert!(!bench.path(&format!("{name}/target/plugins")).exists());
        bench.write(&file, good);
    }
    text
}

/// Without what the compiler says in its own words, which differ by version; its places stay.
fn own_words(text: &str) -> String {
    let is_own = |(at, line): &(usize, &str)| {
        *at == 0 || line.starts_with("hint: ") || line.trim_start().starts_with("--> ")
    };
    let own: Vec<&str> = text.lines().enumerate().filter(is_own).map(|(_, line)| line).collect();
    own.join("\n") + "\n"
}

#[test]
fn mistakes_in_rust_are_told_with_their_place() {
    let text = mistakes(
        "kit-mistakes",
        "rust",
        &[
            ("src/lib.rs", "softplug_plugin::export!(Plugin);", ""),
            ("src/lib.rs", r#""text":"Sends a text line by line."}"#, r#""color":"red"}"#),
            ("src/lib.rs", "i64 = 2000 in", "i64 = \"soon\" in"),
            ("src/lib.rs", "i64 = 2000 in", "i64 = 5 in"),
            ("src/lib.rs", "self.answers.forget();", "self.answers.forgot();"),
            (".cargo/config.toml", "--max-memory=65536", "--max-memory=131072"),
            ("Cargo.toml", "[\"cdylib\", \"rlib\"]", "[\"rlib\"]"),
        ],
        &[1, 3, 3, 3, 1, 3, 3],
    );
    snapshot("build-mistakes-rust", text);
}

#[test]
fn a_panic_tells_its_place_in_the_authors_file() {
    let bench = project("kit-panic", "rust");
    edit(
        &bench,
        "kit-panic/src/lib.rs",
        "        self.is_bad |= ",
        "        assert!(byte != b'M', \"an M has come: {byte}\");\n        self.is_bad |= ",
    );
    let words = ["replay", "kit-panic", "traces", "--only", "*.rx.lines", "--no-permutations"];
    let said = |bench: &Bench| {
        in_folder(bench, "kit-panic", &["build"]).with_code(0);
        in_folder(bench, "kit-panic", &words).with_code(1).out
    };
    let short = said(&bench);
    assert!(short.contains("(see the feature panic-format), at src/lib.rs:"), "{short}");
    edit(&bench, "kit-panic/Cargo.toml", "plugin\" }", "plugin\", features = [\"panic-format\"] }");
    snapshot("replay-panic", said(&bench));
}

mod needs_clang {
    use super::*;

    #[test]
    fn a_project_in_c_begins_from_a_reference_plug_in() {
        begins_from("xon-xoff", "c");
    }

    #[test]
    fn a_project_in_c_is_conformant() {
        let bench = project("kit-c", "c");
        is_conformant(&bench, "kit-c");
        outlives_a_burst(&bench, "kit-c", "rx.line", "\"x\\n\"");
    }

    #[test]
    fn mistakes_in_c_are_told_with_their_place() {
        let text = mistakes(
            "kit-c-mistakes",
            "c",
            &[
                ("manifest.json", "\"type\": \"int\"", "\"type\": \"number\""),
                ("manifest.json", "\"default\": 2000", "\"default\": \"soon\""),
                ("manifest.json", "\"licence\": \"MIT\",", "\"licence\": \"MIT\""),
                ("src/plugin.c", "sp_copy(s.text,", "memmove(s.text,"),
                ("src/softplug.h", "export_name(\"softplug_v1\")", "export_name(\"softplug_v2\")"),
            ],
            &[3, 3, 3, 1, 3],
        );
        snapshot("build-mistakes-c", text);
    }
}
