//! Softplug's own tasks: `cargo xtask build | demo | firmware | playground | test | mutants | fuzz | bench
//! | packages | nc`.

mod bench;
mod book;
mod code_mutants;
mod demo;
mod emulated;
mod firmware;
mod fuzz;
mod mutants;
mod nc;
mod packages;
mod playground;
mod plugins;
mod run;
mod test;
mod toolchain;
mod windows;
mod workspace;

use std::path::PathBuf;
use std::process::ExitCode;

use clap::{Parser, Subcommand};

use crate::nc::Kind;
use crate::workspace::Workspace;

/// Builds, shows, tests and measures Softplug.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Arguments {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Builds the plug-ins into target/plugins and the command into target/release.
    Build {
        /// Build the command without optimisation, into target/debug.
        #[arg(long)]
        dev: bool,
        /// Print the sizes of the plug-ins as JSON, to standard output.
        #[arg(long)]
        json: bool,
    },
    /// Builds all and runs `softplug demo`.
    Demo {
        /// Passed on to `softplug demo`.
        #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
        arguments: Vec<String>,
    },
    /// Builds the firmware of a unit without an operating system.
    Firmware,
    /// Builds the playground's page into target/playground.html.
    Playground,
    /// Runs every test that can run here, and names what was left out.
    Test {
        /// Fail where a tool is missing instead of leaving its tests out.
        #[arg(long)]
        all: bool,
        /// Only the tests on an emulated computer with real serial drivers: minutes. They are a
        /// part of --all.
        #[arg(long, conflicts_with = "windows")]
        emulated: bool,
        /// Only the tests of the command for Windows, run by wine: minutes, and no part of --all.
        #[arg(long)]
        windows: bool,
    },
    /// Hunts the plug-ins' mutants and writes the kill matrix.
    Mutants {
        /// Compare the matrix with the one that is there, and run all else that
        /// keeps the mutants in order.
        #[arg(long, conflicts_with = "long")]
        check: bool,
        /// Only build them, into target/mutants.
        #[arg(long, conflicts_with_all = ["check", "long", "filter"])]
        build: bool,
        /// Break the code itself instead, one place at a time, with cargo-mutants: hours.
        #[arg(long)]
        long: bool,
        /// Change the built modules instead, one instruction at a time: 60 places of each plug-in,
        /// or with --long 300, of which the scores are written that the kill matrix shows: an hour.
        #[arg(long, conflicts_with_all = ["check", "build"])]
        module: bool,
        /// Explore each mutant instead, with up to one fault, or with --long two and at most a
        /// minute a configuration: minutes, or an hour. Each is a line of JSON.
        #[arg(long, conflicts_with_all = ["check", "build", "module"])]
        explore: bool,
        /// Only mutants whose id contains this; the matrix then stays as it is. With
        /// --module: only plug-ins whose name does. With --long: only this part, such as `trace`, `suite` or `xon-xoff`.
        filter: Option<String>,
    },
    /// Runs the property tests with many random cases, optimised.
    Fuzz {
        /// 100,000 cases a test instead of 2,000; then 20,000 blocks with a partner that answers
        /// at once on each kind of port, and a search for modules that take long to compile:
        /// hours.
        #[arg(long)]
        long: bool,
        /// The seed of the first case: a failure prints the one of its own.
        #[arg(long)]
        seed: Option<u64>,
        /// Only tests whose name contains this; `prompt` and `bombs`: only that partner, or that
        /// search.
        filter: Option<String>,
    },
    /// Runs the benchmarks and prints their tables.
    Bench {
        /// Only benchmarks whose name contains this; `gateway`: only what it costs.
        filter: Option<String>,
    },
    /// Packs every crate as it would be published.
    Packages {
        /// Build each from its package, and compare the libraries' API with an earlier one.
        #[arg(long)]
        long: bool,
        /// The commit or tag whose API is compared; without it the latest release.
        #[arg(long, requires = "long")]
        since: Option<String>,
    },
    /// Makes the book of `docs/` in target/book, with mdBook, which is installed if it is missing.
    Book,
    /// Writes a generated NC program.
    Nc {
        /// File to write, `-` for standard output.
        out: PathBuf,
        /// What the program machines.
        #[arg(long, value_enum)]
        kind: Kind,
        /// Its exact size.
        #[arg(long, default_value_t = 1_000_000)]
        bytes: usize,
        /// The same seed gives the same program.
        #[arg(long, default_value_t = 1)]
        seed: u64,
    },
}

