//! `softplug unit`: the real process, from its start to its end, orderly or not.

use std::io::{BufRead, BufReader};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::bench::{Bench, plugins};

const KEYS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../conformance/report/tests/keys");

/// How long something that must come may take on a busy machine.
const PATIENCE: Duration = Duration::from_mins(1);

/// A unit's process; killed when it is dropped.
pub(crate) struct Unit {
    pub(crate) process: Child,
    pub(crate) address: String,
}

impl Unit {
    pub(crate) fn start(bench: &Bench) -> Self {
        let mut process = bench
            .command(&["unit", "run", "unit.toml", "--json"])
            .stdout(Stdio::piped())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(process.stdout.take().unwrap()).read_line(&mut line).unwrap();
        let ready: Value = serde_json::from_str(&line).unwrap();
        assert_eq!((&ready["event"], &ready["links"][0]), (&"ready".into(), &"mill".into()));
        let address = ready["address"].as_str().unwrap().to_owned();
        Self { process, address }
    }

    pub(crate) fn flash(&self, bench: &Bench, more: &[&str]) -> crate::bench::Ran {
        let link = format!("unit://{}/mill", self.address);
        let plugin = plugins().join("xon-xoff.wasm").display().to_string();
        bench.run(&[&["unit", "flash", &link, &plugin], more].concat())
    }

    pub(crate) fn list(&self, bench: &Bench) -> Value {
        bench.run(&["unit", "list", &self.address, "--json"]).with_code(0).json()
    }
}

