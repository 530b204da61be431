//! Softplug's command: transfers over serial lines through sandboxed plug-ins,
//! and the tools around them.
#![forbid(unsafe_code)]
// Elsewhere what only transfers need is not called.
#![cfg_attr(not(target_os = "linux"), allow(dead_code))]

mod arguments;
mod assignment;
mod commands;
mod corpus;
mod dump;
mod exit;
mod failure;
mod files;
mod global;
mod line;
mod live;
mod machine;
mod numbers;
mod picture;
mod plugin;
mod recorded;
mod screen;
mod sequence;
mod stop;
mod table;

use clap::CommandFactory;
use std::ffi::OsStr;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
#[cfg(unix)]
use std::sync::Arc;
use std::time::Duration;

use crate::arguments::{CommandLine, Start};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::screen::Screen;
use softplug_host::compiler::{self, CompileLimits, CompilerProcess};
use softplug_live::guess;

/// The word that makes this program the process that compiles plug-ins for another of its kind.
const COMPILE: &str = "__compile";

/// How many seconds of computing the compiling of a plug-in may take on a slow computer.
const COMPILE_SECONDS: &str = "SOFTPLUG_COMPILE_SECONDS";
/// More than the slowest computer needs.
const MOST_SECONDS: u64 = 600;

fn main() -> ExitCode {
    if std::env::args_os().nth(1).is_some_and(|word| word == COMPILE) {
        return compile();
    }
    let Some(limits) = compile_limits(std::env::var_os(COMPILE_SECONDS).as_deref()) else {
        let text = format!(
            "error: {COMPILE_SECONDS} is no whole number of seconds from 1 to {MOST_SECONDS}\n"
        );
        Screen::early(text, true, anstream::ColorChoice::Never);
        return Exit::Usage.into();
    };
    survive_file_limits();
    // Where the system does not tell which file this is, plug-ins are compiled in this process.
    if let Ok(compiler) = CompilerProcess::this_program([COMPILE]) {
        compiler.limited(limits).install();
    }
    match arguments::read() {
        Start::Run(command_line) => {
            let screen = Screen::new(&command_line.global);
            if !command_line.command.has_its_own_log() {
                screen::start_log(&command_line.global);
            }
            let CommandLine { command, global } = *command_line;
            let exit =
                guard(&screen, || commands::run(command, &global, CommandLine::command, &screen));
            screen::conclude(exit).into()
        }
        Start::End(exit) => screen::conclude(exit).into(),
    }
}

/// A file that may not grow any further (`ulimit -f`) is an error of whoever writes it, as a full disk is,
/// and does not end the process.
fn survive_file_limits() {
    #[cfg(unix)]
    // What cannot be registered stays as it is.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
}

/// What compiling a plug-in may take, if so many seconds of computing are asked for; `None` if
/// that is no number which can be meant.
fn compile_limits(seconds: Option<&OsStr>) -> Option<CompileLimits> {
    let usual = CompileLimits::default();
    let Some(seconds) = seconds else { return Some(usual) };
    let seconds: u64 = seconds.to_str()?.parse().ok()?;
    if !(1..=MOST_SECONDS).contains(&seconds) {
        return None;
    }
    let computing = Duration::from_secs(seconds);
    Some(CompileLimits { computing, patience: usual.patience.max(4 * computing), ..usual })
}

/// Does what a host asks for on standard input; it reads what is said on standard error.
fn compile() -> ExitCode {
    match compiler::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            Screen::early(format!("{error}\n"), true, anstream::ColorChoice::Never);
            Exit::Internal.into()
        }
    }
}

/// Runs the command; an error is said and a bug is owned up to.
fn guard(screen: &Screen, run: impl FnOnce() -> Result<Exit, Failure>) -> Exit {
    // Nothing that the closure touched is looked at again after a panic.
    match catch_unwind(AssertUnwindSafe(run)) {
        Ok(Ok(exit)) => exit,
        Ok(Err(failure)) => {
            screen.failure(&failure);
            failure.exit
        }
        Err(_) => {
            screen.failure(&Failure::internal("the command has met a state that it should not"));
            Exit::Internal
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bug_ends_as_an_internal_error_and_not_as_a_signal() {
        let screen = Screen::new(&global::Global::default());
        assert_eq!(guard(&screen, || panic!("a bug")), Exit::Internal);
        assert_eq!(guard(&screen, || Err(Failure::usage("no"))), Exit::Usage);
        assert_eq!(guard(&screen, || Ok(Exit::Done)), Exit::Done);
    }

    #[test]
    fn a_slow_computer_may_take_longer_to_compile() {
        let limits = |text: &str| compile_limits(Some(OsStr::new(text)));
        assert_eq!(compile_limits(None), Some(CompileLimits::default()));
        let slow = limits("120").unwrap();
        assert_eq!(slow.computing, Duration::from_mins(2));
        assert!(slow.patience > slow.computing);
        assert_eq!(slow.memory, CompileLimits::default().memory);
        for wrong in ["", "0", "601", "-1", "1.5", "2s"] {
            assert_eq!(limits(wrong), None, "{wrong}");
        }
    }
}
