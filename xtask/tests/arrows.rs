//! The arrows between the workspace's crates: downwards only, and only those
//! listed here.

use std::collections::{BTreeMap, BTreeSet};

use cargo_metadata::{DependencyKind, MetadataCommand};

/// Each crate with the crates of this workspace that it may be built with.
/// Tests may use more.
const ARROWS: &[(&str, &[&str])] = &[
    ("softplug-abi", &[]),
    ("softplug-build", &[]),
    ("softplug-link", &["softplug-abi"]),
    ("softplug-plugin-derive", &[]),
    ("softplug-plugin", &["softplug-abi", "softplug-link", "softplug-plugin-derive"]),
    ("softplug-interpreter", &["softplug-abi"]),
    ("softplug-host", &["softplug-abi", "softplug-interpreter"]),
    ("softplug-xon-xoff", &["softplug-plugin"]),
    ("softplug-procedure-3964", &["softplug-abi", "softplug-plugin"]),
    ("softplug-r3964", &["softplug-plugin", "softplug-procedure-3964"]),
    ("softplug-r3964-simplified", &["softplug-plugin", "softplug-procedure-3964"]),
    ("softplug-fanuc-rs232", &["softplug-plugin"]),
    ("softplug-heidenhain-fe", &["softplug-plugin"]),
    ("softplug-pulse-lathe", &["softplug-plugin"]),
    ("softplug-xmodem", &["softplug-plugin"]),
    ("softplug-kermit", &["softplug-plugin"]),
    (
        "softplug-native",
        &[
            "softplug-abi",
            "softplug-fanuc-rs232",
            "softplug-heidenhain-fe",
            "softplug-kermit",
            "softplug-plugin",
            "softplug-pulse-lathe",
            "softplug-r3964",
            "softplug-r3964-simplified",
            "softplug-xmodem",
            "softplug-xon-xoff",
        ],
    ),
    ("softplug-fixtures", &[]),
    ("softplug-machines", &["softplug-abi"]),
    ("softplug-models", &["softplug-abi", "softplug-link"]),
    ("softplug-explore", &["softplug-abi", "softplug-host", "softplug-link", "softplug-models"]),
    ("softplug-mutant", &[]),
    ("softplug-trace", &["softplug-abi"]),
    ("softplug-trial", &["softplug-abi", "softplug-link", "softplug-machines"]),
    (
        "softplug-conformance",
        &[
            "softplug-abi",
            "softplug-explore",
            "softplug-fixtures",
            "softplug-host",
            "softplug-link",
            "softplug-machines",
            "softplug-models",
            "softplug-report",
            "softplug-trace",
            "softplug-trial",
        ],
    ),
    ("softplug-report", &[]),
    ("softplug-playground", &["softplug-conformance", "softplug-host", "softplug-trace"]),
    ("softplug-catalogue", &[]),
    ("softplug-cell", &[]),
    ("softplug-plan", &["softplug-unit-bus"]),
    (
        "softplug-live",
        &[
            "softplug-abi",
            "softplug-link",
            "softplug-machines",
            "softplug-unit-bus",
            "softplug-unit-protocol",
            "softplug-unit-uplink",
        ],
    ),
    (
        "softplug-shop",
        &[
            "softplug-abi",
            "softplug-link",
            "softplug-machines",
            "softplug-plan",
            "softplug-trial",
            "softplug-unit-bus",
        ],
    ),
    (
        "softplug-service",
        &[
            "softplug-abi",
            "softplug-catalogue",
            "softplug-cell",
            "softplug-live",
            "softplug-host",
            "softplug-link",
            "softplug-machines",
            "softplug-trace",
            "softplug-trial",
        ],
    ),
    (
        "softplug",
        &[
            "softplug-abi",
            "softplug-build",
            "softplug-catalogue",
            "softplug-cell",
            "softplug-conformance",
            "softplug-explore",
            "softplug-fixtures",
            "softplug-live",
            "softplug-host",
            "softplug-link",
            "softplug-machines",
            "softplug-models",
            "softplug-native",
            "softplug-plan",
            "softplug-report",
            "softplug-service",
            "softplug-shop",
            "softplug-trace",
            "softplug-trial",
            "softplug-unit",
            "softplug-unit-protocol",
            "softplug-unit-slots",
        ],
    ),
    ("softplug-emulated", &[]),
    (
        "softplug-unit-firmware",
        &[
            "softplug-abi",
            "softplug-interpreter",
            "softplug-link",
            "softplug-unit-protocol",
            "softplug-unit-slots",
        ],
    ),
    ("softplug-unit-bus", &[]),
    ("softplug-unit-protocol", &["softplug-abi"]),
    ("softplug-unit-slots", &[]),
    ("softplug-unit-uplink", &["softplug-abi", "softplug-unit-protocol"]),
    (
        "softplug-unit",
        &[
            "softplug-abi",
            "softplug-live",
            "softplug-host",
            "softplug-link",
            "softplug-unit-protocol",
            "softplug-unit-slots",
            "softplug-unit-uplink",
        ],
    ),
    ("xtask", &["softplug-build"]),
];

#[test]
fn arrows_point_downwards() {
    let metadata = MetadataCommand::new().no_deps().exec().unwrap();
    let ours: BTreeSet<&str> =
        metadata.packages.iter().map(|package| package.name.as_str()).collect();
    let allowed: BTreeMap<&str, &[&str]> = ARROWS.iter().copied().collect();
    let mut wrong = Vec::new();
    for package in &metadata.packages {
        let Some(allowed) = allowed.get(package.name.as_str()) else {
            wrong.push(format!("{} is not in the list of arrows", package.name));
            continue;
        };
        for dependency in &package.dependencies {
            let is_built_with = dependency.kind != DependencyKind::Development;
            let is_ours = ours.contains(dependency.name.as_str());
            if is_built_with && is_ours && !allowed.contains(&dependency.name.as_str()) {
                wrong.push(format!("{} must not use {}", package.name, dependency.name));
            }
        }
    }
    assert_eq!(wrong, Vec::<String>::new());
    assert_eq!(ours.len(), ARROWS.len(), "the list of arrows names a crate that is gone");
}
