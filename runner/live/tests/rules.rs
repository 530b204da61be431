//! Rules of the ABI that a gateway keeps.

#![cfg(target_os = "linux")]

use std::fs;
use std::path::Path;
use std::thread;

use softplug_abi::LineParameters;
use softplug_link::Recorder;
use softplug_live::station::{Station, StationOptions};
use softplug_live::{Port, PortOptions, PortSpec};
use softplug_native::NativePlugin;

/// Compiling and instantiating never happen on a thread that serves links: a
/// station is given an instance that was made elsewhere, and the crate's
/// sources name nothing with which they could make one.
#[test]
fn budget_off_line() {
    let makers = ["softplug_host", "instantiate(", "load_bytes("];
    let mut files = vec![Path::new(env!("CARGO_MANIFEST_DIR")).join("src")];
    let mut seen = 0;
    while let Some(path) = files.pop() {
        if path.is_dir() {
            files.extend(fs::read_dir(path).unwrap().map(|entry| entry.unwrap().path()));
            continue;
        }
        let source = fs::read_to_string(&path).unwrap();
        seen += 1;
        for maker in makers {
            assert!(!source.contains(maker), "{} names {maker}", path.display());
        }
    }
    assert!(seen > 10, "the sources were not found");

    let instance = thread::spawn(|| NativePlugin::XonXoff.instantiate()).join().unwrap();
    let manifest = NativePlugin::XonXoff.manifest();
    let manifest = softplug_abi::manifest::Manifest::parse(manifest.as_bytes()).unwrap();
    let settings = manifest.resolve_settings([]).unwrap();
    let line = PortOptions::new(LineParameters::new(9_600));
    let port = Port::open(&PortSpec::Pty, &line).unwrap();
    let options = StationOptions { settings, ..StationOptions::default() };
    let mut station = Station::new(port, instance, options).unwrap();
    station.open(&mut Recorder::default()).unwrap();
}
