//! Runs the tests, adds up their results and names what was left out.
//!
//! A test that needs a program beyond cargo stands in a module named
//! `needs_PROGRAM`; where the program is missing, such tests are left out by
//! that name.

mod counts;

use std::process::{Command, ExitCode};

pub(crate) use self::counts::Counts;
use crate::run::{self, cargo, overhear};
use crate::workspace::Workspace;
use crate::{Error, emulated, firmware, mutants, playground, plugins};

/// With `--all`, all that is needed must be there.
#[derive(Debug, thiserror::Error)]
#[error("--all demands {}: install what is missing and run this again", .0.join(" and "))]
pub(crate) struct TestError(Vec<String>);

/// A program that some tests need.
struct Tool {
    /// The program; its tests stand in modules named `needs_PROGRAM`.
    program: &'static str,
    /// Where to get it.
    source: &'static str,
    /// What the tests do with it.
    purpose: &'static str,
}

impl Tool {
    fn module(&self) -> String {
        format!("needs_{}", self.program.replace('-', "_"))
    }
}

/// Its tests take minutes, and fetch a kernel: they are run where they are asked for.
const EMULATOR: Tool = Tool {
    program: emulated::QEMU,
    source: "Debian package qemu-system-x86",
    purpose: "the command on real serial drivers, in an emulated computer",
};

/// Its tests need the target of the firmware as well.
const BOARD: Tool = Tool {
    program: "qemu-system-arm",
    source: "Debian package qemu-system-arm",
    purpose: "the unit without an operating system, on an emulated Cortex-M4",
};

const TOOLS: &[Tool] = &[
    Tool {
        program: "stty",
        source: "Debian package coreutils",
        purpose: "transfers with the kernel's own XON/XOFF as the partner (stty and cat)",
    },
    Tool {
        program: "openssl",
        source: "Debian package openssl",
        purpose: "signed reports held against another program",
    },
    Tool {
        program: "chromium",
        source: "Debian package chromium",
        purpose: "the pages of a report, of the gateway and of the playground in a real browser",
    },
    Tool {
        program: "ser2net",
        source: "Debian package ser2net",
        purpose: "device servers: our RFC 2217 against that of ser2net",
    },
    Tool {
        program: "kermit",
        source: "Debian package ckermit",
        purpose: "files by Kermit to and from another program (C-Kermit)",
    },
    Tool {
        program: "sx",
        source: "Debian package lrzsz",
        purpose: "files by XMODEM to and from another program (sx and rx)",
    },
    Tool {
        program: "tshark",
        source: "Debian package tshark",
        purpose: "captures and hex dumps in Wireshark's own tools (tshark and text2pcap)",
    },
    Tool {
        program: "clang",
        source: "Debian packages clang and lld",
        purpose: "XON/XOFF in C, certified like the one in Rust",
    },
    Tool {
        program: "asc",
        source: "`npm ci` in sdk/assemblyscript, then its node_modules/.bin in PATH",
        purpose: "XON/XOFF in AssemblyScript, certified like the one in Rust",
    },
    Tool {
        program: "curl",
        source: "Debian package curl",
        purpose: "the book's page on the HTTP API",
    },
    Tool { program: "jq", source: "Debian package jq", purpose: "the book's page on reports" },
    Tool { program: "node", source: "Debian package nodejs", purpose: "the host in JavaScript" },
    Tool {
        program: "python_wasmtime",
        source: "a Python with docs/hosts/requirements.txt, under that name",
        purpose: "the host in Python",
    },
    Tool {
        program: "systemd-analyze",
        source: "Debian package systemd",
        purpose: "the gateway's unit as systemd reads it",
    },
    Tool {
        program: "unshare",
        source: "Debian package util-linux",
        purpose: "a gateway on a disk that is full, and one without rights",
    },
    EMULATOR,
    BOARD,
    Tool {
        program: "schemathesis",
        source: "runner/service/tests/api/requirements.txt, from PyPI",
        purpose: "the gateway's API fuzzed from its own document",
    },
];

/// Which tests to run.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Extent {
    /// What is there, but for the emulated computer.
    Usual,
    /// Everything; what is missing is an error.
    All,
    /// The emulated computer alone.
    Emulated,
}

