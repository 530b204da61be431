//! The command for Windows, and a computer of wine's to run it on.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::Error;
use crate::run::{self, cargo, succeed};
use crate::toolchain::ensure_target;
use crate::workspace::Workspace;

/// Runs programs for Windows; tests that need it stand in modules of its name.
pub(crate) const WINE: &str = "wine";
const TARGET: &str = "x86_64-pc-windows-gnu";
const LINKER: &str = "x86_64-w64-mingw32-gcc";

/// The folder for wine's computer cannot be made.
#[derive(Debug, thiserror::Error)]
#[error("{}: {cause}", path.display())]
pub(crate) struct WindowsError {
    path: PathBuf,
    cause: io::Error,
}

/// Why it cannot be built or run, if it cannot.
pub(crate) fn obstacle() -> Option<String> {
    for (program, package) in [(WINE, "wine64 and wine"), (LINKER, "gcc-mingw-w64-x86-64")] {
        if run::find(program).is_none() {
            return Some(format!("`{program}` is missing (Debian packages {package})"));
        }
    }
    ensure_target(TARGET).err().map(|error| error.to_string())
}

/// Builds the command; where it is.
pub(crate) fn build(workspace: &Workspace) -> Result<PathBuf, Error> {
    ensure_target(TARGET)?;
    succeed(
        cargo()
            .current_dir(workspace.root())
            // Flags from the environment are meant for this computer.
            .env_remove("RUSTFLAGS")
            .env_remove("CARGO_ENCODED_RUSTFLAGS")
            .args(["build", "--package", "softplug", "--target", TARGET]),
    )?;
    let folder = workspace.target().join(TARGET).join("debug");
    add_library(&folder)?;
    Ok(folder.join("softplug.exe"))
}

/// Puts a library beside the command that Debian's wine does not have.
fn add_library(folder: &Path) -> Result<(), Error> {
    let source = folder.join("bcryptprimitives.c");
    fs::write(&source, include_str!("bcryptprimitives.c"))
        .map_err(|cause| WindowsError { path: source.clone(), cause })?;
    succeed(
        Command::new(LINKER)
            .current_dir(folder)
            .args(["-shared", "-O1", "-o", "bcryptprimitives.dll", "bcryptprimitives.c"])
            .arg("-ladvapi32"),
    )?;
    Ok(())
}

/// A folder of wine's that is ready: what it makes at first takes a while, and tests share it.
pub(crate) fn prefix(workspace: &Workspace) -> Result<PathBuf, Error> {
    let folder = workspace.target().join("wine");
    fs::create_dir_all(&folder).map_err(|cause| WindowsError { path: folder.clone(), cause })?;
    succeed(wine(&folder, "wineboot").arg("--init"))?;
    Ok(folder)
}

/// Ends what wine keeps running in the folder, if it has not ended by itself.
pub(crate) fn end(folder: &Path) {
    let _ = wine(folder, "wineserver").arg("--kill").status();
}

fn wine(folder: &Path, program: &str) -> Command {
    let mut command = Command::new(program);
    command
        .env("WINEPREFIX", folder)
        .env("WINEDEBUG", "-all")
        // Nobody is there to be asked for .NET and a browser.
        .env("WINEDLLOVERRIDES", "mscoree,mshtml=")
        .env_remove("DISPLAY");
    command
}