impl Drop for Unit {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

pub(crate) fn bench(signature: &str) -> Bench {
    let bench = Bench::new();
    let text = format!(
        "name = \"unit-1\"\nserial = 7\nlisten = \"127.0.0.1:0\"\nstate = \"state\"\n[signature]\n{signature}\n\
         [[link]]\nname = \"mill\"\nport = \"pty:\"\nmemory_size = \"256KiB\"\n"
    );
    bench.write("unit.toml", text);
    bench
}

#[test]
fn a_configuration_that_cannot_be_is_refused_in_a_sentence() {
    let bench = bench("unsigned = false");
    let ran = bench.run(&["unit", "check", "unit.toml"]).with_code(2);
    assert!(ran.err.contains("no plug-in could ever be taken"), "{ran}");
    let ran = bench.run(&["unit", "run", "nowhere.toml", "--json"]).with_code(2);
    assert!(ran.out.contains("nowhere.toml"), "{ran}");
    bench.write("unit.toml", "listen = 7\n");
    let ran = bench.run(&["unit", "check", "unit.toml"]).with_code(2);
    assert!(ran.err.contains("unit.toml:1:10: invalid type: integer `7`; write"), "{ran}");
}

#[test]
fn a_unit_that_is_not_there_is_a_matter_of_the_network() {
    let bench = Bench::new();
    bench.run(&["unit", "list", "127.0.0.1:1"]).with_code(6);
    let listed = bench.run(&["unit", "list", "127.0.0.1:1", "--json"]).with_code(6).json();
    assert!(listed["units"][0]["error"].as_str().is_some(), "{listed}");
    let ran = bench.run(&["unit", "list", "nowhere"]).with_code(2);
    assert!(ran.err.contains("has no network interface nowhere"), "{ran}");
    let ran = bench.run(&["unit", "list", "can0/240"]).with_code(2);
    assert!(ran.err.contains("is no unit and no bus"), "{ran}");
    let ran = bench.run(&["unit", "flash", "tcp://a:1/b", "x.wasm"]).with_code(2);
    assert!(ran.err.contains("is no link of a unit"), "{ran}");
}

#[test]
fn what_was_flashed_runs_after_a_kill_without_asking_anybody() {
    let bench = bench("unsigned = true");
    let mut unit = Unit::start(&bench);
    let flashed = unit.flash(&bench, &["--json"]).with_code(0).json();
    assert_eq!(flashed["downloaded"], true);
    let digest = flashed["sha256"].clone();
    let link = unit.list(&bench)["units"][0]["links"][0].clone();
    assert_eq!((&link["runs"], &link["slots"][0]["state"]), (&digest, &"confirmed".into()));
    unit.process.kill().unwrap();
    drop(unit);
    unit = Unit::start(&bench);
    // It compiles what it has first.
    let begin = Instant::now();
    while unit.list(&bench)["units"][0]["links"][0]["runs"] != digest {
        assert!(begin.elapsed() < PATIENCE, "it does not run what it has");
    }
    let flashed = unit.flash(&bench, &["--json"]).with_code(0).json();
    assert_eq!(flashed["downloaded"], false);
    kill_process(Pid::from_child(&unit.process), Signal::TERM).unwrap();
    assert!(unit.process.wait().unwrap().success());
}

#[test]
fn a_unit_with_a_key_takes_what_is_signed_with_it_and_nothing_else() {
    let bench = bench(&format!("keys = [\"{KEYS}/public.pem\"]"));
    let unit = Unit::start(&bench);
    let ran = unit.flash(&bench, &[]).with_code(3);
    assert!(ran.err.contains("takes no plug-in without a signature"), "{ran}");
    let plugin = plugins().join("xon-xoff.wasm").display().to_string();
    let key = format!("{KEYS}/private.pem");
    bench.run(&["unit", "sign", &plugin, "--key", &key, "--output", "x.sig"]).with_code(0);
    bench.write("short.sig", "abc");
    let ran = unit.flash(&bench, &["--signature", "short.sig"]).with_code(2);
    assert!(ran.err.contains("is no signature"), "{ran}");
    let mut wrong = bench.read("x.sig");
    wrong[50] ^= 1;
    bench.write("wrong.sig", wrong);
    let ran = unit.flash(&bench, &["--signature", "wrong.sig"]).with_code(3);
    assert!(ran.err.contains("signature"), "{ran}");
    unit.flash(&bench, &["--signature", "x.sig"]).with_code(0);
}

/// The copy without a signature that runs till then must not stand in the way of the signed one.
#[test]
fn signatures_can_be_wanted_from_now_on() {
    let bench = bench("unsigned = true");
    let unit = Unit::start(&bench);
    unit.flash(&bench, &[]).with_code(0);
    drop(unit);
    let text = String::from_utf8(bench.read("unit.toml")).unwrap();
    let keys = format!("keys = [\"{KEYS}/public.pem\"]");
    bench.write("unit.toml", text.replace("unsigned = true", &keys));
    let unit = Unit::start(&bench);
    let ran = unit.flash(&bench, &[]).with_code(3);
    assert!(ran.err.contains("without a signature"), "{ran}");
    let plugin = plugins().join("xon-xoff.wasm").display().to_string();
    let key = format!("{KEYS}/private.pem");
    bench.run(&["unit", "sign", &plugin, "--key", &key, "--output", "x.sig"]).with_code(0);
    let flashed = unit.flash(&bench, &["--signature", "x.sig", "--json"]).with_code(0).json();
    assert_eq!(flashed["downloaded"], true);
    let link = unit.list(&bench)["units"][0]["links"][0].clone();
    assert_eq!(link["runs"], flashed["sha256"]);
}

#[test]
fn a_key_that_is_none_signs_nothing() {
    let bench = Bench::new();
    let plugin = plugins().join("xon-xoff.wasm").display().to_string();
    for key in ["public.pem", "x25519.pem", "encrypted.pem", "nowhere.pem"] {
        let key = format!("{KEYS}/{key}");
        let ran =
            bench.run(&["unit", "sign", &plugin, "--key", &key, "--output", "x.sig"]).with_code(2);
        assert!(ran.err.contains(&key), "{ran}");
    }
    assert_eq!(bench.names(), Vec::<String>::new());
}

/// A key of this name; its public one.
fn key(bench: &Bench, name: &str) -> String {
    bench.run(&["unit", "key", name]).with_code(0).out.trim_end().to_owned()
}

#[test]
fn a_key_is_made_once_for_its_owner_alone_and_shown() {
    let bench = Bench::new();
    let public = key(&bench, "unit.key");
    let text = bench.read("unit.key");
    assert!(text.starts_with(b"-----BEGIN PRIVATE KEY-----\n"));
    let ran = bench.run(&["unit", "key", "unit.key"]).with_code(2);
    assert!(ran.err.contains("unit.key is there already"), "{ran}");
    assert_eq!(bench.read("unit.key"), text);
    let shown = bench.run(&["unit", "key", "--show", "unit.key", "--json"]).with_code(0).json();
    assert_eq!((&shown["file"], &shown["public"]), (&"unit.key".into(), &public.into()));
    bench.write("open.key", text);
    let ran = bench.run(&["unit", "key", "--show", "open.key"]).with_code(2);
    assert!(ran.err.contains("can be read or written by others than its owner"), "{ran}");
    bench.run(&["unit", "key", "--show", "none.key"]).with_code(2);
    bench.run(&["unit", "key", "nowhere/unit.key"]).with_code(2);
    assert_eq!(bench.names(), ["open.key", "unit.key"]);
}

#[test]
fn a_unit_with_tls_is_for_who_has_a_key_that_it_knows() {
    let bench = bench("unsigned = true");
    let (unit_key, ours, other) =
        (key(&bench, "unit.key"), key(&bench, "gateway.key"), key(&bench, "other.key"));
    let text = String::from_utf8(bench.read("unit.toml")).unwrap();
    let tls = format!("[tls]\nkey = \"unit.key\"\ngateways = [\"{ours}\"]\n[signature]");
    bench.write("unit.toml", text.replace("[signature]", &tls));
    let unit = Unit::start(&bench);
    let with = |key: &'static str| vec!["--key", key, "--unit-key", &unit_key];
    let flashed = unit.flash(&bench, &[with("gateway.key"), vec!["--json"]].concat()).with_code(0);
    assert_eq!(flashed.json()["downloaded"], true);
    let list = |more: &[&str]| bench.run(&[&["unit", "list", &unit.address], more].concat());
    assert!(list(&with("gateway.key")).with_code(0).out.contains("mill: up"));
    // Of several keys any will do.
    let several = ["--key", "gateway.key", "--unit-key", &other, "--unit-key", &unit_key];
    list(&several).with_code(0);
    let ran = list(&["--key", "gateway.key", "--unit-key", &other]).with_code(6);
    assert!(ran.err.contains(&format!("has the key {unit_key}, and not {other}")), "{ran}");
    let ran = list(&with("other.key")).with_code(6);
    assert!(ran.err.contains(&format!("does not know this side's key {other}")), "{ran}");
    let ran = list(&[]).with_code(6);
    assert!(ran.err.contains("speaks TLS, and no key is configured"), "{ran}");
    list(&["--key", "none.key", "--unit-key", &other]).with_code(2);
    let ran = list(&["--key", "gateway.key", "--unit-key", "unit.key"]).with_code(2);
    assert!(ran.err.contains("`--unit-key unit.key` is no public key"), "{ran}");
    let ran = bench.run(&[&["unit", "list", "can0/17"], &with("gateway.key")[..]].concat());
    assert!(ran.with_code(2).err.contains("TLS goes over TCP only"));
}

#[test]
fn a_unit_that_others_reach_is_remarked_on() {
    let bench = bench("unsigned = true");
    let text = String::from_utf8(bench.read("unit.toml")).unwrap();
    bench.write("unit.toml", text.replace("127.0.0.1:0", "0.0.0.0:7640"));
    let ran = bench.run(&["unit", "check", "unit.toml"]).with_code(0);
    assert!(ran.err.contains("note: whoever reaches 0.0.0.0:7640 can feed the machines"), "{ran}");
    let checked = bench.run(&["unit", "check", "unit.toml", "--json"]).with_code(0).json();
    assert_eq!(checked["remarks"].as_array().map(Vec::len), Some(1), "{checked}");
}
