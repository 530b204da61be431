//! Builds the plug-ins with their mutants and has the suite hunt these.

mod change;
mod copy;
pub(crate) mod module;
mod rewrite;

pub(crate) use copy::CopyError;

use std::process::{Command, ExitCode};

use crate::run::{cargo, status};
use crate::workspace::Workspace;
use crate::{Error, plugins};

const PACKAGE: &str = "softplug-conformance";
const TEST: &str = "integration";

/// What becomes of the kill matrix.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Matrix {
    /// It is written.
    Write,
    /// It must be the one that is there.
    Check,
}

/// Hunts all mutants, or those whose id contains the filter; the matrix is
/// looked at only where all are hunted.
pub(crate) fn run(
    workspace: &Workspace,
    matrix: Matrix,
    filter: Option<&str>,
) -> Result<ExitCode, Error> {
    build(workspace)?;
    let mut command = command(matrix, filter);
    command.current_dir(workspace.root()).env("SOFTPLUG_MUTANTS", workspace.mutant_folder());
    let status = status(&mut command)?;
    Ok(if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Explores every mutant, or those whose id contains the filter.
pub(crate) fn explore(
    workspace: &Workspace,
    long: bool,
    filter: Option<&str>,
) -> Result<ExitCode, Error> {
    build(workspace)?;
    let mut command = cargo();
    command.current_dir(workspace.root()).args(["run", "--release", "--quiet"]);
    command.args(["-p", PACKAGE, "--example", "explore_mutants", "--"]);
    command.arg(workspace.mutant_folder()).arg(if long { "2" } else { "1" }).arg("60");
    command.arg(filter.unwrap_or_default());
    let status = status(&mut command)?;
    Ok(if status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Builds every plug-in with all of its mutants into `target/mutants/NAME.wasm`.
pub(crate) fn build(workspace: &Workspace) -> Result<(), Error> {
    let sources = copy::make(workspace)?;
    plugins::build_mutants(workspace, &sources)
}

fn command(matrix: Matrix, filter: Option<&str>) -> Command {
    let mut command = cargo();
    command.args(["test", "--quiet", "-p", PACKAGE, "--test", TEST, "--"]);
    match matrix {
        // The other tests would read what is being written.
        Matrix::Write => command.arg("mutants::every_mutant").env("SOFTPLUG_MATRIX", "write"),
        Matrix::Check => command.arg("mutants::").env_remove("SOFTPLUG_MATRIX"),
    };
    match filter {
        Some(filter) => command.env("SOFTPLUG_MUTANTS_FILTER", filter),
        None => command.env_remove("SOFTPLUG_MUTANTS_FILTER"),
    };
    command.arg("--nocapture");
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn writing_runs_one_test_and_checking_all_of_them() {
        let words = |command: &Command| {
            command.get_args().map(|word| word.to_str().unwrap().to_owned()).collect::<Vec<_>>()
        };
        let write = command(Matrix::Write, Some("obey"));
        assert!(words(&write).ends_with(&["mutants::every_mutant".into(), "--nocapture".into()]));
        let variable = |name: &str| {
            let found = write.get_envs().find(|(key, _)| *key == name);
            found.and_then(|(_, value)| value).map(|value| value.to_str().unwrap().to_owned())
        };
        assert_eq!(variable("SOFTPLUG_MATRIX").as_deref(), Some("write"));
        assert_eq!(variable("SOFTPLUG_MUTANTS_FILTER").as_deref(), Some("obey"));
        let check = command(Matrix::Check, None);
        assert!(words(&check).ends_with(&["--".into(), "mutants::".into(), "--nocapture".into()]));
        assert!(check.get_envs().all(|(_, value)| value.is_none()));
    }
}
