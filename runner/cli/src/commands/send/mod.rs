//! `softplug send`: a program from a file to a machine.

mod dry_run;
mod transfer;

pub(super) use transfer::exit_of;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use softplug_abi::Failure as Why;
use softplug_abi::manifest::{FieldError, Kind, Manifest, SettingValues};
use softplug_live::PortSpec;
use softplug_live::store::Inbox;
use softplug_trial::Refused;

use crate::assignment::{Assignment, field};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::{Partial, Program, no_folder};
use crate::guess::nearest;
use crate::line::{LinkArguments, port};
use crate::live::{KeptDocument, NoteDocument};
use crate::plugin::{Chosen, SEND};
use crate::screen::Screen;

/// Sends a file through a plug-in, or carries out another of its jobs.
///
/// `softplug inspect PLUGIN` lists the jobs and their fields. A job that reads needs no file; what
/// it brings goes to --out, or is shown.
///
/// Ctrl-C aborts cleanly: nothing more of the program leaves, and the machine gets what the
/// protocol has for that. A second Ctrl-C ends at once.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug send --port /dev/ttyUSB0 --machine haas-vf O0001.nc
  softplug send --port /dev/ttyUSB0 --line \"4800 7E2\" --plugin xon-xoff O0001.nc
  softplug send --port tcp://10.0.0.7:4001 --plugin xon-xoff --set wait_for_xon=on O0001.nc
  softplug send --port /dev/ttyUSB0 --plugin r3964 --keep from-partner telegram.bin
  softplug send --dry-run --plugin r3964 telegram.bin
  softplug send --dry-run --plugin pulse-lathe --set input=iso --picture part.svg O0001.nc
  softplug send --dry-run --plugin xon-xoff --set feed_start=\"12\" O0001.nc
  softplug send --port /dev/ttyUSB0 --line \"4800 7E2\" --plugin fanuc-rs232 --field from_block=120 O0001.nc
  softplug send --port /dev/ttyUSB0 --plugin r3964 --set preset=buderus telegram.bin
  softplug send --port /dev/ttyUSB0 --plugin r3964 --set layer=rk512 --job write --field area=DB \\
      --field block=16 --field offset=1 words.bin
  softplug send --port /dev/ttyUSB0 --plugin r3964 --set layer=rk512 --job read --field area=DB \\
      --field block=5 --field offset=10 --field count=7 --out words.bin
  generate | softplug send --port /dev/ttyUSB0 --plugin xon-xoff -")]
pub(crate) struct Arguments {
    /// The port: /dev/ttyUSB0, tcp://HOST:PORT, rfc2217://HOST:PORT or pty:
    #[arg(long, short, value_parser = port, required_unless_present = "dry_run")]
    pub(crate) port: Option<PortSpec>,
    #[command(flatten)]
    pub(crate) link: LinkArguments,
    /// The job to carry out [default: send]
    #[arg(long, short, value_name = "KIND")]
    pub(crate) job: Option<String>,
    /// A field of the job; may be repeated
    #[arg(long = "field", value_name = "NAME=VALUE", value_parser = field)]
    pub(crate) fields: Vec<Assignment>,
    /// Write what the job brings into this file; without it, it is shown
    #[arg(long, short, value_name = "FILE", conflicts_with = "dry_run")]
    pub(crate) out: Option<PathBuf>,
    /// Keep what the partner sends meanwhile in this folder, each as a file of its own; without it
    /// the partner is refused, as far as its protocol has a way to
    #[arg(long, value_name = "DIR", conflicts_with = "dry_run")]
    pub(crate) keep: Option<PathBuf>,
    /// Overwrite the file of --out
    #[arg(long, short, requires = "out")]
    pub(crate) force: bool,
    /// Show what would be on the wire, with a partner that takes it and never holds; no port is
    /// touched
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// With --dry-run: write the bytes to standard output as they are
    #[arg(long, requires = "dry_run", conflicts_with = "json")]
    pub(crate) raw: bool,
    /// With --dry-run of a program of feed pulses: draw the way of the tool and the turned part, as
    /// SVG
    #[arg(long, value_name = "FILE", requires = "dry_run", conflicts_with = "raw")]
    pub(crate) picture: Option<PathBuf>,
    /// The program to send, or the data of the job; - is standard input
    #[arg(value_name = "FILE", required_unless_present = "job")]
    pub(crate) file: Option<PathBuf>,
}

/// A sending that was checked as far as that goes without the port.
pub(crate) struct Prepared {
    pub(crate) program: Program,
    pub(crate) plugin: Chosen,
    pub(crate) settings: SettingValues,
    pub(crate) job_kind: u16,
    /// Fields of the job as value records.
    pub(crate) fields: Vec<u8>,
    pub(crate) check: bool,
}

/// Where a program of feed pulses brings a lathe.
#[derive(Serialize)]
pub(crate) struct LatheDocument {
    /// Where x stands, in mm of radius from where it began.
    pub(crate) x_millimetres: f64,
    pub(crate) z_millimetres: f64,
    pub(crate) x_pulses: u64,
    pub(crate) z_pulses: u64,
    /// Pulses that would cut the default blank while the spindle stands still.
    pub(crate) cut_while_still: u64,
}

