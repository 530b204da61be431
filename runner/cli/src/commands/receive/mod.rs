//! `softplug receive`: programs from a machine into a file or a folder.

mod serve;
mod transfer;

use std::path::PathBuf;

use clap::{ArgGroup, Args};
use serde::Serialize;
use softplug_abi::manifest::SettingValues;
use softplug_catalogue::Notations;
use softplug_live::PortSpec;
use softplug_live::store::{Inbox, Shelf};

use super::send::StatusDocument;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::{Partial, no_folder};
use crate::line::{LinkArguments, port};
use crate::live::{KeptDocument, NoteDocument};
use crate::plugin::Chosen;
use crate::screen::Screen;

/// Receives a program into a file, or all that comes into a folder.
///
/// What comes is written to FILE.partial, which gets its name when the reception is complete. One
/// that fails, or that Ctrl-C aborts, is kept as FILE.failed. With most plug-ins a reception ends
/// after some seconds of quiet; see the plug-in's settings. What follows at once, such as the next
/// program of one punch, becomes a file of its own in the same folder.
///
/// With --dir it goes on until Ctrl-C: each delivery becomes a file of its own, under the name that
/// the machine gave or that stands in its text, made safe, or under a number. Nothing is overwritten: O1234 is followed by
/// O1234-2. Failed ones end in .failed. With --programs, a machine that asks for a program is sent
/// the file that is called so, or the one whose text says that name.
#[derive(Debug, Args)]
#[command(
    group(ArgGroup::new("where").args(["out", "dir"]).required(true)),
    after_help = "Examples:
  softplug receive --port /dev/ttyUSB0 --machine haas-vf --out O0001.nc
  softplug receive --port /dev/ttyUSB0 --line \"4800 7E2\" --plugin xon-xoff --out O0001.nc
  softplug receive --port /dev/ttyUSB0 --plugin xon-xoff --set preset=tape --out O0001.nc
  softplug receive --port pty: --plugin xon-xoff --wait 60 --out O0001.nc
  softplug receive --port /dev/ttyUSB0 --plugin r3964 --dir telegrams
  softplug receive --port /dev/ttyUSB0 --line \"4800 7E2\" --plugin fanuc-rs232 --dir from-machine \\
      --programs to-machine"
)]
pub(crate) struct Arguments {
    /// The port: /dev/ttyUSB0, tcp://HOST:PORT, rfc2217://HOST:PORT or pty:
    #[arg(long, short, value_parser = port)]
    pub(crate) port: PortSpec,
    #[command(flatten)]
    pub(crate) link: LinkArguments,
    /// The file to write
    #[arg(long, short, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Overwrite FILE; what a killed reception left is kept as FILE.failed
    #[arg(long, short, conflicts_with = "dir")]
    pub(crate) force: bool,
    /// The folder to write all deliveries into
    #[arg(long, short, value_name = "DIR")]
    pub(crate) dir: Option<PathBuf>,
    /// The folder with programs that the machine may ask for by name
    #[arg(long, value_name = "DIR", conflicts_with = "out")]
    pub(crate) programs: Option<PathBuf>,
    /// End after so many deliveries
    #[arg(long, value_name = "N", conflicts_with = "out", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) count: Option<u64>,
    /// Give up when nothing has come for so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(1..=604_800))]
    pub(crate) wait: Option<u32>,
}

/// A reception that was checked as far as that goes without the port.
pub(crate) struct Prepared {
    pub(crate) plugin: Chosen,
    pub(crate) settings: SettingValues,
}

impl Prepared {
    fn new(link: &mut LinkArguments) -> Result<Self, Failure> {
        let (plugin, settings) = link.load()?;
        Ok(Self { plugin, settings })
    }
}

/// Folders that were found to be there.
pub(crate) struct Folders {
    pub(crate) inbox: Inbox,
    pub(crate) shelf: Option<Shelf>,
    /// How programs say their names.
    pub(crate) notations: Notations,
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
    /// Bytes that came, whatever they were.
    pub(crate) heard: u64,
    /// What came besides, before the port was closed.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) kept: Vec<KeptDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) failure: Option<&'a str>,
    /// The protocol's own code of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) status: Option<StatusDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) message: Option<String>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) notes: Vec<NoteDocument>,
}

pub(crate) fn run(mut arguments: Arguments, screen: &Screen) -> Result<Exit, Failure> {
    if let Some(out) = &arguments.out {
        Partial::check(out, arguments.force)?;
        let prepared = Prepared::new(&mut arguments.link)?;
        return transfer::receive(&arguments, out, prepared, screen);
    }
    let Some(dir) = &arguments.dir else {
        return Err(Failure::internal("neither a file nor a folder was demanded"));
    };
    let inbox = Inbox::new(dir).map_err(|error| no_folder(dir, &error))?;
    let shelf = arguments
        .programs
        .as_ref()
        .map(|programs| Shelf::new(programs).map_err(|error| no_folder(programs, &error)));
    let notations = arguments.link.notations()?;
    let folders = Folders { inbox, shelf: shelf.transpose()?, notations };
    let prepared = Prepared::new(&mut arguments.link)?;
    serve::serve(&arguments, folders, prepared, screen)
}