fn main() -> ExitCode {
    match perform(Arguments::parse().task) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn perform(task: Task) -> Result<ExitCode, Error> {
    match task {
        Task::Build { dev, json } => {
            let workspace = Workspace::read()?;
            let report = if json { plugins::Report::Json } else { plugins::Report::Table };
            plugins::build(&workspace, report)?;
            plugins::build_command(&workspace, dev)?;
        }
        Task::Demo { arguments } => return demo::run(&Workspace::read()?, &arguments),
        Task::Firmware => {
            let firmware = firmware::build(&Workspace::read()?)?;
            println!("{}", firmware.display());
        }
        Task::Playground => {
            let workspace = Workspace::read()?;
            plugins::build(&workspace, plugins::Report::Table)?;
            playground::build(&workspace)?;
        }
        Task::Test { all, emulated, windows } => {
            return test::run(&Workspace::read()?, test::Extent::new(all, emulated, windows));
        }
        Task::Mutants { module: true, long, filter, .. } => {
            return mutants::module::run(&Workspace::read()?, long, filter.as_deref());
        }
        Task::Mutants { explore: true, long, filter, .. } => {
            return mutants::explore(&Workspace::read()?, long, filter.as_deref());
        }
        Task::Mutants { long: true, filter, .. } => {
            return code_mutants::run(&Workspace::read()?, filter.as_deref());
        }
        Task::Mutants { build: true, .. } => mutants::build(&Workspace::read()?)?,
        Task::Mutants { check, filter, .. } => {
            let matrix = if check { mutants::Matrix::Check } else { mutants::Matrix::Write };
            return mutants::run(&Workspace::read()?, matrix, filter.as_deref());
        }
        Task::Fuzz { long, seed, filter } => {
            return fuzz::run(&Workspace::read()?, long, seed, filter.as_deref());
        }
        Task::Bench { filter } => bench::run(&Workspace::read()?, filter.as_deref())?,
        Task::Packages { long, since } => {
            return packages::run(&Workspace::read()?, long, since.as_deref());
        }
        Task::Book => book::make(&Workspace::read()?)?,
        Task::Nc { out, kind, bytes, seed } => nc::write(&out, kind, bytes, seed)?,
    }
    Ok(ExitCode::SUCCESS)
}

/// Why a task could not be done.
#[derive(Debug, thiserror::Error)]
enum Error {
    #[error(transparent)]
    Run(#[from] run::RunError),
    #[error(transparent)]
    Toolchain(#[from] toolchain::ToolchainError),
    #[error(transparent)]
    Workspace(#[from] workspace::WorkspaceError),
    #[error(transparent)]
    Plugin(#[from] plugins::PluginError),
    #[error(transparent)]
    Playground(#[from] playground::PlaygroundError),
    #[error(transparent)]
    Test(#[from] test::TestError),
    #[error(transparent)]
    Emulated(#[from] emulated::EmulatedError),
    #[error(transparent)]
    Windows(#[from] windows::WindowsError),
    #[error(transparent)]
    CodeMutants(#[from] code_mutants::CodeMutantsError),
    #[error(transparent)]
    MutantCopy(#[from] mutants::CopyError),
    #[error(transparent)]
    Fuzz(#[from] fuzz::FuzzError),
    #[error(transparent)]
    Bench(#[from] bench::BenchError),
    #[error(transparent)]
    Book(#[from] book::BookError),
    #[error(transparent)]
    Nc(#[from] nc::NcError),
}
