//! Packing modules, and the calls of a replay.

use crate::bench::{Bench, snapshot};
use crate::files::TRACE;

pub(crate) const MANIFEST: &str = r#"{
    "abi": "1.0",
    "name": "packed",
    "version": "2.0.0",
    "licence": "MIT",
    "protocol": "none",
    "description": "Sends nothing."
}"#;

/// The smallest module that can be started: one page of memory, a mailbox, a step.
pub(crate) const BARE: &[u8] = b"\0asm\x01\0\0\0\
    \x01\x0c\x02\x60\0\x01\x7f\x60\x03\x7f\x7f\x7e\x01\x7f\
    \x03\x03\x02\0\x01\
    \x05\x04\x01\x01\x01\x01\
    \x07\x2b\x03\x06memory\x02\0\x0bsoftplug_v1\0\0\x10softplug_v1_step\0\x01\
    \x0a\x0b\x02\x04\0\x41\x10\x0b\x04\0\x41\0\x0b\
    \x0b\x1e\x01\0\x41\x10\x0b\x18\
    \0\x04\0\0\0\x02\0\0\0\x08\0\0\0\x02\0\0\x40\0\0\0\x40\0\0\0";

fn custom(name: &str, content: &[u8]) -> Vec<u8> {
    let length = u8::try_from(1 + name.len() + content.len()).unwrap();
    assert!(length < 0x80);
    [&[0, length, name.len() as u8], name.as_bytes(), content].concat()
}

fn bench(module: &[u8]) -> Bench {
    let bench = Bench::new();
    bench.write("m.wasm", module);
    bench.write("m.json", MANIFEST);
    bench
}

#[test]
fn a_module_becomes_a_plug_in_in_its_place() {
    let bench = bench(BARE);
    let pack = ["pack", "m.wasm", "--manifest", "m.json"];
    let ran = bench.run(&pack).with_code(0);
    let packed = bench.read("m.wasm");
    assert_eq!(
        ran.out,
        format!(
            "m.wasm: packed 2.0.0, {} bytes, {} of them manifest\n",
            packed.len(),
            MANIFEST.len() - 37
        )
    );
    assert!(packed.starts_with(BARE));
    let json = bench.run(&["inspect", "m.wasm", "--json"]).with_code(0).json();
    assert_eq!(json["manifest"]["description"], "Sends nothing.");
    // Once more: the manifest is replaced, not doubled.
    bench.write("m.json", MANIFEST.replace("2.0.0", "2.0.1"));
    let json = bench.run(&[&pack[..], &["--json"]].concat()).with_code(0).json();
    assert_eq!(json["version"], "2.0.1");
    assert_eq!(json["size"], packed.len());
    assert_eq!(bench.read("m.wasm").len(), packed.len());
    assert_eq!(bench.names(), ["m.json", "m.wasm"]);
}

#[test]
fn what_is_asked_is_stripped() {
    let module =
        [BARE, &custom(".debug_line", b"DEBUG"), &custom("name", b"\0\x05\x04NAME")].concat();
    let bench = bench(&module);
    let packed = |strip: &[&str]| {
        let words =
            [&["pack", "m.wasm", "--manifest", "m.json", "--out", "o.wasm"], strip].concat();
        bench.run(&words).with_code(0);
        String::from_utf8_lossy(&bench.read("o.wasm")).into_owned()
    };
    let has = |packed: String| (packed.contains("DEBUG"), packed.contains("NAME"));
    assert_eq!(has(packed(&[])), (true, true));
    assert_eq!(has(packed(&["--strip"])), (false, true));
    assert_eq!(has(packed(&["--strip=debug"])), (false, true));
    assert_eq!(has(packed(&["--strip=all"])), (false, false));
    assert_eq!(bench.read("m.wasm"), module);
}

#[test]
fn what_would_be_no_plug_in_is_not_written() {
    let imports = [&BARE[..22], b"\x02\x07\x01\x01e\x01f\0\0", &BARE[22..]].concat();
    let mut grows = BARE.to_vec();
    let memory = grows.windows(4).position(|bytes| bytes == [5, 4, 1, 1]).unwrap();
    grows[memory + 5] = 2;
    let renamed = |from: &str, to: &str| {
        let at = BARE.windows(from.len()).position(|bytes| bytes == from.as_bytes()).unwrap();
        let mut module = BARE.to_vec();
        module[at..at + from.len()].copy_from_slice(to.as_bytes());
        module
    };
    let mut overlapping = BARE.to_vec();
    let mailbox = overlapping.len() - 24;
    overlapping[mailbox + 9] = 4;
    let modules = [
        b"G1X1".to_vec(),
        BARE[..60].to_vec(),
        imports,
        grows,
        renamed("softplug_v1_step", "softplug_v1_stop"),
        overlapping,
    ];
    let mut text = String::new();
    for module in modules {
        let bench = bench(&module);
        let ran = bench.run(&["pack", "m.wasm", "--manifest", "m.json"]).with_code(3);
        assert_eq!(bench.read("m.wasm"), module);
        assert_eq!(bench.names(), ["m.json", "m.wasm"]);
        text += &ran.err;
    }
    for (from, to) in [
        ("\"licence\": \"MIT\",", ""),
        ("\"packed\"", "\"Packed!\""),
        ("\"abi\": \"1.0\"", "\"abi\": \"9.0\""),
        ("\"none\",", "\"none\", \"color\": 1,"),
    ] {
        let bench = bench(BARE);
        bench.write("m.json", MANIFEST.replace(from, to));
        text += &bench.run(&["pack", "m.wasm", "--manifest", "m.json"]).with_code(3).err;
        assert_eq!(bench.read("m.wasm"), BARE);
    }
    snapshot("pack-refusals", text);
    let bench = bench(BARE);
    bench.run(&["pack", "none.wasm", "--manifest", "m.json"]).with_code(2);
    bench.run(&["pack", "m.wasm", "--manifest", "none.json"]).with_code(2);
    bench.run(&["pack", "m.wasm", "--manifest", "m.json", "--out", "no/m.wasm"]).with_code(2);
}

#[test]
fn the_calls_of_a_replay_are_written() {
    let bench = Bench::new();
    bench.write("xon-xoff/xon-xoff.tx.first.spt", TRACE);
    bench.run(&["replay", "xon-xoff", "xon-xoff", "--calls", "c.jsonl"]).with_code(0);
    let text = String::from_utf8(bench.read("c.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> =
        text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(lines[0]["calls"], 1);
    assert_eq!(lines[0]["plugin"], "xon-xoff");
    assert_eq!(lines[0]["trace"], "xon-xoff.tx.first");
    let names: Vec<_> = lines[1..].iter().map(|line| line["name"].as_str().unwrap()).collect();
    assert_eq!(names[0], "settings");
    assert!(names.contains(&"open") && names.contains(&"job-data"), "{names:?}");
    let open = lines.iter().find(|line| line["name"] == "open").unwrap();
    assert_eq!((&open["kind"], &open["now"]), (&2.into(), &0.into()));
    for line in &lines[1..] {
        let bytes = line["actions"].as_str().unwrap().len() as i64 / 2;
        assert_eq!(line["result"].as_i64().unwrap() & !0x4000_0000, bytes, "{line}");
    }
    assert!(lines.iter().any(|line| line["result"].as_i64() > Some(0)));
}
