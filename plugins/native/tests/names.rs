//! Every reference plug-in is found under the name that its manifest gives.

use softplug_abi::manifest::Manifest;
use softplug_abi::{Event, Instance, Micros, Refusal};
use softplug_native::NativePlugin;

#[test]
fn names_are_those_of_the_manifests() {
    for plugin in NativePlugin::ALL {
        let manifest = Manifest::parse(plugin.manifest().as_bytes()).unwrap();
        assert_eq!(manifest.name, plugin.name());
        assert_eq!(NativePlugin::from_name(&manifest.name), Some(*plugin));
        assert_eq!(manifest.version, env!("CARGO_PKG_VERSION"));
        // It saves in a format that it takes.
        let saves = manifest.state.saves.expect("a reference plug-in can be swapped");
        assert!(manifest.state.accepts.contains(&saves));
    }
    assert_eq!(NativePlugin::from_name("xon"), None);
}

#[test]
fn instances_take_the_settings_of_their_manifests() {
    for plugin in NativePlugin::ALL {
        let manifest = Manifest::parse(plugin.manifest().as_bytes()).unwrap();
        let settings = manifest.resolve_settings([]).unwrap();
        let mut instance = plugin.instantiate();
        let capacity = instance.input_capacity();
        settings.pieces(capacity, |event| instance.step(event, Micros::ZERO).map(drop)).unwrap();
        let fault = plugin.instantiate().step(&Event::Save, Micros::ZERO).map(drop).unwrap_err();
        assert_eq!(fault.refusal, Refusal::MalformedEvent, "not open");
    }
}