impl Extent {
    pub(crate) fn new(all: bool, emulated: bool) -> Self {
        match (all, emulated) {
            (_, true) => Self::Emulated,
            (true, false) => Self::All,
            (false, false) => Self::Usual,
        }
    }
}

/// Fails where a test fails; where a tool is missing only if all is asked for.
pub(crate) fn run(workspace: &Workspace, extent: Extent) -> Result<ExitCode, Error> {
    let missing: Vec<_> = TOOLS.iter().filter(|tool| run::find(tool.program).is_none()).collect();
    if extent == Extent::All && !missing.is_empty() {
        let names = missing.iter().map(|tool| format!("`{}` ({})", tool.program, tool.source));
        return Err(TestError(names.collect()).into());
    }
    let mut left_out = Vec::new();
    let emulated = match emulated_obstacle(extent) {
        None => true,
        Some(why) if extent == Extent::All => return Err(TestError(vec![why]).into()),
        Some(why) => {
            left_out.push((EMULATOR.purpose, why));
            false
        }
    };
    let board = match board_obstacle(extent) {
        None => run::find(BOARD.program).is_some(),
        Some(why) if extent == Extent::All => return Err(TestError(vec![why]).into()),
        Some(why) => {
            left_out.push((BOARD.purpose, why));
            false
        }
    };
    plugins::build(workspace, plugins::Report::Table)?;
    let mut steps = Vec::new();
    if extent != Extent::Emulated {
        mutants::build(workspace)?;
        playground::build(workspace)?;
        let firmware = board.then(|| firmware::build(workspace)).transpose()?;
        let others = missing.iter().filter(|tool| tool.program != EMULATOR.program);
        for tool in others {
            let why = format!("`{}` is missing ({})", tool.program, tool.source);
            left_out.push((tool.purpose, why));
        }
        let mut skips: Vec<_> = missing.iter().map(|tool| tool.module()).collect();
        skips.push(EMULATOR.module());
        if !board {
            skips.push(BOARD.module());
        }
        for (name, mut command) in steps_of(&skips) {
            if let Some(built) = &firmware {
                command.env("SOFTPLUG_FIRMWARE", built);
            }
            steps.push(step(workspace, name, command)?);
        }
    }
    if emulated {
        // The tests before have built the command as well.
        let built = workspace.target().join("debug").join("softplug");
        let command =
            if extent == Extent::All { built } else { plugins::build_command(workspace, true)? };
        let images = emulated::make(workspace, &command)?;
        let mut tests = emulated_tests();
        tests.env("SOFTPLUG_EMULATED", images);
        steps.push(step(workspace, "the emulated computer", tests)?);
    }
    Ok(conclude(&steps, &left_out))
}

/// Why the emulated computer is left out, if it is.
fn emulated_obstacle(extent: Extent) -> Option<String> {
    if run::find(EMULATOR.program).is_none() {
        return Some(format!("`{}` is missing ({})", EMULATOR.program, EMULATOR.source));
    }
    if extent == Extent::Usual {
        return Some("it takes minutes (cargo xtask test --emulated)".to_owned());
    }
    emulated::obstacle()
}

/// Why the emulated board is left out although its program is there, if it is.
fn board_obstacle(extent: Extent) -> Option<String> {
    let is_wanted = extent != Extent::Emulated && run::find(BOARD.program).is_some();
    is_wanted.then(firmware::obstacle).flatten()
}

fn step(workspace: &Workspace, name: &'static str, mut command: Command) -> Result<Step, Error> {
    command
        .current_dir(workspace.root())
        .env("SOFTPLUG_PLUGINS", workspace.plugin_folder())
        .env("SOFTPLUG_MUTANTS", workspace.mutant_folder())
        .env("SOFTPLUG_PLAYGROUND", workspace.playground())
        .env("CARGO_TERM_COLOR", "never");
    let heard = overhear(&mut command)?;
    let counts = Counts::read(&heard.stdout) + Counts::read(&heard.stderr);
    Ok(Step { name, counts, succeeded: heard.status.success() })
}

/// One run of a test runner.
struct Step {
    name: &'static str,
    counts: Counts,
    succeeded: bool,
}

