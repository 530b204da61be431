//! Real plug-ins hold no mutants.

use softplug_conformance::mutants::{PatchError, wake};

#[test]
fn a_real_module_holds_no_mutants() {
    for plugin in ["fanuc-rs232", "heidenhain-fe", "r3964", "r3964-simplified", "xon-xoff"] {
        // The module that the others of these tests judge.
        let module = crate::common::module(plugin);
        assert_eq!(wake(&module, "a.b/c"), Err(PatchError::NoMarker), "{plugin}");
    }
}