/// What machines get.
#[derive(Serialize)]
pub(crate) struct Document<'a> {
    pub(crate) result: &'a str,
    /// Bytes of the program that were taken.
    pub(crate) bytes: u64,
    /// Bytes that left for it.
    pub(crate) sent: u64,
    /// Characters that have left, may have, or may leave yet.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) may_have_left: Option<u64>,
    pub(crate) seconds: f64,
    pub(crate) held_seconds: f64,
    pub(crate) holds: u64,
    /// How often the line stood still for a character or longer although bytes waited.
    pub(crate) gaps: u64,
    pub(crate) longest_gap_seconds: f64,
    /// Bytes that answered the job.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) answered: Option<u64>,
    /// What came meanwhile and was kept.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) kept: Vec<KeptDocument>,
    /// What came meanwhile and had no place: how often the partner was refused.
    pub(crate) refused: u64,
    /// Bytes of it that were dropped all the same.
    pub(crate) received: u64,
    /// The file that holds the answer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) file: Option<String>,
    /// The answer in hex, where no file was given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) answer: Option<String>,
    /// What a dry run's lathe has done, for programs of feed pulses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) lathe: Option<LatheDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) failure: Option<&'a str>,
    /// The protocol's own code of it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) status: Option<StatusDocument>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) message: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) wire: Option<String>,
    /// What was said both ways, where the protocol is a dialogue.
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) exchange: Vec<Piece>,
    #[serde(skip_serializing_if = "<[_]>::is_empty")]
    pub(crate) notes: Vec<NoteDocument>,
}

/// What one side said before the other did.
#[derive(Serialize)]
pub(crate) struct Piece {
    pub(crate) from: &'static str,
    pub(crate) hex: String,
}

/// The protocol's own code of a failure.
#[derive(Serialize)]
pub(crate) struct StatusDocument {
    code: u16,
    /// As the protocol's page writes it: its name, or four hex digits.
    name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    text: Option<String>,
}

impl StatusDocument {
    /// The code in words of the manifest; `None` without one.
    pub(crate) fn new(manifest: &Manifest, status: u16) -> Option<Self> {
        let known = manifest.status(status);
        (status != 0).then(|| Self {
            code: status,
            name: known.map_or_else(|| Self::number(status), |known| known.name.clone()),
            text: known.map(|known| known.text.clone()),
        })
    }

    fn number(status: u16) -> String {
        format!("{status:04X}")
    }
}

pub(crate) fn run(mut arguments: Arguments, screen: &Screen) -> Result<Exit, Failure> {
    // Whatever can be found out before the port is touched is.
    let program = match &arguments.file {
        Some(file) => Program::open(file)?,
        None if arguments.job.as_deref() == Some(SEND) => {
            return Err(Failure::usage("the job \"send\" sends a file: give one"));
        }
        None => Program::nothing()?,
    };
    if let Some(out) = &arguments.out {
        Partial::check(out, arguments.force)?;
    }
    if let Some(keep) = &arguments.keep {
        Inbox::new(keep).map_err(|error| no_folder(keep, &error))?;
    }
    let (plugin, settings) = arguments.link.load()?;
    let manifest = plugin.manifest();
    let job_kind = match &arguments.job {
        Some(job) => kind_of(manifest, job)?,
        None => job_kind(manifest)?,
    };
    let fields = fields(&manifest.jobs[usize::from(job_kind)], &arguments.fields)?;
    let check = manifest.needs.check_pass;
    let prepared = Prepared { program, plugin, settings, job_kind, fields, check };
    match &arguments.port {
        Some(port) if !arguments.dry_run => transfer::send(&arguments, port, prepared, screen),
        _ => dry_run::run(&arguments, prepared, screen),
    }
}

/// The kind of job that sends a program.
pub(crate) fn job_kind(manifest: &Manifest) -> Result<u16, Failure> {
    manifest.job_kind(SEND).ok_or_else(|| {
        Failure::usage(format_args!(
            "the plug-in {} cannot send: it has no job \"send\" (its jobs: {})",
            manifest.name,
            jobs(manifest)
        ))
    })
}

fn kind_of(manifest: &Manifest, job: &str) -> Result<u16, Failure> {
    manifest.job_kind(job).ok_or_else(|| {
        let failure = Failure::usage(format_args!(
            "the plug-in {} has no job \"{job}\"; it has: {}",
            manifest.name,
            jobs(manifest)
        ));
        match nearest(job, manifest.jobs.iter().map(|kind| &*kind.name)) {
            Some(meant) => failure.hint(format_args!("did you mean \"{meant}\"?")),
            None => failure,
        }
    })
}

fn jobs(manifest: &Manifest) -> String {
    let known: Vec<_> = manifest.jobs.iter().map(|kind| kind.name.as_str()).collect();
    if known.is_empty() { "none".to_owned() } else { known.join(", ") }
}

/// The fields as value records, checked against the manifest.
pub(crate) fn fields(kind: &Kind, asked: &[Assignment]) -> Result<Vec<u8>, Failure> {
    let records = kind.records(asked.iter().map(Assignment::as_pair)).and_then(|records| {
        kind.require(&records)?;
        Ok(records)
    });
    records.map_err(|error| {
        let meant = match &error {
            FieldError::Unknown { name, .. } => {
                nearest(name, kind.fields.iter().map(|field| &*field.name))
            }
            _ => None,
        };
        let failure = Failure::usage(format_args!("job {error}"));
        let failure = match &error {
            FieldError::Unknown { .. } | FieldError::Missing { .. } => failure,
            _ => Failure::usage(&error),
        };
        match meant {
            Some(meant) => failure.hint(format_args!("did you mean \"{meant}\"?")),
            None => failure,
        }
    })
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
    Refused { failure, status, place: Some((line, column)) }.message(manifest, name)
}
