//! Breaks the code at random places and runs the tests against that, with
//! cargo-mutants: for the evening, it takes hours.

use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::{fs, io};

use crate::run::{self, cargo, status, succeed};
use crate::workspace::Workspace;
use crate::{Error, plugins};

/// A part of the code, and the tests that must notice whatever is broken in it.
struct Part {
    name: &'static str,
    /// Files, as patterns.
    files: &'static [&'static str],
    /// Packages whose tests are run.
    tests: &'static [&'static str],
    /// Which of these packages' tests; none: all.
    only: &'static [&'static str],
}

const PARTS: &[Part] = &[
    Part {
        name: "trace",
        files: &["conformance/trace/src/parse/*.rs"],
        tests: &["softplug-trace"],
        only: &[],
    },
    Part {
        name: "suite",
        files: &[
            "conformance/suite/src/replay.rs",
            "conformance/suite/src/compare.rs",
            "conformance/suite/src/permute.rs",
            "conformance/suite/src/cut.rs",
            "conformance/suite/src/course.rs",
            "conformance/suite/src/deed.rs",
        ],
        tests: &["softplug-conformance"],
        only: &["--lib", "--test", "bites", "--test", "profiles", "--test", "controls"],
    },
    Part {
        name: "plugins",
        files: &["plugins/*/src/**/*.rs"],
        tests: &["softplug-conformance"],
        only: &["--test", "profiles"],
    },
];

/// Why nothing is broken.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CodeMutantsError {
    #[error("there is no part \"{0}\" to break; there are trace, suite and plugins")]
    UnknownPart(String),
    #[error("the folder {path} for the results cannot be made: {source}")]
    Folder { path: PathBuf, source: io::Error },
}

/// Runs all parts, or the one with this name. Results stand in `target/code-mutants`.
pub(crate) fn run(workspace: &Workspace, part: Option<&str>) -> Result<ExitCode, Error> {
    let parts: Vec<&Part> =
        PARTS.iter().filter(|known| part.is_none_or(|name| known.name == name)).collect();
    if parts.is_empty() {
        return Err(CodeMutantsError::UnknownPart(part.unwrap_or_default().to_owned()).into());
    }
    if run::find("cargo-mutants").is_none() {
        eprintln!("cargo-mutants is missing: installing it");
        succeed(cargo().args(["install", "--locked", "cargo-mutants"]))?;
    }
    // What the tests in the sandbox are held against stays whole.
    plugins::build(workspace, plugins::Report::Table)?;
    let mut all_noticed = true;
    for part in parts {
        let results = workspace.target().join("code-mutants").join(part.name);
        let folder = |source| CodeMutantsError::Folder { path: results.clone(), source };
        fs::create_dir_all(&results).map_err(folder)?;
        let mut command = command(part);
        command
            .current_dir(workspace.root())
            .arg("--output")
            .arg(&results)
            .env("SOFTPLUG_PLUGINS", workspace.plugin_folder());
        if !part.only.is_empty() {
            command.arg("--").args(part.only);
        }
        all_noticed &= status(&mut command)?.success();
    }
    Ok(if all_noticed { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn command(part: &Part) -> Command {
    let mut command = cargo();
    // A mutant that runs for ever must end; the tests themselves take half a minute.
    command.args(["mutants", "--jobs", "1", "--no-shuffle", "--minimum-test-timeout", "60"]);
    for file in part.files {
        command.args(["--file", file]);
    }
    for package in part.tests {
        command.args(["--test-package", package]);
    }
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_and_tests_of_a_part_are_named() {
        let trace = command(&PARTS[0]);
        let words: Vec<_> = trace.get_args().map(|word| word.to_str().unwrap()).collect();
        assert!(words.starts_with(&["mutants", "--jobs", "1"]), "{words:?}");
        assert!(words.ends_with(&[
            "--file",
            "conformance/trace/src/parse/*.rs",
            "--test-package",
            "softplug-trace"
        ]));
    }

    #[test]
    fn every_file_of_a_part_is_there() {
        let workspace = Workspace::read().unwrap();
        for file in PARTS.iter().flat_map(|part| part.files) {
            let fixed = file.split('*').next().unwrap();
            assert!(workspace.root().join(fixed).exists(), "{file}");
        }
    }

    #[test]
    fn an_unknown_part_is_named() {
        let error = run(&Workspace::read().unwrap(), Some("all")).err().unwrap();
        assert_eq!(
            error.to_string(),
            "there is no part \"all\" to break; there are trace, suite and plugins"
        );
    }
}
