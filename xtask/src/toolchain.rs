//! The targets that are built for beside the machine's own, fetched where they are missing.

use std::path::Path;
use std::process::Command;

use crate::run::{self, RunError};

/// The target of every plug-in.
pub(crate) const WASM_TARGET: &str = "wasm32v1-none";
/// The target of the firmware of units without an operating system: a Cortex-M4 with its floats.
pub(crate) const FIRMWARE_TARGET: &str = "thumbv7em-none-eabihf";
/// The target of the playground's engine, which needs the standard library.
pub(crate) const PAGE_TARGET: &str = "wasm32-unknown-unknown";

/// The target is missing and cannot be added.
#[derive(Debug, thiserror::Error)]
pub(crate) enum ToolchainError {
    #[error(
        "the target {target} is missing in {sysroot}, and there is no rustup to add it: \
         install Rust with rustup, or add the target with your system's packages"
    )]
    NoRustup { target: &'static str, sysroot: String },
    #[error(
        "the target {target} could not be added to the toolchain {toolchain}: {cause}; \
         check the network, then run `rustup target add --toolchain {toolchain} {target}`"
    )]
    Add { target: &'static str, toolchain: String, cause: RunError },
    #[error("the toolchain in use cannot be found out: {0}")]
    Unknown(#[from] RunError),
}

/// Sees to it that the toolchain in use can build for a target.
///
/// It is added by name: neither a toolchain file nor rustup's automatic
/// installation, which may be off, has to do it.
pub(crate) fn ensure_target(target: &'static str) -> Result<(), ToolchainError> {
    let rustc = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
    let sysroot = run::output(Command::new(rustc).args(["--print", "sysroot"]))?;
    let sysroot = sysroot.trim();
    if Path::new(sysroot).join("lib/rustlib").join(target).join("lib").is_dir() {
        return Ok(());
    }
    if run::find("rustup").is_none() {
        return Err(ToolchainError::NoRustup { target, sysroot: sysroot.to_owned() });
    }
    let toolchain = toolchain_in_use()?;
    run::succeed(Command::new("rustup").args(["target", "add", "--toolchain", &toolchain, target]))
        .map_err(|cause| ToolchainError::Add { target, toolchain, cause })
}

/// rustup tells the programs that it starts which toolchain they belong to.
fn toolchain_in_use() -> Result<String, RunError> {
    if let Some(toolchain) = std::env::var("RUSTUP_TOOLCHAIN").ok().filter(|name| !name.is_empty())
    {
        return Ok(toolchain);
    }
    let shown = run::output(Command::new("rustup").args(["show", "active-toolchain"]))?;
    Ok(first_word(&shown))
}

/// `stable-x86_64-unknown-linux-gnu (default)` names its toolchain first.
fn first_word(shown: &str) -> String {
    shown.split_whitespace().next().unwrap_or("stable").to_owned()
}

#[cfg(test)]
mod tests {
    use super::first_word;

    #[test]
    fn the_toolchain_is_the_first_word() {
        let shown = "1.95.0-x86_64-unknown-linux-gnu (overridden by '/src/rust-toolchain.toml')\n";
        assert_eq!(first_word(shown), "1.95.0-x86_64-unknown-linux-gnu");
    }
}
