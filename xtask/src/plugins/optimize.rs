//! Binaryen's `wasm-opt`, where it is installed: modules some 10 % smaller.

use std::path::Path;
use std::process::Command;

use crate::run::{self, RunError};

/// The program, of Debian's package `binaryen`.
const PROGRAM: &str = "wasm-opt";

/// Whether modules can be made as small as they are released.
pub(super) fn is_there() -> bool {
    run::find(PROGRAM).is_some()
}

/// Writes the module at `from`, made smaller, to `to`; its names stay.
pub(super) fn optimize(from: &Path, to: &Path) -> Result<(), RunError> {
    let mut command = Command::new(PROGRAM);
    // The features of `wasm32v1-none`, and no others.
    command.args(["-Oz", "--converge", "-g", "--mvp-features", "--enable-mutable-globals"]);
    // The lowest addresses are the far end of the stack: no pointer is near them, so
    // that adding to one never wraps.
    command.arg("--low-memory-unused");
    run::succeed(command.arg(from).arg("-o").arg(to))
}
