//! The verbs, one file each: what they take, and what they say.

mod amount;
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

use clap::Subcommand;

use crate::exit::Exit;
use crate::failure::Failure;
use crate::global::Global;
use crate::screen::Screen;

#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    New(new::Arguments),
    Build(build::Arguments),
    Dev(Box<dev::Arguments>),
    Ports(ports::Arguments),
    Inspect(inspect::Arguments),
    Pack(pack::Arguments),
    Machine(machine::Arguments),
    Check(Box<check::Arguments>),
    Send(Box<send::Arguments>),
    Receive(Box<receive::Arguments>),
    Record(record::Arguments),
    Replay(replay::Arguments),
    Certify(certify::Arguments),
    Verify(verify::Arguments),
    Explore(explore::Arguments),
    Cases(cases::Arguments),
    Explain(explain::Arguments),
    Trace(trace::Arguments),
    Plan(plan::Arguments),
    Simulate(simulate::Arguments),
    Doctor(doctor::Arguments),
    Demo(demo::Arguments),
    Gateway(gateway::Arguments),
    Unit(unit::Arguments),
    Link(link::Arguments),
    Job(job::Arguments),
    Journal(journal::Arguments),
    Cell(cell::Arguments),
    Program(program::Arguments),
    Plugin(plugin::Arguments),
    Completions(completions::Arguments),
    Man(man::Arguments),
}

impl Command {
    /// The gateway's configuration says how it logs.
    pub(crate) fn has_its_own_log(&self) -> bool {
        match self {
            Self::Gateway(arguments) => arguments.runs(),
            Self::Unit(arguments) => arguments.runs(),
            _ => false,
        }
    }
}

/// Does what the command line asks for; `whole` is all that it could ask for.
pub(crate) fn run(
    command: Command,
    global: &Global,
    whole: fn() -> clap::Command,
    screen: &Screen,
) -> Result<Exit, Failure> {
    match command {
        Command::New(arguments) => new::run(&arguments, screen),
        Command::Build(arguments) => build::run(&arguments, screen),
        Command::Machine(arguments) => machine::run(&arguments, screen),
        Command::Check(arguments) => check::run(*arguments, screen),
        Command::Ports(_) => ports::run(screen),
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
        Command::Completions(arguments) => Ok(completions::run(&arguments, whole())),
        Command::Man(arguments) => man::run(&arguments, whole()),
        #[cfg(target_os = "linux")]
        Command::Dev(arguments) => dev::run(&arguments, screen),
        #[cfg(target_os = "linux")]
        Command::Doctor(arguments) => doctor::run(&arguments, screen),
        #[cfg(target_os = "linux")]
        Command::Demo(arguments) => demo::run(&arguments, screen),
        #[cfg(target_os = "linux")]
        Command::Gateway(arguments) => gateway::run(&arguments, global, screen),
        #[cfg(target_os = "linux")]
        Command::Unit(arguments) => unit::run(&arguments, global, screen),
        #[cfg(target_os = "linux")]
        Command::Cell(arguments) => cell::run(&arguments, screen),
        #[cfg(target_os = "linux")]
        Command::Link(arguments) => link::run(&arguments, screen),
        #[cfg(target_os = "linux")]
        Command::Job(arguments) => job::run(&arguments, screen),
        #[cfg(target_os = "linux")]
        Command::Journal(arguments) => journal::run(&arguments, screen),
        #[cfg(target_os = "linux")]
        Command::Program(arguments) => program::run(&arguments, screen),
        #[cfg(target_os = "linux")]
        Command::Plugin(arguments) => plugin::run(&arguments, screen),
        #[cfg(not(target_os = "linux"))]
        command => {
            // It says how the gateway logs.
            let _ = global;
            Err(only_on_linux(&command))
        }
    }
}

#[cfg(not(target_os = "linux"))]
fn only_on_linux(command: &Command) -> Failure {
    Failure::only_on_linux(match command {
        Command::Gateway(_) => "the gateway",
        Command::Unit(_) => "a front-end unit",
        Command::Doctor(_) => "examining a port",
        Command::Dev(_) => "swapping on each save",
        Command::Demo(_) => "the demonstration",
        Command::Plugin(_) => "the library of a gateway",
        _ => "speaking with a gateway",
    })
}
