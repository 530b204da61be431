//! `softplug receive`: a program from a machine into a file.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use softplug_abi::manifest::SettingValues;
use softplug_gateway::PortSpec;

use super::send::NoteDocument;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::Partial;
use crate::line::{LinkArguments, port};
use crate::live;
use crate::plugin::Chosen;
use crate::screen::Screen;

/// Receives a program into a file.
///
/// What comes is written to FILE.partial, which gets its name when the reception is complete. One
/// that fails, or that Ctrl-C aborts, stays there. With most plug-ins a reception ends after some
/// seconds of quiet; see the plug-in's settings.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug receive --port /dev/ttyUSB0 --line \"4800 7E2\" --plugin xon-xoff --out O0001.nc
  softplug receive --port /dev/ttyUSB0 --plugin xon-xoff --set preset=tape --out O0001.nc
  softplug receive --port pty: --plugin xon-xoff --wait 60 --out O0001.nc")]
pub(crate) struct Arguments {
    /// The port: /dev/ttyUSB0, tcp://HOST:PORT or pty:
    #[arg(long, short, value_parser = port)]
    pub(crate) port: PortSpec,
    #[command(flatten)]
    pub(crate) link: LinkArguments,
    /// The file to write
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Overwrite FILE, and what an earlier reception left of it
    #[arg(long, short)]
    pub(crate) force: bool,
    /// Give up when nothing has come for so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..=604_800))]
    pub(crate) wait: Option<u32>,
}

/// A reception that was checked as far as that goes without the port.
pub(crate) struct Prepared {
    pub(crate) plugin: Chosen,
    pub(crate) settings: SettingValues,
}

/// What machines get.
#[derive(Serialize)]
pub(crate) struct Document<'a> {
    pub(crate) result: &'a str,
    pub(crate) bytes: u64,
    pub(crate) seconds: f64,
    /// Time for which we held the machine.
    pub(crate) held_seconds: f64,
    /// The file that holds what came.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) file: Option<String>,
    /// The name that the machine gave.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) name: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) failure: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) message: Option<String>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) notes: Vec<NoteDocument>,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    Partial::check(&arguments.out, arguments.force)?;
    let plugin = arguments.link.library.load(&arguments.link.plugin)?;
    let settings = plugin.settings(&arguments.link.settings)?;
    live::receive(arguments, Prepared { plugin, settings }, screen)
}
