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
    files: Vec<String>,
    /// Packages built without optimisation, as they are built again for each mutant.
    unoptimised: Vec<String>,
    /// Quick tests for all mutants, then others for those that survived.
    passes: Vec<Pass>,
}

struct Pass {
    /// Whose tests are run; none: those of the broken package.
    packages: Vec<String>,
    /// Which targets are built at all; none: all.
    targets: &'static [&'static str],
    /// Words for the tests themselves.
    words: Vec<String>,
}

fn parts() -> Vec<Part> {
    let trace = |words| Pass { packages: vec![], targets: &["--lib"], words };
    let slow = ["property", "exchange", "limits", "diff", "generate"];
    vec![
        Part {
            name: "trace",
            files: ["parse/*", "hidden"]
                .map(|module| format!("conformance/trace/src/{module}.rs"))
                .into(),
            unoptimised: vec!["softplug-trace".to_owned()],
            passes: vec![trace(slow.map(|word| format!("--skip={word}")).into()), trace(vec![])],
        },
        Part {
            name: "suite",
            files: [
                "given/timeline",
                "run/back_to_back",
                "run/cut",
                "run/seen",
                "run/permute",
                "run/replay/mod",
                "judge/compare",
                "judge/demand",
            ]
            .map(|module| format!("conformance/suite/src/{module}.rs"))
            .into(),
            unoptimised: vec!["softplug-conformance".to_owned()],
            passes: vec![Pass {
                packages: vec![],
                targets: &["--lib", "--test=bites", "--test=natively"],
                words: vec![],
            }],
        },
        plugin("xon-xoff", &["xon-xoff"]),
        // The tests of the procedure are those of its two plug-ins.
        plugin("r3964", &["procedure-3964", "r3964", "r3964-simplified"]),
        plugin("fanuc-rs232", &["fanuc-rs232"]),
        plugin("heidenhain-fe", &["heidenhain-fe"]),
        plugin("pulse-lathe", &["pulse-lathe"]),
        plugin("xmodem", &["xmodem"]),
        plugin("kermit", &["kermit"]),
    ]
}

/// A plug-in of these crates: its whole corpus natively, in the tests with its name,
/// then its own tests.
fn plugin(name: &'static str, crates: &[&str]) -> Part {
    let files = crates.iter().map(|name| format!("plugins/{name}/src/**/*.rs")).collect();
    let packages: Vec<_> = crates.iter().map(|name| format!("softplug-{name}")).collect();
    let corpus = Pass {
        packages: vec!["softplug-conformance".to_owned()],
        targets: &["--test=natively"],
        words: vec![name.replace('-', "_")],
    };
    let own = Pass { packages: packages.clone(), targets: &[], words: vec![] };
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
    command.args(["--", "--"]).args(&pass.words);
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The words of a part's pass.
    fn words(part: &str, pass: usize) -> Vec<String> {
        let part = parts().into_iter().find(|known| known.name == part).unwrap();
        let command = command(&part, pass);
        command.get_args().map(|word| word.to_str().unwrap().to_owned()).collect()
    }

    #[track_caller]
    fn assert_has(words: &[String], expected: &[&str]) {
        for word in expected {
            assert!(words.iter().any(|known| known == word), "{word} is not in {words:?}");
        }
    }

    #[test]
    fn a_pass_names_files_targets_and_tests() {
        let first = words("trace", 0);
        assert!(first.starts_with(&["mutants".into(), "--jobs=1".into()]), "{first:?}");
        assert_has(
            &first,
            &[
                "--file=conformance/trace/src/parse/*.rs",
                "--minimum-test-timeout=60",
                "--cargo-arg=--lib",
                "--skip=property",
            ],
        );
        let second = words("trace", 1);
        assert_has(&second, &["--iterate"]);
        assert!(!second.iter().any(|word| word == "--skip=property"), "{second:?}");
    }

    #[test]
    fn a_plug_in_is_tried_by_its_corpus_then_by_its_own_tests() {
        let corpus = words("r3964", 0);
        assert_has(
            &corpus,
            &[
                "--file=plugins/procedure-3964/src/**/*.rs",
                "--file=plugins/r3964-simplified/src/**/*.rs",
                "--test-package=softplug-conformance",
                "--cargo-arg=--test=natively",
                "--cargo-arg=--config=profile.dev.package.softplug-r3964.opt-level=0",
            ],
        );
        assert_eq!(corpus.last().unwrap(), "r3964");
        assert_eq!(words("fanuc-rs232", 0).last().unwrap(), "fanuc_rs232");
        let own = words("r3964", 1);
        assert_has(&own, &["--iterate", "--test-package=softplug-procedure-3964"]);
        assert_eq!(own.last().unwrap(), "--", "all of them: {own:?}");
    }

    #[test]
    fn every_file_of_a_part_is_there() {
        let workspace = Workspace::read().unwrap();
        for file in parts().iter().flat_map(|part| &part.files) {
            let fixed = file.split('*').next().unwrap();
            assert!(workspace.root().join(fixed).exists(), "{file}");
        }
    }

    #[test]
    fn an_unknown_part_is_named() {
        let error = run(&Workspace::read().unwrap(), Some("all")).err().unwrap();
        assert_eq!(
            error.to_string(),
            "there is no part \"all\" to break; there are trace, suite, xon-xoff, r3964, \
             fanuc-rs232, heidenhain-fe, pulse-lathe, xmodem, kermit"
        );
    }
}
