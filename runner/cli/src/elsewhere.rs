//! What needs ports, on systems where this command has none yet.

use std::fmt::Display;
use std::path::Path;

use softplug_gateway::PortSpec;
use softplug_plan::Measured;

use crate::arguments::Global;
use crate::commands::remote::Remote;
use crate::commands::{
    demo, dev, doctor, gateway, job, link, plugin, program, receive, record, send, simulate,
};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::screen::Screen;

fn nowhere(what: impl Display) -> Failure {
    Failure::new(Exit::Port, format_args!("{what} works on Linux only so far"))
        .hint("`send --dry-run`, `inspect`, `replay` and `trace fmt` work here")
}

pub(crate) fn ports(_: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("listing the ports"))
}

pub(crate) fn gateway(_: &gateway::Arguments, _: &Global, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("the gateway"))
}

pub(crate) fn doctor(_: &doctor::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("examining a port"))
}

pub(crate) fn send(
    _: &send::Arguments,
    _: &PortSpec,
    _: send::Prepared,
    _: &Screen,
) -> Result<Exit, Failure> {
    Err(nowhere("sending to a port"))
}

pub(crate) fn receive(
    _: &receive::Arguments,
    _: &Path,
    _: receive::Prepared,
    _: &Screen,
) -> Result<Exit, Failure> {
    Err(nowhere("receiving from a port"))
}

pub(crate) fn record(
    _: &record::Arguments,
    _: Option<record::Prepared>,
    _: &Screen,
) -> Result<Exit, Failure> {
    Err(nowhere("recording between ports"))
}

pub(crate) fn serve(
    _: &receive::Arguments,
    _: receive::Folders,
    _: receive::Prepared,
    _: &Screen,
) -> Result<Exit, Failure> {
    Err(nowhere("receiving from a port"))
}

pub(crate) fn simulate(_: &simulate::Simulation, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("simulating a machine"))
}

pub(crate) fn dev(_: &dev::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("swapping on each save"))
}

pub(crate) fn demo(_: &demo::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("the demonstration"))
}

pub(crate) fn link(_: &link::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("speaking with a gateway"))
}

pub(crate) fn job(_: &job::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("speaking with a gateway"))
}

pub(crate) fn measured(_: &Remote, _: Option<&str>) -> Result<Measured, Failure> {
    Err(nowhere("speaking with a gateway"))
}

pub(crate) fn program(_: &program::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("speaking with a gateway"))
}

pub(crate) fn plugin(_: &plugin::Arguments, _: &Screen) -> Result<Exit, Failure> {
    Err(nowhere("the library of a gateway"))
}
