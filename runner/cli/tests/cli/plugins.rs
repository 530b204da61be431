//! Finding, loading and inspecting plug-ins.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::bench::{Bench, plugins, snapshot};

#[test]
fn inspect_shows_people_the_manifest() {
    let bench = Bench::new();
    snapshot("inspect", bench.run(&["inspect", "xon-xoff"]).with_code(0));
}

#[test]
fn inspect_gives_machines_the_facts() {
    let bench = Bench::new();
    let json = bench.run(&["inspect", "xon-xoff", "--json"]).with_code(0).json();
    let size = fs::metadata(plugins().join("xon-xoff.wasm")).unwrap().len();
    assert_eq!(json["abi"], "1.0");
    assert_eq!(json["imports"], 0);
    assert_eq!(json["size"], size);
    assert_eq!(json["memory_pages"], 1);
    assert_eq!(json["sha256"].as_str().unwrap().len(), 64);
    assert_eq!(json["manifest"]["name"], "xon-xoff");
    let settings = json["manifest"]["settings"].as_array().unwrap();
    let xon = settings.iter().find(|setting| setting["name"] == "xon").unwrap();
    assert_eq!((&xon["type"], &xon["default"]), (&"int".into(), &17.into()));
}

#[test]
fn plug_ins_are_found_by_path_by_name_and_beside() {
    let bench = Bench::new();
    let module = fs::read(plugins().join("xon-xoff.wasm")).unwrap();
    bench.write("mine/other.wasm", &module);
    bench.run(&["inspect", "mine/other.wasm"]).with_code(0);
    bench.run(&["inspect", "other", "--plugins", "mine"]).with_code(0);
    // The folders beside the command are named only if they are others.
    let ran = bench.run(&["inspect", "other"]).with_code(2);
    let mut said = ran.to_string();
    for folder in Path::new(env!("CARGO_BIN_EXE_softplug")).ancestors().skip(1).take(2) {
        said = said.replace(&format!(", {}", folder.join("plugins/other.wasm").display()), "");
    }
    snapshot("plug-in-not-found", said);
    // Right beside the command, and beside its folder.
    let command = bench.path("tool/bin/softplug");
    fs::create_dir_all(command.parent().unwrap()).unwrap();
    fs::copy(env!("CARGO_BIN_EXE_softplug"), &command).unwrap();
    for folder in ["tool/bin/plugins", "tool/plugins"] {
        let file = format!("{folder}/beside.wasm");
        bench.write(&file, &module);
        let ran = Command::new(&command).args(["inspect", "beside"]).output().unwrap();
        assert!(ran.status.success(), "{folder}: {ran:?}");
        fs::remove_file(bench.path(&file)).unwrap();
    }
    bench.write("target/plugins/other.wasm", &module);
    bench.run(&["inspect", "other"]).with_code(0);
}

#[test]
fn what_is_no_plug_in_is_refused_by_its_rule() {
    let bench = Bench::new();
    let module = fs::read(plugins().join("xon-xoff.wasm")).unwrap();
    bench.write("text.wasm", "G1X1");
    bench.write("empty.wasm", "");
    bench.write("bare.wasm", b"\0asm\x01\0\0\0");
    bench.write("cut.wasm", &module[..module.len() / 2]);
    bench.write("large.wasm", vec![0; 256 * 1024 + 1]);
    let mut text = String::new();
    for name in ["text", "empty", "bare", "large"] {
        let ran = bench.run(&["inspect", &format!("{name}.wasm")]).with_code(3);
        assert_eq!(ran.out, "");
        text += &ran.err;
    }
    snapshot("no-plug-in", text);
    bench.run(&["inspect", "cut.wasm"]).with_code(3);
    let json = bench.run(&["inspect", "text.wasm", "--json"]).with_code(3).json();
    assert_eq!(json["error"]["code"], 3);
    assert!(json["error"]["message"].as_str().unwrap().contains("text.wasm"));
}

#[test]
fn a_module_that_is_not_there_is_a_file_that_cannot_be_read() {
    let bench = Bench::new();
    bench.write("folder.wasm/x", "");
    let mut text = bench.run(&["inspect", "none.wasm"]).with_code(2).err;
    text += &bench.run(&["inspect", "folder.wasm"]).with_code(2).err;
    text += &bench.run(&["inspect", "native:xon-xoff"]).with_code(2).err;
    snapshot("no-module", text);
}
