//! Real plug-ins hold no mutants.

use softplug_conformance::mutants::{PatchError, wake};
use softplug_native::NativePlugin;

#[test]
fn a_real_module_holds_no_mutants() {
    for plugin in NativePlugin::ALL.iter().map(|plugin| plugin.name()) {
        // The module that the others of these tests judge.
        let module = crate::common::module(plugin);
        assert_eq!(wake(&module, "a.b/c"), Err(PatchError::NoMarker), "{plugin}");
    }
}
