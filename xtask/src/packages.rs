//! Looks at what would be published: packs every crate and, where there is time,
//! builds each from its package and holds its public API against an earlier one.

use std::process::{Command, ExitCode};

use crate::Error;
use crate::run::{self, cargo, status, succeed};
use crate::workspace::Workspace;

/// Libraries whose API others rely on.
const LIBRARIES: &[&str] = &[
    "softplug-abi",
    "softplug-link",
    "softplug-plugin",
    "softplug-host",
    "softplug-machines",
    "softplug-models",
    "softplug-trace",
    "softplug-trial",
    "softplug-report",
    "softplug-explore",
    "softplug-conformance",
    "softplug-catalogue",
    "softplug-cell",
    "softplug-plan",
    "softplug-shop",
    "softplug-unit-bus",
    "softplug-unit-protocol",
    "softplug-unit-slots",
    "softplug-unit-uplink",
    "softplug-unit",
    "softplug-live",
];

/// Packs all crates. If `long`, builds them from their packages and compares the
/// libraries' API with `since`, a commit or tag; where none is given, with the
/// latest release.
pub(crate) fn run(
    workspace: &Workspace,
    long: bool,
    since: Option<&str>,
) -> Result<ExitCode, Error> {
    succeed(pack(long).current_dir(workspace.root()))?;
    if !long {
        return Ok(ExitCode::SUCCESS);
    }
    let Some(since) = since.map(str::to_owned).or_else(|| latest_release(workspace)) else {
        println!("no release is tagged: give --since COMMIT to compare the API with");
        return Ok(ExitCode::SUCCESS);
    };
    if run::find("cargo-semver-checks").is_none() {
        eprintln!("cargo-semver-checks is missing: installing it");
        succeed(cargo().args(["install", "--locked", "cargo-semver-checks"]))?;
    }
    let is_compatible = status(compare(&since).current_dir(workspace.root()))?.success();
    Ok(if is_compatible { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn pack(verifies: bool) -> Command {
    let mut command = cargo();
    command.args(["package", "--workspace", "--exclude", "xtask", "--allow-dirty"]);
    if !verifies {
        command.arg("--no-verify");
    }
    command
}

fn compare(since: &str) -> Command {
    let mut command = cargo();
    // Otherwise a feature named `bench` is left out.
    command.args(["semver-checks", "--all-features", "--baseline-rev", since]);
    for library in LIBRARIES {
        command.args(["--package", library]);
    }
    command
}

fn latest_release(workspace: &Workspace) -> Option<String> {
    let mut git = Command::new("git");
    git.current_dir(workspace.root()).args(["describe", "--tags", "--abbrev=0", "--match", "v*"]);
    let output = git.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(command: &Command) -> Vec<&str> {
        command.get_args().map(|word| word.to_str().unwrap()).collect()
    }

    #[test]
    fn packages_are_built_only_where_there_is_time() {
        assert!(words(&pack(false)).contains(&"--no-verify"));
        assert!(!words(&pack(true)).contains(&"--no-verify"));
    }

    #[test]
    fn every_library_is_compared() {
        let command = compare("v0.1.0");
        let words = words(&command);
        assert!(words.starts_with(&[
            "semver-checks",
            "--all-features",
            "--baseline-rev",
            "v0.1.0"
        ]));
        assert!(LIBRARIES.iter().all(|library| words.contains(library)), "{words:?}");
    }
}
