//! A plug-in on a port: what the verbs that run one share.

pub(crate) mod machine;
pub(crate) mod progress;

use std::path::Path;

use serde::Serialize;
use softplug_abi::NoteLevel;
use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_live::port::line_text;
use softplug_live::station::{Station, StationError, StationOptions};
use softplug_live::transfer::{Note, Reception, TransferError};
use softplug_live::{Port, PortOptions, PortSpec};
use softplug_trial::reason;

use crate::exit::Exit;
use crate::failure::Failure;
use crate::line::{Carrier, ChosenLine, LinkArguments};
use crate::numbers;
use crate::plugin::{AnyFault, AnyInstance, Chosen};
use crate::screen::Screen;

/// Something that came besides, and was kept.
#[derive(Serialize)]
pub(crate) struct KeptDocument {
    pub(crate) result: &'static str,
    pub(crate) bytes: u64,
    pub(crate) file: Option<String>,
    /// The name that the machine gave.
    pub(crate) name: Option<String>,
    pub(crate) failure: Option<&'static str>,
}

/// Something that the plug-in said.
#[derive(Serialize)]
pub(crate) struct NoteDocument {
    pub(crate) level: &'static str,
    pub(crate) code: u16,
    pub(crate) text: String,
}

/// Opens the port and says what is to be known of its line.
pub(crate) fn open(
    spec: &PortSpec,
    options: &PortOptions,
    line: &ChosenLine,
    screen: &Screen,
) -> Result<Port, Failure> {
    let port = Port::open(spec, options)?;
    let carrier = match &port {
        Port::Tcp(_) => Carrier::Raw,
        port if port.is_pty() => Carrier::Pty,
        Port::Tty(_) | Port::Rfc2217(_) | Port::Pty(_) => Carrier::Port,
    };
    if let Some(remark) = line.remark(carrier) {
        screen.note(format_args!("note: {remark}"));
    }
    // Of a pty the one line has said it.
    for difference in port.differences().iter().filter(|_| carrier != Carrier::Pty) {
        screen.note(format_args!("note: the port has other settings: {difference}"));
    }
    if let Some(path) = port.slave_path() {
        screen.note(format_args!("the other side may open {}", path.display()));
    }
    tracing::info!(port = %spec, line = line_text(&port.line()), "open");
    Ok(port)
}

/// The plug-in on the port. It is given room for deliveries if they have a place.
pub(crate) fn station(
    spec: &PortSpec,
    link: &LinkArguments,
    plugin: &Chosen,
    settings: SettingValues,
    takes_deliveries: bool,
    screen: &Screen,
) -> Result<Station<AnyInstance>, Failure> {
    // Compiled before the port is touched.
    let instance = plugin.instantiate()?;
    let line = link.line(plugin.manifest(), &settings);
    let port = open(spec, &link.port_options(line.line), &line, screen)?;
    let mut options = StationOptions { settings, depth: link.depth, ..StationOptions::default() };
    if !takes_deliveries {
        options.delivery_room = 0;
    }
    Ok(Station::new(port, instance, options)?)
}

/// Of a transfer that wrote no files.
pub(crate) fn transfer_failure(error: TransferError<AnyFault>) -> Failure {
    transfer_failure_at(error, None, None)
}

/// Of one that wrote what came into `out`, and what came besides into `besides`.
pub(crate) fn transfer_failure_at(
    error: TransferError<AnyFault>,
    out: Option<&Path>,
    besides: Option<&Path>,
) -> Failure {
    let into = |path: Option<&Path>| {
        path.map(|path| format!(" into {}", path.display())).unwrap_or_default()
    };
    match error {
        TransferError::Station(StationError::Port(error)) => error.into(),
        TransferError::Station(StationError::Plugin(fault)) => {
            Failure::new(Exit::Failed, format_args!("the plug-in cannot go on: {fault}"))
        }
        TransferError::Source(_) => Failure::usage(error),
        TransferError::Sink(error) => Failure::usage(format_args!(
            "what was received cannot be written{}: {error}",
            into(out)
        )),
        TransferError::Besides(error) => Failure::usage(format_args!(
            "what came besides cannot be written{}: {error}",
            into(besides)
        )),
    }
}

/// Says what the plug-in said, as far as it matters; with the words of the
/// manifest where its code is a status.
pub(crate) fn say_notes(notes: &[Note], manifest: &Manifest, screen: &Screen) {
    for note in notes.iter().filter(|note| note.level <= NoteLevel::Warning) {
        let text = note.text.escape_debug();
        match manifest.status(note.code) {
            Some(status) => screen.note(format_args!(
                "{}: {} {} ({text})",
                note.level,
                status.name.escape_debug(),
                status.text.escape_debug()
            )),
            None => screen.note(format_args!("{}: {text}", note.level)),
        }
    }
}

/// Says what came besides, each with its place.
pub(crate) fn say_kept(kept: &[Reception], manifest: &Manifest, screen: &Screen) {
    for reception in kept {
        let came = numbers::bytes(reception.bytes);
        let place = reception.path.as_ref().map(|path| format!(" into {}", path.display()));
        let place = place.unwrap_or_default();
        match reception.failure {
            None => screen.say(format_args!("received {came} besides{place}")),
            Some((failure, status)) => screen.error(format_args!(
                "a reception besides failed after {came}{place}: {}",
                reason(manifest, failure, status)
            )),
        }
    }
}

pub(crate) fn kept_documents(kept: &[Reception]) -> Vec<KeptDocument> {
    let document = |reception: &Reception| KeptDocument {
        result: if reception.failure.is_none() { "complete" } else { "failed" },
        bytes: reception.bytes,
        file: reception.path.as_ref().map(|path| path.display().to_string()),
        name: reception.name.clone(),
        failure: reception.failure.map(|(failure, _)| failure.name()),
    };
    kept.iter().map(document).collect()
}

pub(crate) fn note_documents(notes: &[Note]) -> Vec<NoteDocument> {
    let document = |note: &Note| NoteDocument {
        level: note.level.name(),
        code: note.code,
        text: note.text.clone(),
    };
    notes.iter().map(document).collect()
}
