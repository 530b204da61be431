//! The plug-ins that can be made wrong.

use crate::common::root;
use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

const PLUGINS: [&str; 5] =
    ["fanuc-rs232", "heidenhain-fe", "r3964", "r3964-simplified", "xon-xoff"];

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
    // Flags from the environment would replace those that bound the memory.
    command
        .current_dir(root())
        .env_remove("RUSTFLAGS")
        .env_remove("CARGO_ENCODED_RUSTFLAGS")
        .args(["build", "--quiet", "--profile", "mutant", "--target", "wasm32v1-none", "--lib"])
        .arg("--target-dir")
        .arg(&target);
    for name in PLUGINS {
        let package = format!("softplug-{name}");
        command.args(["-p", &package, "--features", &format!("{package}/mutants")]);
    }
    let built = command.status().expect("cargo can be run");
    assert!(built.success(), "the mutants cannot be built; is wasm32v1-none installed?");
    let built = target.join("wasm32v1-none/mutant");
    let folder = target.join("mutants");
    std::fs::create_dir_all(&folder).expect("the folder can be made");
    for name in PLUGINS {
        let from = built.join(format!("{}.wasm", name.replace('-', "_")));
        // Another test may read the old one at the same time.
        let part = folder.join(format!("{name}.wasm.{}.part", std::process::id()));
        let copied = std::fs::copy(&from, &part)
            .and_then(|_| std::fs::rename(&part, folder.join(format!("{name}.wasm"))));
        copied.unwrap_or_else(|error| panic!("{}: {error}", from.display()));
    }
    folder
}
