//! Every plug-in does the same under the interpreter of units without an operating system as under the
//! other engines: the same effects at the same times in every case of its profiles, so the same digest of them.

use crate::common::{cases, module, root};
use sha2::{Digest, Sha256};
use softplug_conformance::{Judge, Permutation, Sandboxed};
use softplug_host::{EngineKind, Host, HostOptions};
use std::path::Path;
use std::process::Command;

const ENGINES: &[EngineKind] = &[
    EngineKind::Interpreter,
    EngineKind::Wasmi,
    #[cfg(feature = "wasmtime")]
    EngineKind::Wasmtime,
];

/// One plug-in, cut in all ways and saved and restored at every place.
fn does_the_same(module: &[u8]) {
    let subjects = ENGINES.iter().map(|&engine| {
        // The engines count fuel in their own ways: none may come to its end here.
        let options = HostOptions { engine, fuel_per_event: 100_000_000, ..HostOptions::default() };
        Sandboxed::new(Host::new(options).unwrap().load_bytes(module).unwrap())
    });
    let subjects: Vec<Sandboxed> = subjects.collect();
    let ways = [
        Permutation::Uncut,
        Permutation::CutSingly,
        Permutation::CutWhole,
        Permutation::Twice,
        Permutation::SwapAll,
    ];
    let mut runs = 0;
    let digest = |subject: &Sandboxed| {
        let mut digest = Sha256::new();
        for profile in &subject.manifest().profiles {
            for case in cases(&profile.name) {
                for way in &ways {
                    let outcome = subject.run(&case, way, 0);
                    let fault = outcome.fault.as_ref().map(|fault| fault.class);
                    digest.update(format!("{way} {:?} {fault:?}\n", outcome.seen));
                    runs += outcome.seen.len();
                }
            }
        }
        format!("{:x?}", digest.finalize())
    };
    let digests: Vec<String> = subjects.iter().map(digest).collect();
    assert!(runs > 1_000, "{runs} effects prove little");
    for (other, subject) in digests.iter().zip(&subjects) {
        let is_same = digests[0] == *other;
        assert!(is_same, "{}", first_difference(&subjects[0], subject, &ways));
    }
}

fn first_difference(one: &Sandboxed, other: &Sandboxed, ways: &[Permutation]) -> String {
    for profile in &one.manifest().profiles {
        for case in cases(&profile.name) {
            for way in ways {
                let (one, other) = (one.run(&case, way, 0), other.run(&case, way, 0));
                if one.seen != other.seen {
                    return format!("{way} of a case: {:?}\n{:?}", one.seen, other.seen);
                }
            }
        }
    }
    "by nothing, or by its fault".to_owned()
}

#[test]
fn xon_xoff() {
    does_the_same(&module("xon-xoff"));
}

#[test]
fn r3964() {
    does_the_same(&module("r3964"));
}

#[test]
fn r3964_simplified() {
    does_the_same(&module("r3964-simplified"));
}

#[test]
fn fanuc() {
    does_the_same(&module("fanuc-rs232"));
}

#[test]
fn kermit() {
    does_the_same(&module("kermit"));
}

#[test]
fn xmodem() {
    does_the_same(&module("xmodem"));
}

#[test]
fn heidenhain() {
    does_the_same(&module("heidenhain-fe"));
}

#[test]
fn pulse_lathe() {
    does_the_same(&module("pulse-lathe"));
}

/// The module that a command writes to the path that is added to it, with its manifest.
fn made_by(command: &mut Command, manifest: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.wasm");
    let output = command.arg(&path).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut module = std::fs::read(&path).unwrap();
    let name = b"softplug.manifest";
    let json = std::fs::read(root().join(manifest)).unwrap();
    let content = [&[name.len() as u8], &name[..], &json].concat();
    // The length as five bytes, which is always enough.
    let length =
        (0..5).map(|nth| (content.len() >> (7 * nth)) as u8 & 0x7F | u8::from(nth < 4) << 7);
    module.push(0);
    module.extend(length);
    module.extend(content);
    module
}

mod needs_clang {
    use super::*;

    #[test]
    fn xon_xoff_in_c() {
        let header = std::fs::read_to_string(root().join("sdk/c/softplug.h")).unwrap();
        let (_, line) = header.split_once(" *     clang ").unwrap();
        let (line, _) = line.split_once("-o my-plugin.wasm").unwrap();
        let words = line.split_whitespace().filter(|word| !matches!(*word, "\\" | "*"));
        let source = root().join(Path::new("sdk/c/xon-xoff/xon_xoff.c"));
        let mut clang = Command::new("clang");
        clang.args(words).arg(source).arg("-o");
        does_the_same(&made_by(&mut clang, "sdk/c/xon-xoff/xon-xoff.json"));
    }
}

mod needs_asc {
    use super::*;

    #[test]
    fn xon_xoff_in_assemblyscript() {
        let mut asc = Command::new("asc");
        asc.current_dir(root().join("sdk/assemblyscript")).args(["xon-xoff.ts", "--outFile"]);
        does_the_same(&made_by(&mut asc, "sdk/assemblyscript/xon-xoff.json"));
    }
}
