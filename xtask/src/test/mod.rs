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
use crate::{Error, emulated, firmware, mutants, playground, plugins, windows};

/// What is asked for by name must be there.
#[derive(Debug, thiserror::Error)]
#[error("what is asked for needs {}: install what is missing and run this again", .0.join(" and "))]
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

/// Its tests need the target for Windows as well, and take minutes to build.
const WINDOWS: Tool = Tool {
    program: windows::WINE,
    source: "Debian packages wine64 and wine",
    purpose: "the command for Windows, run by wine",
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
    /// What is there, but for the emulated computer and Windows.
    Usual,
    /// Everything but Windows; what is missing is an error.
    All,
    /// The emulated computer alone.
    Emulated,
    /// The command for Windows alone.
    Windows,
}

impl Extent {
    pub(crate) fn new(all: bool, emulated: bool, windows: bool) -> Self {
        match (all, emulated, windows) {
            (_, true, _) => Self::Emulated,
            (_, _, true) => Self::Windows,
            (true, false, false) => Self::All,
            (false, false, false) => Self::Usual,
        }
    }

    /// Whether it is more than one part alone.
    fn is_general(self) -> bool {
        matches!(self, Self::Usual | Self::All)
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
    let is_general = extent.is_general();
    let mut part = |tool: &Tool, is_wanted: bool, obstacle: Option<String>| match obstacle {
        _ if !is_wanted => Ok(false),
        None => Ok(true),
        Some(why)
            if extent != Extent::Usual && !(is_general && tool.program == WINDOWS.program) =>
        {
            Err(TestError(vec![why]))
        }
        Some(why) => {
            left_out.push((tool.purpose, why));
            Ok(false)
        }
    };
    let is_emulated = is_general || extent == Extent::Emulated;
    let emulated = part(&EMULATOR, is_emulated, emulated_obstacle(extent))?;
    let board = part(&BOARD, is_general && run::find(BOARD.program).is_some(), board_obstacle())?;
    let is_windows = is_general || extent == Extent::Windows;
    let windows = part(&WINDOWS, is_windows, windows_obstacle(extent))?;
    plugins::build(workspace, plugins::Report::Table)?;
    let mut steps = Vec::new();
    if is_general {
        mutants::build(workspace)?;
        playground::build(workspace)?;
        let firmware = board.then(|| firmware::build(workspace)).transpose()?;
        for tool in missing.iter().filter(|tool| tool.program != EMULATOR.program) {
            let why = format!("`{}` is missing ({})", tool.program, tool.source);
            left_out.push((tool.purpose, why));
        }
        let mut skips: Vec<_> = missing.iter().map(|tool| tool.module()).collect();
        skips.extend([EMULATOR.module(), WINDOWS.module()]);
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
        let mut tests = tests_of("softplug-emulated", None);
        tests.env("SOFTPLUG_EMULATED", images);
        steps.push(step(workspace, "the emulated computer", tests)?);
    }
    if windows {
        let built = windows::build(workspace)?;
        let prefix = windows::prefix(workspace)?;
        let mut tests = tests_of("softplug", Some("windows"));
        tests.env("SOFTPLUG_WINDOWS", built).env("WINEPREFIX", &prefix);
        let step = step(workspace, "Windows", tests);
        windows::end(&prefix);
        steps.push(step?);
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
fn board_obstacle() -> Option<String> {
    run::find(BOARD.program).and_then(|_| firmware::obstacle())
}

/// Why the command for Windows is left out, if it is.
fn windows_obstacle(extent: Extent) -> Option<String> {
    if extent != Extent::Windows {
        return Some("it takes minutes (cargo xtask test --windows)".to_owned());
    }
    windows::obstacle()
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

/// The tests of one package, or of one of its test programs.
fn tests_of(package: &str, program: Option<&str>) -> Command {
    let mut tests = cargo();
    let nextest = run::find("cargo-nextest").is_some();
    if nextest {
        tests.args(["nextest", "run"]);
    } else {
        tests.arg("test");
    }
    tests.args(["-p", package, "--no-fail-fast"]);
    match program {
        Some(program) => tests.args(["--test", program]),
        None if nextest => &mut tests,
        None => tests.args(["--lib", "--tests"]),
    };
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
    fn what_takes_minutes_is_no_part_of_the_usual() {
        assert_eq!(Extent::new(false, false, false), Extent::Usual);
        assert_eq!(Extent::new(true, false, false), Extent::All);
        assert_eq!(Extent::new(true, true, false), Extent::Emulated);
        assert_eq!(Extent::new(false, false, true), Extent::Windows);
        assert!(emulated_obstacle(Extent::Usual).is_some());
        assert!(windows_obstacle(Extent::Usual).is_some());
        assert!(windows_obstacle(Extent::All).is_some());
        assert_eq!(EMULATOR.module(), "needs_qemu_system_x86_64");
    }

    #[test]
    fn missing_tools_are_named_with_their_package() {
        let error =
            TestError(vec!["`a` (Debian package b)".into(), "`c` (Debian package d)".into()]);
        assert_eq!(
            error.to_string(),
            "what is asked for needs `a` (Debian package b) and `c` (Debian package d): install what is \
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
