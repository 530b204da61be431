//! The verbs, one file each: what they take, and what they say.

mod bless;
pub(crate) mod build;
mod calls;
pub(crate) mod cases;
pub(crate) mod cell;
pub(crate) mod certify;
pub(crate) mod check;
pub(crate) mod completions;
pub(crate) mod demo;
pub(crate) mod dev;
pub(crate) mod doctor;
mod dry_run;
pub(crate) mod explain;
pub(crate) mod explore;
pub(crate) mod gateway;
pub(crate) mod inspect;
pub(crate) mod job;
pub(crate) mod journal;
pub(crate) mod link;
pub(crate) mod machine;
pub(crate) mod man;
pub(crate) mod new;
pub(crate) mod pack;
pub(crate) mod plan;
pub(crate) mod plan_cell;
mod plan_pulses;
pub(crate) mod plugin;
pub(crate) mod ports;
pub(crate) mod program;
pub(crate) mod receive;
pub(crate) mod record;
pub(crate) mod remote;
pub(crate) mod replay;
pub(crate) mod send;
pub(crate) mod simulate;
mod step;
pub(crate) mod trace;
pub(crate) mod unit;
pub(crate) mod verify;
mod with_plugin;

use crate::arguments::{Command, Global};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::live;
use crate::screen::Screen;

/// Does what the command line asks for.
pub(crate) fn run(command: Command, global: &Global, screen: &Screen) -> Result<Exit, Failure> {
    match command {
        Command::New(arguments) => new::run(&arguments, screen),
        Command::Build(arguments) => build::run(&arguments, screen),
        Command::Dev(arguments) => live::dev(&arguments, screen),
        Command::Machine(arguments) => machine::run(&arguments, screen),
        Command::Check(arguments) => check::run(*arguments, screen),
        Command::Ports(_) => live::ports(screen),
        Command::Inspect(arguments) => inspect::run(&arguments, screen),
        Command::Pack(arguments) => pack::run(&arguments, screen),
        Command::Send(arguments) => send::run(*arguments, screen),
        Command::Receive(arguments) => receive::run(*arguments, screen),
        Command::Record(arguments) => record::run(&arguments, screen),
        Command::Replay(arguments) => replay::run(&arguments, screen),
        Command::Certify(arguments) => certify::run(&arguments, screen),
        Command::Explore(arguments) => explore::run(&arguments, screen),
        Command::Verify(arguments) => verify::run(&arguments, screen),
        Command::Cases(arguments) => cases::run(&arguments, screen),
        Command::Explain(arguments) => explain::run(&arguments, screen),
        Command::Trace(arguments) => trace::run(arguments, screen),
        Command::Plan(arguments) => plan::run(&arguments, screen),
        Command::Simulate(arguments) => simulate::run(arguments, screen),
        Command::Doctor(arguments) => live::doctor(&arguments, screen),
        Command::Demo(arguments) => live::demo(&arguments, screen),
        Command::Gateway(arguments) => live::gateway(&arguments, global, screen),
        Command::Unit(arguments) => live::unit(&arguments, global, screen),
        Command::Cell(arguments) => live::cell(&arguments, screen),
        Command::Link(arguments) => live::link(&arguments, screen),
        Command::Job(arguments) => live::job(&arguments, screen),
        Command::Journal(arguments) => live::journal(&arguments, screen),
        Command::Program(arguments) => live::program(&arguments, screen),
        Command::Plugin(arguments) => live::plugin(&arguments, screen),
        Command::Completions(arguments) => Ok(completions::run(&arguments)),
        Command::Man(arguments) => man::run(&arguments),
    }
}
