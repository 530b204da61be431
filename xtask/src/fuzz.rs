//! Runs the property tests with many random cases: the tests of the suite whose
//! name ends in `_fuzz`. With `--long` also what searches for hours: a partner
//! that answers at once, a bad bus between a gateway and a unit, channels of a cell in every order,
//! and modules that take long to compile.

use std::process::{Command, ExitCode};

use crate::Error;
use crate::run::{cargo, overhear, status};
use crate::test::Counts;
use crate::workspace::Workspace;

const PACKAGE: &str = "softplug-conformance";
const CASES: u32 = 2_000;
const MANY_CASES: u32 = 100_000;
/// The partner that answers at once: blocks each way on each kind of port.
const PROMPT: &str = "prompt";
const PROMPT_BLOCKS: u32 = 20_000;
/// A bad bus between a gateway and a unit: its faults.
const BUS: &str = "bus";
const BUS_FAULTS: u32 = 10_000;
/// A cell: all interleavings of four channels, and a gateway that is killed in the middle.
const CELL: &str = "cell";
const CELL_KILLS: u32 = 100;
/// The search for modules that take long to compile, and its seconds.
const BOMBS: &str = "bombs";
const BOMBS_SECONDS: u32 = 600;

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
    let names_a_search = filter.is_some_and(|filter| [PROMPT, BUS, CELL, BOMBS].contains(&filter));
    if !names_a_search {
        let code = property_tests(workspace, long, seed, filter)?;
        if !long || filter.is_some() || code != ExitCode::SUCCESS {
            return Ok(code);
        }
    }
    let searches = [
        (PROMPT, prompt()),
        (BUS, bus()),
        (CELL, interleavings()),
        (CELL, kills()),
        (BOMBS, bombs(seed)),
    ];
    for (name, mut command) in searches {
        let is_asked_for = filter.is_none_or(|filter| filter == name);
        if is_asked_for && !status(command.current_dir(workspace.root()))?.success() {
            return Ok(ExitCode::FAILURE);
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn prompt() -> Command {
    let mut command = cargo();
    command.env("SOFTPLUG_PROMPT_BLOCKS", PROMPT_BLOCKS.to_string());
    command.args(["test", "--workspace", "--test", "integration", "prompt::", "--", "--nocapture"]);
    command
}

fn bus() -> Command {
    let mut command = cargo();
    command.env("SOFTPLUG_BUS_FAULTS", BUS_FAULTS.to_string());
    command.args([
        "test",
        "-p",
        "softplug-unit",
        "--test",
        "unit",
        "a_bad_bus",
        "--",
        "--nocapture",
    ]);
    command
}

fn interleavings() -> Command {
    let mut command = cargo();
    command.env("SOFTPLUG_CELL_LONG", "1");
    command.args(["test", "--release", "-p", "softplug-cell", "--test", "interleavings"]);
    command.args(["--", "--nocapture"]);
    command
}

fn kills() -> Command {
    let mut command = cargo();
    command.env("SOFTPLUG_CELL_KILLS", CELL_KILLS.to_string());
    command.args(["test", "--workspace", "--test", "integration", "gateway::cells_crash"]);
    command.args(["--", "--nocapture"]);
    command
}

fn bombs(seed: Option<u64>) -> Command {
    let mut command = cargo();
    command.args(["run", "--release", "-p", "softplug-host", "--example", BOMBS, "--", "search"]);
    command.args([BOMBS_SECONDS.to_string(), seed.unwrap_or(1).to_string()]);
    command
}

fn property_tests(
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
    fn the_searches_run_for_long() {
        let words = |command: &Command| {
            command.get_args().map(|word| word.to_str().unwrap().to_owned()).collect::<Vec<_>>()
        };
        assert!(words(&prompt()).contains(&format!("{PROMPT}::")));
        assert!(words(&bombs(Some(5))).ends_with(&["search".into(), "600".into(), "5".into()]));
    }

    #[test]
    fn the_property_tests_are_found_by_their_name() {
        let targets = Workspace::read().unwrap().fuzz_tests(PACKAGE);
        assert!(targets.contains(&"r3964_fuzz".to_owned()), "{targets:?}");
        assert!(targets.iter().all(|target| target.ends_with("_fuzz")), "{targets:?}");
    }
}
