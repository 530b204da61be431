//! The plug-ins that can be made wrong.

use crate::common::root;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

/// Their folder: `SOFTPLUG_MUTANTS`, else built now.
pub(crate) fn modules() -> PathBuf {
    static BUILT: OnceLock<PathBuf> = OnceLock::new();
    match std::env::var_os("SOFTPLUG_MUTANTS") {
        Some(folder) => PathBuf::from(folder),
        None => BUILT.get_or_init(build).clone(),
    }
}

/// Cargo builds only what has changed, so that never an old module is judged.
fn build() -> PathBuf {
    let target =
        std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    let mut command = Command::new(env!("CARGO"));
    command.current_dir(root()).args(["xtask", "mutants", "--build"]);
    let built = command.status().expect("cargo can be run");
    assert!(built.success(), "the mutants cannot be built: the reason stands above");
    target.join("mutants")
}
