//! The manifest's settings, presets and refusals.

use r3964::R3964;
use softplug_plugin::bench::Bench;

#[test]
fn presets_resolve() {
    for preset in [
        "3964",
        "cp440",
        "sinumerik",
        "buderus",
        "vipa-cp240",
        "vipa-cp040",
        "euchner",
        "ifm",
        "wago",
    ] {
        Bench::<R3964>::new().set("preset", preset).open();
    }
}
