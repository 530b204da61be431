//! Runs the property tests with many random cases: the tests of the suite whose
//! name ends in `_fuzz`.

use std::process::{Command, ExitCode};

use crate::Error;
use crate::run::{cargo, overhear};
use crate::test::Counts;
use crate::workspace::Workspace;

const PACKAGE: &str = "softplug-conformance";
const CASES: u32 = 2_000;
const MANY_CASES: u32 = 100_000;

/// Nothing was found to run.
#[derive(Debug, thiserror::Error)]
pub(crate) enum FuzzError {
    #[error("{PACKAGE} has no test whose name ends in _fuzz")]
    NoTarget,
    #[error("no property test ran: is there one whose name contains the filter?")]
    None,
}

/// Fails where a test fails.
pub(crate) fn run(
    workspace: &Workspace,
    long: bool,
    seed: Option<u64>,
    filter: Option<&str>,
) -> Result<ExitCode, Error> {
    let targets = workspace.fuzz_tests(PACKAGE);
    if targets.is_empty() {
        return Err(FuzzError::NoTarget.into());
    }
    let cases = if long { MANY_CASES } else { CASES };
    let heard = overhear(command(&targets, cases, seed, filter).current_dir(workspace.root()))?;
    let counts = Counts::read(&heard.stdout) + Counts::read(&heard.stderr);
    println!("\n{counts}, {cases} cases each");
    if counts.passed + counts.failed == 0 && heard.status.success() {
        return Err(FuzzError::None.into());
    }
    Ok(if heard.status.success() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn command(targets: &[String], cases: u32, seed: Option<u64>, filter: Option<&str>) -> Command {
    let mut command = cargo();
    command.env("SOFTPLUG_FUZZ_CASES", cases.to_string()).env("CARGO_TERM_COLOR", "never").args([
        "test",
        "--release",
        "--no-fail-fast",
        "-p",
        PACKAGE,
    ]);
    if let Some(seed) = seed {
        command.env("SOFTPLUG_FUZZ_SEED", seed.to_string());
    }
    for target in targets {
        command.args(["--test", target]);
    }
    // What a test says of its cases is worth seeing.
    command.arg("--").arg("--nocapture").args(filter);
    command
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_filter_and_the_numbers_are_passed_on() {
        let command = command(&["r3964_fuzz".into()], 7, Some(3), Some("noise"));
        let words: Vec<_> = command.get_args().map(|word| word.to_str().unwrap()).collect();
        assert!(words.ends_with(&["--test", "r3964_fuzz", "--", "--nocapture", "noise"]));
        let variable = |name: &str| {
            let found = command.get_envs().find(|(key, _)| *key == name);
            found.and_then(|(_, value)| value).map(|value| value.to_str().unwrap().to_owned())
        };
        assert_eq!(variable("SOFTPLUG_FUZZ_CASES").as_deref(), Some("7"));
        assert_eq!(variable("SOFTPLUG_FUZZ_SEED").as_deref(), Some("3"));
    }

    #[test]
    fn the_property_tests_are_found_by_their_name() {
        let targets = Workspace::read().unwrap().fuzz_tests(PACKAGE);
        assert!(targets.contains(&"r3964_fuzz".to_owned()), "{targets:?}");
        assert!(targets.iter().all(|target| target.ends_with("_fuzz")), "{targets:?}");
    }
}
