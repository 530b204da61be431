//! What the page is answered, without a page.

use crate::common::endless;
use serde_json::{Value, json};
use softplug_playground::Playground;
use std::path::{Path, PathBuf};

fn begin() -> (Playground, Value) {
    let mut playground = Playground::new();
    let begun = ask(&mut playground, &json!({ "do": "begin" }));
    (playground, begun["begun"].clone())
}

fn ask(playground: &mut Playground, request: &Value) -> Value {
    serde_json::from_slice(&playground.answer(request.to_string().as_bytes())).unwrap()
}

fn load(playground: &mut Playground, module: &[u8]) -> Value {
    let request = [b"{\"do\":\"load\"}\n", module].concat();
    serde_json::from_slice(&playground.answer(&request)).unwrap()
}

fn run(trace: &str) -> Value {
    json!({ "do": "run", "trace": trace, "permutation": "uncut" })
}

fn module(name: &str) -> Vec<u8> {
    let folder = std::env::var_os("SOFTPLUG_PLUGINS").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/plugins"),
        PathBuf::from,
    );
    let path = folder.join(format!("{name}.wasm"));
    std::fs::read(&path).unwrap_or_else(|error| {
        panic!("{}: {error}; build the plug-ins with `cargo xtask build`", path.display())
    })
}

fn trace_of<'a>(begun: &'a Value, id: &str) -> &'a str {
    let cases = begun["cases"].as_array().unwrap();
    cases.iter().find(|case| case["id"] == id).unwrap()["trace"].as_str().unwrap()
}

#[test]
fn every_reference_plug_in_runs_every_case_of_its_profile() {
    let (mut playground, begun) = begin();
    assert_eq!(begun["names"][0x13], "DC3=XOFF");
    for name in softplug_native::NativePlugin::ALL.iter().map(|plugin| plugin.name()) {
        let loaded = load(&mut playground, &module(name));
        assert_eq!(loaded["loaded"]["name"], name);
        let profile = &loaded["loaded"]["profiles"][0];
        let cases = begun["cases"].as_array().unwrap();
        let mut count = 0;
        for case in cases.iter().filter(|case| case["profile"] == *profile) {
            let request = json!({
                "do": "run", "trace": case["trace"], "id": case["id"], "permutation": "uncut",
            });
            let ran = ask(&mut playground, &request);
            assert_eq!(ran["ran"]["verdict"], "passed", "{name}: {}", case["id"]);
            assert!(!ran["ran"]["run"]["moments"].as_array().unwrap().is_empty());
            count += 1;
        }
        assert!(count > 10, "{name} has {count} cases of {profile}");
    }
}

#[test]
fn a_fault_in_a_trace_has_its_place() {
    let (mut playground, begun) = begin();
    let trace = trace_of(&begun, "xon-xoff.tx.hold");
    let refused = ask(&mut playground, &run(trace));
    assert_eq!(refused["refused"]["text"], "load a plug-in first");
    load(&mut playground, &module("xon-xoff"));
    let wrong = trace.replace("? 0.000000 send", "? 0.000000 sned");
    let line = 1 + wrong.lines().position(|line| line.contains("sned")).unwrap();
    let refused = ask(&mut playground, &run(&wrong));
    assert_eq!(refused["refused"]["place"], json!([line, 12]), "{refused}");
    assert!(refused["refused"]["text"].as_str().unwrap().contains("send"), "{refused}");
    for request in [json!({ "do": "nothing" }), json!({ "do": "run" }), json!(1)] {
        assert!(ask(&mut playground, &request)["refused"]["text"].is_string(), "{request}");
    }
}

#[test]
fn what_is_no_plug_in_is_refused_and_the_one_before_stays() {
    let (mut playground, begun) = begin();
    load(&mut playground, &module("xon-xoff"));
    for module in [&b""[..], b"\0asm", b"\0asm\x01\0\0\0", &[0xFF; 100]] {
        assert!(load(&mut playground, module)["refused"]["text"].is_string(), "{module:?}");
    }
    let trace = trace_of(&begun, "xon-xoff.tx.hold");
    assert_eq!(ask(&mut playground, &run(trace))["ran"]["verdict"], "passed");
}

#[test]
fn a_module_that_never_ends_is_ended() {
    let (mut playground, _) = begin();
    let loaded = load(&mut playground, &endless());
    assert!(loaded["loaded"].is_object(), "{loaded}");
    let trace = "id: echo.rx.one\ntitle: It sends back what it receives\nprofile: echo\n\
                 clauses: echo.rx.one\nlevel: must\nline: 9600 8N1\nsince: 1\n\
                 origin: hand-written\n---\n< 1.000000 41\n> 1.000000 41\n";
    let ran = ask(&mut playground, &run(trace));
    assert_eq!(ran["ran"]["run"]["failure"]["class"], "budget-exhausted", "{ran}");
}

#[test]
fn noise_is_the_same_for_the_same_seed_and_shows_in_the_trace() {
    let (mut playground, begun) = begin();
    load(&mut playground, &module("xon-xoff"));
    let mut request = run(trace_of(&begun, "xon-xoff.tx.hold"));
    request["noise"] = json!({ "seed": 1, "drop": 1_000 });
    let first = ask(&mut playground, &request);
    assert_eq!(first["ran"]["noisy"]["count"], 2, "{first}");
    assert!(first["ran"]["noisy"]["trace"].as_str().unwrap().contains("# lost: < 0.001500"));
    // XOFF is lost, so the plug-in goes on sending.
    assert_eq!(first["ran"]["run"]["failure"]["class"], "diverged");
    assert_eq!(ask(&mut playground, &request), first);
}
