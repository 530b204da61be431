//! `softplug send`: a program from a file to a machine.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use softplug_abi::Failure as Why;
use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_gateway::PortSpec;

use super::dry_run;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::Program;
use crate::line::{LinkArguments, port};
use crate::live;
use crate::plugin::Chosen;
use crate::screen::Screen;

/// Sends a file through a plug-in.
///
/// Ctrl-C aborts cleanly: nothing more of the program leaves, and the machine gets what the
/// protocol has for that. A second Ctrl-C ends at once.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug send --port /dev/ttyUSB0 --line \"4800 7E2\" --plugin xon-xoff O0001.nc
  softplug send --port tcp://10.0.0.7:4001 --plugin xon-xoff --set wait_for_xon=on O0001.nc
  softplug send --dry-run --plugin xon-xoff --set feed_start=\"12\" O0001.nc
  generate | softplug send --port /dev/ttyUSB0 --plugin xon-xoff -")]
pub(crate) struct Arguments {
    /// The port: /dev/ttyUSB0, tcp://HOST:PORT or pty:
    #[arg(long, short, value_parser = port, required_unless_present = "dry_run")]
    pub(crate) port: Option<PortSpec>,
    #[command(flatten)]
    pub(crate) link: LinkArguments,
    /// Show what would be on the wire; no port is touched, and the partner never holds
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// With --dry-run: write the bytes to standard output as they are
    #[arg(long, requires = "dry_run", conflicts_with = "json")]
    pub(crate) raw: bool,
    /// The program to send; - is standard input
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
}

/// A sending that was checked as far as that goes without the port.
pub(crate) struct Prepared {
    pub(crate) program: Program,
    pub(crate) plugin: Chosen,
    pub(crate) settings: SettingValues,
    pub(crate) job_kind: u16,
    pub(crate) check: bool,
}

/// What machines get.
#[derive(Serialize)]
pub(crate) struct Document<'a> {
    pub(crate) result: &'a str,
    /// Bytes of the program that were taken.
    pub(crate) bytes: u64,
    /// Bytes that left for it.
    pub(crate) sent: u64,
    pub(crate) seconds: f64,
    pub(crate) held_seconds: f64,
    pub(crate) holds: u64,
    /// Bytes that came meanwhile and were dropped.
    pub(crate) received: u64,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) failure: Option<&'a str>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) message: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) wire: Option<String>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) notes: Vec<NoteDocument>,
}

/// Something that the plug-in said.
#[derive(Serialize)]
pub(crate) struct NoteDocument {
    pub(crate) level: &'static str,
    pub(crate) code: u16,
    pub(crate) text: String,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    // Whatever can be found out before the port is touched is.
    let program = Program::open(&arguments.file)?;
    let plugin = arguments.link.library.load(&arguments.link.plugin)?;
    let settings = plugin.settings(&arguments.link.settings)?;
    let job_kind = job_kind(plugin.manifest())?;
    let check = plugin.manifest().needs.check_pass;
    let prepared = Prepared { program, plugin, settings, job_kind, check };
    match &arguments.port {
        Some(port) if !arguments.dry_run => live::send(arguments, port, prepared, screen),
        _ => dry_run::run(arguments, prepared, screen),
    }
}

fn job_kind(manifest: &Manifest) -> Result<u16, Failure> {
    manifest.job_kind("send").ok_or_else(|| {
        let known: Vec<_> = manifest.jobs.iter().map(|kind| kind.name.as_str()).collect();
        let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
        Failure::usage(format_args!(
            "the plug-in {} cannot send: it has no job \"send\" (its jobs: {known})",
            manifest.name
        ))
    })
}

/// Why a job failed, in a sentence, with the protocol's own code if it is known.
pub(crate) fn reason(manifest: &Manifest, failure: Why, status: u16) -> String {
    let name = manifest.status.iter().find(|known| known.code == status);
    match (status, name) {
        (0, _) => failure.text().to_owned(),
        (_, Some(known)) => format!("{} ({}: {})", failure.text(), known.name, known.text),
        (_, None) => format!("{} (status {status})", failure.text()),
    }
}

/// A fault that the check found in the program.
pub(crate) fn check_message(
    manifest: &Manifest,
    name: &str,
    failure: Why,
    status: u16,
    line: u32,
    column: u32,
) -> String {
    let place = match (line, column) {
        (0, _) => String::new(),
        (line, 0) => format!(", line {line}"),
        (line, column) => format!(", line {line}, column {column}"),
    };
    format!("{name}{place} cannot be sent: {}", reason(manifest, failure, status))
}
