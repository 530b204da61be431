//! What the verbs that need Linux say on other systems.

use std::fmt::Display;
use std::path::Path;

use softplug_plan::Measured;

use crate::arguments::Global;
use crate::commands::plan_cell::CellArguments;
use crate::commands::remote::Remote;
use crate::commands::{
    cell, demo, dev, doctor, gateway, job, journal, link, plugin, program, unit,
};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::screen::Screen;

fn nowhere(what: impl Display) -> Failure {
    Failure::new(Exit::Port, format_args!("{what} works on Linux only so far")).hint(
        "`send`, `receive`, `record`, `simulate`, `ports`, `certify` and what needs no port work here",
    )
}

pub(crate) fn gateway(_: &gateway::Arguments, _: &Global, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("the gateway"))
}

pub(crate) fn unit(_: &unit::Arguments, _: &Global, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("a front-end unit"))
}

pub(crate) fn doctor(_: &doctor::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("examining a port"))
}

pub(crate) fn dev(_: &dev::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("swapping on each save"))
}

pub(crate) fn demo(_: &demo::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("the demonstration"))
}

pub(crate) fn cell(_: &cell::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("speaking with a gateway"))
}

pub(crate) fn link(_: &link::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("speaking with a gateway"))
}

pub(crate) fn job(_: &job::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("speaking with a gateway"))
}

pub(crate) fn journal(_: &journal::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("speaking with a gateway"))
}

pub(crate) fn measured(_: &Remote, _: Option<&str>) -> Result<Measured, Failure> {
    Err(nowhere("speaking with a gateway"))
}

pub(crate) fn plan_cell(_: &Path, _: &str, _: &CellArguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("reading a gateway's configuration"))
}

pub(crate) fn program(_: &program::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("speaking with a gateway"))
}

pub(crate) fn plugin(_: &plugin::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("the library of a gateway"))
}
