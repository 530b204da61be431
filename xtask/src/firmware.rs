//! Builds the firmware of units without an operating system.

use std::path::PathBuf;

use crate::Error;
use crate::run::{cargo, succeed};
use crate::toolchain::{FIRMWARE_TARGET, ensure_target};
use crate::workspace::Workspace;

const PACKAGE: &str = "softplug-unit-firmware";
const PROFILE: &str = "firmware";
/// For the board that QEMU emulates.
const BINARY: &str = "softplug-unit-mps2";

/// Why it cannot be built, if it cannot.
pub(crate) fn obstacle() -> Option<String> {
    ensure_target(FIRMWARE_TARGET).err().map(|error| error.to_string())
}

/// Builds it; where it is.
pub(crate) fn build(workspace: &Workspace) -> Result<PathBuf, Error> {
    ensure_target(FIRMWARE_TARGET)?;
    succeed(
        cargo()
            .current_dir(workspace.root())
            // Flags from the environment are meant for this computer.
            .env_remove("RUSTFLAGS")
            .env_remove("CARGO_ENCODED_RUSTFLAGS")
            .args(["build", "--package", PACKAGE, "--bin", BINARY])
            .args(["--profile", PROFILE, "--target", FIRMWARE_TARGET]),
    )?;
    Ok(workspace.target().join(FIRMWARE_TARGET).join(PROFILE).join(BINARY))
}
