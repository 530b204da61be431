//! The cache: what is kept is found again, and what is not ours is never used.

use crate::common::{Guest, echo};
use softplug_abi::{Event, Instance, Micros};
use softplug_host::{Host, HostOptions, Origin, Plugin};
use std::fs;
use std::path::{Path, PathBuf};

fn host(directory: &Path) -> Host {
    let cache = Some(directory.to_owned());
    Host::new(HostOptions { cache, instances: 8, ..HostOptions::default() }).unwrap()
}

fn files(directory: &Path) -> Vec<PathBuf> {
    let mut files: Vec<_> = fs::read_dir(directory).unwrap().map(|f| f.unwrap().path()).collect();
    files.sort();
    files
}

fn works(plugin: &Plugin) {
    let mut session = plugin.instantiate().unwrap();
    let output = session.step(&Event::Received(b"N"), Micros(1)).unwrap();
    assert_eq!(output.actions, b"\x01\0\x05\0\0\0\0\0N");
}

#[test]
fn code_is_kept_and_found_by_another_host() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("made/when/missing");
    let first = host(&path).load_bytes(&echo()).unwrap();
    assert_eq!(first.origin(), Origin::Compiled);
    assert_eq!(files(&path).len(), 1);
    let second = host(&path).load_bytes(&echo()).unwrap();
    assert_eq!(second.origin(), Origin::Cache);
    works(&first);
    works(&second);
    let other = host(&path).load_bytes(&Guest::default().wasm()).unwrap();
    assert_eq!(other.origin(), Origin::Compiled);
    assert_eq!(files(&path).len(), 2);
}

#[test]
fn a_trap_still_names_its_functions() {
    let directory = tempfile::tempdir().unwrap();
    let wasm = Guest::stepping("(call $culprit) (i32.const 0)")
        .extra("(func $culprit unreachable)")
        .wasm();
    for origin in [Origin::Compiled, Origin::Cache] {
        let plugin = host(directory.path()).load_bytes(&wasm).unwrap();
        assert_eq!(plugin.origin(), origin);
        let fault = plugin.instantiate().unwrap().step(&Event::Close, Micros(1)).unwrap_err();
        let softplug_host::SessionFault::Trapped { frames, .. } = fault else { panic!("{fault}") };
        assert_eq!(frames[0], "culprit");
    }
}

#[test]
fn a_damaged_file_is_rebuilt() {
    let directory = tempfile::tempdir().unwrap();
    host(directory.path()).load_bytes(&echo()).unwrap();
    let [file] = &files(directory.path())[..] else { panic!("one file") };
    let good = fs::read(file).unwrap();
    let flipped = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 0x40;
        bytes
    };
    let mut longer = good.clone();
    longer.push(0);
    let damages = [
        flipped(0),
        flipped(10),
        flipped(40),
        flipped(50),
        flipped(80),
        flipped(good.len() / 2),
        flipped(good.len() - 1),
        good[..good.len() - 1].to_vec(),
        good[..79].to_vec(),
        Vec::new(),
        b"#!/bin/sh\n".to_vec(),
        longer,
    ];
    for (at, damaged) in damages.iter().enumerate() {
        fs::write(file, damaged).unwrap();
        let plugin = host(directory.path()).load_bytes(&echo()).unwrap();
        assert_eq!(plugin.origin(), Origin::Compiled, "damage {at}");
        works(&plugin);
        assert_eq!(fs::read(file).unwrap().len(), good.len(), "damage {at} is rebuilt");
        let again = host(directory.path()).load_bytes(&echo()).unwrap();
        assert_eq!(again.origin(), Origin::Cache, "damage {at}");
    }
}

#[test]
fn code_of_another_module_under_this_name_is_rebuilt() {
    let directory = tempfile::tempdir().unwrap();
    host(directory.path()).load_bytes(&echo()).unwrap();
    let echo_file = files(directory.path()).remove(0);
    host(directory.path()).load_bytes(&Guest::default().wasm()).unwrap();
    let other_file = files(directory.path()).into_iter().find(|file| *file != echo_file).unwrap();
    fs::copy(&other_file, &echo_file).unwrap();
    let plugin = host(directory.path()).load_bytes(&echo()).unwrap();
    assert_eq!(plugin.origin(), Origin::Compiled);
    works(&plugin);
}

#[test]
fn a_cache_that_cannot_be_used_does_no_harm() {
    let directory = tempfile::tempdir().unwrap();
    let file = directory.path().join("file");
    fs::write(&file, b"in the way").unwrap();
    for _ in 0..2 {
        let plugin = host(&file).load_bytes(&echo()).unwrap();
        assert_eq!(plugin.origin(), Origin::Compiled);
        works(&plugin);
    }
    assert_eq!(fs::read(&file).unwrap(), b"in the way");
    // Something that is no file where the code would be.
    let cache = directory.path().join("cache");
    host(&cache).load_bytes(&echo()).unwrap();
    let code = files(&cache).remove(0);
    fs::remove_file(&code).unwrap();
    fs::create_dir(&code).unwrap();
    let plugin = host(&cache).load_bytes(&echo()).unwrap();
    assert_eq!(plugin.origin(), Origin::Compiled);
    works(&plugin);
    assert_eq!(files(&cache), [code], "nothing half-written is left");
}

#[cfg(unix)]
#[test]
fn what_others_could_have_written_is_not_trusted() {
    use std::os::unix::fs::PermissionsExt;
    let mode =
        |path: &Path, mode| fs::set_permissions(path, fs::Permissions::from_mode(mode)).unwrap();
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("cache");
    host(&path).load_bytes(&echo()).unwrap();
    assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o700);
    let file = files(&path).remove(0);
    assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);

    mode(&file, 0o622);
    assert_eq!(host(&path).load_bytes(&echo()).unwrap().origin(), Origin::Compiled);
    assert_eq!(host(&path).load_bytes(&echo()).unwrap().origin(), Origin::Cache, "made anew");

    mode(&path, 0o777);
    assert_eq!(host(&path).load_bytes(&echo()).unwrap().origin(), Origin::Compiled);
    mode(&path, 0o755);
    assert_eq!(host(&path).load_bytes(&echo()).unwrap().origin(), Origin::Cache);
}
