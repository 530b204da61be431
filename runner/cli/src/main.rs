//! Softplug's command: transfers over serial lines through sandboxed plug-ins,
//! and the tools around them.
#![forbid(unsafe_code)]
// Elsewhere what only transfers need is not called.
#![cfg_attr(not(target_os = "linux"), allow(dead_code))]

mod arguments;
mod commands;
mod corpus;
mod dump;
mod exit;
mod failure;
mod files;
mod line;
#[cfg(target_os = "linux")]
mod live;
#[cfg(not(target_os = "linux"))]
#[path = "elsewhere.rs"]
mod live;
mod numbers;
mod picture;
mod plugin;
mod screen;
mod stop;
mod table;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;

use crate::arguments::{CommandLine, Start};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::screen::Screen;
use softplug_gateway::guess;
use softplug_host::compiler::{self, CompilerProcess};

/// The word that makes this program the process that compiles plug-ins for another of its kind.
const COMPILE: &str = "__compile";

fn main() -> ExitCode {
    if std::env::args_os().nth(1).is_some_and(|word| word == COMPILE) {
        return compile();
    }
    // Where the system does not tell which file this is, plug-ins are compiled in this process.
    if let Ok(compiler) = CompilerProcess::this_program([COMPILE]) {
        compiler.install();
    }
    match arguments::read() {
        Start::Run(command_line) => {
            let screen = Screen::new(&command_line.global);
            if !command_line.command.has_its_own_log() {
                screen::start_log(&command_line.global);
            }
            let CommandLine { command, global } = *command_line;
            let exit = guard(&screen, || commands::run(command, &global, &screen));
            screen::conclude(exit).into()
        }
        Start::End(exit) => screen::conclude(exit).into(),
    }
}

/// Does what a host asks for on standard input; it reads what is said on standard error.
fn compile() -> ExitCode {
    match compiler::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
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
        let screen = Screen::new(&arguments::Global::default());
        assert_eq!(guard(&screen, || panic!("a bug")), Exit::Internal);
        assert_eq!(guard(&screen, || Err(Failure::usage("no"))), Exit::Usage);
        assert_eq!(guard(&screen, || Ok(Exit::Done)), Exit::Done);
    }
}
