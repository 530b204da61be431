//! Breaks the code, one place at a time, and runs the tests against that, with
//! cargo-mutants: for the evening, it takes hours.

use std::path::PathBuf;
use std::process::{Command, ExitCode};
use std::{fs, io};

use crate::Error;
use crate::run::{self, cargo, status, succeed};
use crate::workspace::Workspace;

/// A part of the code, and the tests that must notice whatever is broken in it.
struct Part {
    name: &'static str,
    /// Files, as patterns.
    files: &'static [&'static str],
    /// Packages built without optimisation, as they are built again for each mutant.
    unoptimised: &'static [&'static str],
    /// Quick tests for all mutants, then others for those that survived.
    passes: Vec<Pass>,
}

struct Pass {
    /// Whose tests are run; none: those of the broken package.
    packages: &'static [&'static str],
    /// Which targets are built at all; none: all.
    targets: &'static [&'static str],
    /// Words for the tests themselves.
    words: &'static [&'static str],
}

fn parts() -> Vec<Part> {
    let trace = |words| Pass { packages: &[], targets: &["--lib"], words };
    let slow =
        &["--skip=property", "--skip=exchange", "--skip=limits", "--skip=diff", "--skip=generate"];
    vec![
        Part {
            name: "trace",
            files: &["conformance/trace/src/parse/*.rs"],
            unoptimised: &["softplug-trace"],
            passes: vec![trace(slow), trace(&[])],
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
            unoptimised: &["softplug-conformance"],
            passes: vec![Pass {
                packages: &[],
                targets: &["--lib", "--test=bites", "--test=natively"],
                words: &["--skip=partners"],
            }],
        },
        plugin(
            "xon-xoff",
            &["plugins/xon-xoff/src/**/*.rs"],
            &["softplug-xon-xoff"],
            &["xon_xoff"],
        ),
        // The tests of the procedure are those of its two plug-ins.
        plugin(
            "3964",
            &[
                "plugins/procedure-3964/src/**/*.rs",
                "plugins/r3964/src/**/*.rs",
                "plugins/r3964-simplified/src/**/*.rs",
            ],
            &["softplug-procedure-3964", "softplug-r3964", "softplug-r3964-simplified"],
            &["r3964"],
        ),
        plugin(
            "fanuc-rs232",
            &["plugins/fanuc-rs232/src/**/*.rs"],
            &["softplug-fanuc-rs232"],
            &["fanuc_rs232"],
        ),
        plugin(
            "heidenhain-fe",
            &["plugins/heidenhain-fe/src/**/*.rs"],
            &["softplug-heidenhain-fe"],
            &["heidenhain_fe"],
        ),
    ]
}

/// A plug-in: its whole corpus natively, in the test of that name, then its own tests.
fn plugin(
    name: &'static str,
    files: &'static [&'static str],
    packages: &'static [&'static str],
    words: &'static [&'static str],
) -> Part {
    let corpus = Pass { packages: &["softplug-conformance"], targets: &["--test=natively"], words };
    let own = Pass { packages, targets: &[], words: &[] };
    Part { name, files, unoptimised: packages, passes: vec![corpus, own] }
}

/// Why nothing is broken.
#[derive(Debug, thiserror::Error)]
pub(crate) enum CodeMutantsError {
    #[error("there is no part \"{part}\" to break; there are {known}")]
    UnknownPart { part: String, known: String },
    #[error("the folder {path} for the results cannot be made: {source}")]
    Folder { path: PathBuf, source: io::Error },
}

/// Runs all parts, or the one with this name. Results stand in `target/code-mutants`.
pub(crate) fn run(workspace: &Workspace, part: Option<&str>) -> Result<ExitCode, Error> {
    let mut parts = parts();
    if let Some(part) = part {
        let known = parts.iter().map(|part| part.name).collect::<Vec<_>>().join(", ");
        parts.retain(|known| known.name == part);
        if parts.is_empty() {
            return Err(CodeMutantsError::UnknownPart { part: part.to_owned(), known }.into());
        }
    }
    if run::find("cargo-mutants").is_none() {
        eprintln!("cargo-mutants is missing: installing it");
        succeed(cargo().args(["install", "--locked", "cargo-mutants"]))?;
    }
    let mut all_noticed = true;
    for part in parts {
        let results = workspace.target().join("code-mutants").join(part.name);
        let folder = |source| CodeMutantsError::Folder { path: results.clone(), source };
        fs::create_dir_all(&results).map_err(folder)?;
        let mut noticed = true;
        for number in 0..part.passes.len() {
            let mut command = command(&part, number);
            command.current_dir(workspace.root()).env("CARGO_MUTANTS_OUTPUT", &results);
            noticed = status(&mut command)?.success();
        }
        all_noticed &= noticed;
    }
    Ok(if all_noticed { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn command(part: &Part, number: usize) -> Command {
    let pass = &part.passes[number];
    let mut command = cargo();
    // Without the engines that are features: they take longer to build than all else.
    command.args(["mutants", "--jobs=1", "--no-shuffle", "--no-default-features"]);
    command.args(part.files.iter().map(|file| format!("--file={file}")));
    // What makes a plug-in wrong on purpose is in no module.
    command.arg("--exclude=plugins/*/src/mutants.rs");
    // A mutant that runs for ever must end.
    if pass.packages.is_empty() {
        command.arg("--minimum-test-timeout=60");
    } else {
        // The whole code is otherwise first run with the tests of the broken packages, which
        // have no such targets.
        command.args(["--baseline=skip", "--timeout=60", "--build-timeout=600"]);
        command.args(pass.packages.iter().map(|package| format!("--test-package={package}")));
    }
    command.args(pass.targets.iter().map(|target| format!("--cargo-arg={target}")));
    command.args(
        part.unoptimised.iter().map(|package| {
            format!("--cargo-arg=--config=profile.dev.package.{package}.opt-level=0")
        }),
    );
    if number > 0 {
        command.arg("--iterate");
    }
    command.args(["--", "--"]).args(pass.words);
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pass_names_files_targets_and_tests() {
        let words = |pass| {
            let command = command(&parts()[0], pass);
            let words = command.get_args().map(|word| word.to_str().unwrap().to_owned());
            words.collect::<Vec<_>>()
        };
        let first = words(0);
        assert!(first.starts_with(&["mutants".into(), "--jobs=1".into()]), "{first:?}");
        for word in [
            "--file=conformance/trace/src/parse/*.rs",
            "--minimum-test-timeout=60",
            "--cargo-arg=--lib",
            "--skip=property",
        ] {
            assert!(first.iter().any(|known| known == word), "{word} is not in {first:?}");
        }
        let second = words(1);
        assert!(second.iter().any(|word| word == "--iterate"), "{second:?}");
        assert!(!second.iter().any(|word| word == "--skip=property"), "{second:?}");
    }

    #[test]
    fn every_file_of_a_part_is_there() {
        let workspace = Workspace::read().unwrap();
        for file in parts().iter().flat_map(|part| part.files) {
            let fixed = file.split('*').next().unwrap();
            assert!(workspace.root().join(fixed).exists(), "{file}");
        }
    }

    #[test]
    fn an_unknown_part_is_named() {
        let error = run(&Workspace::read().unwrap(), Some("all")).err().unwrap();
        assert_eq!(
            error.to_string(),
            "there is no part \"all\" to break; there are trace, suite, xon-xoff, 3964, \
             fanuc-rs232, heidenhain-fe"
        );
    }
}