impl Step {
    /// What is wrong with it, beyond tests that failed.
    fn complaint(&self) -> Option<String> {
        if !self.succeeded && self.counts.failed == 0 {
            return Some(format!("{} did not get to the end: see its message above", self.name));
        }
        if self.succeeded && self.counts.passed == 0 {
            return Some(format!("{} ran no test at all, which proves nothing", self.name));
        }
        None
    }
}

fn steps_of(skips: &[String]) -> [(&'static str, Command); 2] {
    let mut tests = cargo();
    let nextest = run::find("cargo-nextest").is_some();
    if nextest {
        tests.args(["nextest", "run", "--workspace", "--no-fail-fast"]);
    } else {
        tests.args(["test", "--workspace", "--no-fail-fast", "--lib", "--bins", "--tests"]);
        tests.arg("--examples");
    }
    if !skips.is_empty() {
        tests.arg("--");
        for skip in skips {
            tests.args(["--skip", skip]);
        }
    }
    let mut examples = cargo();
    examples.args(["test", "--workspace", "--no-fail-fast", "--doc"]);
    [(if nextest { "cargo nextest" } else { "cargo test" }, tests), ("the doc tests", examples)]
}

fn emulated_tests() -> Command {
    let mut tests = cargo();
    let package = ["-p", "softplug-emulated", "--no-fail-fast"];
    if run::find("cargo-nextest").is_some() {
        tests.args(["nextest", "run"]).args(package);
    } else {
        tests.arg("test").args(package).args(["--lib", "--tests"]);
    }
    tests
}

/// Skipped is never green by silence: everything left out has its line.
fn conclude(steps: &[Step], left_out: &[(&str, String)]) -> ExitCode {
    let total = steps.iter().fold(Counts::default(), |sum, step| sum + step.counts);
    let complaints: Vec<_> = steps.iter().filter_map(Step::complaint).collect();
    println!();
    for (what, why) in left_out {
        println!("left out: {what}, because {why}");
    }
    println!("left out: benchmarks, because they measure and judge nothing (cargo xtask bench)");
    for complaint in &complaints {
        println!("error: {complaint}");
    }
    println!("{total}");
    if steps.is_empty() {
        println!("error: no test was run, which proves nothing");
    }
    let good =
        !steps.is_empty() && complaints.is_empty() && steps.iter().all(|step| step.succeeded);
    if good { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ended(passed: u64, failed: u64, succeeded: bool) -> Step {
        Step { name: "cargo test", counts: Counts { passed, failed, skipped: 0 }, succeeded }
    }

    #[test]
    fn a_run_without_tests_is_an_error_and_so_is_one_that_broke_off() {
        assert_eq!(ended(3, 0, true).complaint(), None);
        assert_eq!(ended(3, 1, false).complaint(), None);
        assert!(ended(0, 0, true).complaint().unwrap().contains("no test at all"));
        assert!(ended(0, 0, false).complaint().unwrap().contains("did not get to the end"));
    }

    #[test]
    fn the_emulated_computer_is_a_part_of_all_and_not_of_the_usual() {
        assert_eq!(Extent::new(false, false), Extent::Usual);
        assert_eq!(Extent::new(true, false), Extent::All);
        assert_eq!(Extent::new(true, true), Extent::Emulated);
        assert!(emulated_obstacle(Extent::Usual).is_some());
        assert_eq!(EMULATOR.module(), "needs_qemu_system_x86_64");
    }

    #[test]
    fn missing_tools_are_named_with_their_package() {
        let error =
            TestError(vec!["`a` (Debian package b)".into(), "`c` (Debian package d)".into()]);
        assert_eq!(
            error.to_string(),
            "--all demands `a` (Debian package b) and `c` (Debian package d): install what is \
             missing and run this again"
        );
    }

    #[test]
    fn tests_of_missing_tools_are_left_out_by_name() {
        let [(_, tests), (_, examples)] = steps_of(&["needs_stty".into()]);
        let arguments: Vec<_> = tests.get_args().map(|word| word.to_str().unwrap()).collect();
        assert!(arguments.ends_with(&["--", "--skip", "needs_stty"]), "{arguments:?}");
        assert!(examples.get_args().any(|word| word == "--doc"));
    }
}
