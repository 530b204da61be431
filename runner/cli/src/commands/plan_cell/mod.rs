//! What `softplug plan --cell` is given: the programs of a cell, to be replayed without machines.

#[cfg(target_os = "linux")]
mod run;

#[cfg(target_os = "linux")]
pub(super) use run::plan_cell;

use std::path::PathBuf;

use clap::Args;

use crate::assignment::Assignment;

#[derive(Debug, Args)]
pub(crate) struct CellArguments {
    /// Replay programs of this cell instead: the file is a gateway.toml
    #[arg(long, value_name = "NAME", requires = "programs", conflicts_with_all = ["svg", "tried", "from"])]
    pub(crate) cell: Option<String>,
    /// A program that begins at once, with its channel; may be repeated
    #[arg(long = "program", value_name = "CHANNEL=FILE", requires = "cell")]
    pub(crate) programs: Vec<Assignment>,
    /// How fast machines move without cutting, in mm/min
    #[arg(long, value_name = "MM/MIN", default_value_t = 10_000.0, value_parser = rapid)]
    pub(crate) rapid: f64,
    /// Draw who runs and who waits into this file
    #[arg(long, value_name = "FILE", requires = "cell")]
    pub(crate) chart: Option<PathBuf>,
}

fn rapid(text: &str) -> Result<f64, String> {
    let speed = text.parse::<f64>().ok().filter(|speed| (1.0..=1e6).contains(speed));
    speed.ok_or_else(|| "give mm/min from 1 to 1000000".to_owned())
}

#[cfg(not(target_os = "linux"))]
pub(super) fn plan_cell(
    _: &std::path::Path,
    _: &str,
    _: &CellArguments,
    _: &crate::screen::Screen,
) -> Result<crate::exit::Exit, crate::failure::Failure> {
    Err(crate::failure::Failure::only_on_linux("reading a gateway's configuration"))
}
