//! Compilers that are run.

use std::io;
use std::path::Path;
use std::process::{Command, Output};

use crate::exit::Exit;
use crate::failure::Failure;

/// Runs a program in a folder to its end; `install` says how one gets it.
pub(super) fn run(command: &mut Command, folder: &Path, install: &str) -> Result<Output, Failure> {
    if !folder.as_os_str().is_empty() {
        command.current_dir(folder);
    }
    let program = command.get_program().to_string_lossy().into_owned();
    command.output().map_err(|error| match error.kind() {
        io::ErrorKind::NotFound => {
            Failure::usage(format_args!("{program} is not installed, or not in PATH")).hint(install)
        }
        _ => Failure::usage(format_args!("{program} cannot be started: {error}")),
    })
}

/// The compiler's own words, and that the sources are to blame.
pub(super) fn does_not_compile(said: &str) -> Failure {
    let said = said.trim_end();
    Failure::new(Exit::Failed, format_args!("the sources do not compile\n{said}"))
}
