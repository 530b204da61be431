//! `softplug send --dry-run`: what would be on the wire, in virtual time, with a partner that wants
//! it.

use std::path::Path;

use data_encoding::HEXLOWER;
use softplug_abi::{Failure as Why, LineParameters, Micros};
use softplug_live::pacer::default_depth;
use softplug_live::port::line_text;
use softplug_machines::pulse_lathe::{Lathe, LatheReport};
use softplug_trial::{Budget, End, Note, Setup, Side, Trial, Tried, WAITS, reason};

use super::{Arguments, Document, LatheDocument, Piece, Prepared, StatusDocument, check_message};
use crate::assignment::Assignment;
use crate::dump::Dump;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::live::NoteDocument;
use crate::numbers;
use crate::screen::Screen;

pub(super) fn run(
    arguments: &Arguments,
    prepared: Prepared,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let Prepared { mut program, plugin, settings, job_kind, fields, .. } = prepared;
    let manifest = plugin.manifest();
    let line = arguments.link.line(manifest, &settings).line;
    let name = program.name.clone();
    let texts: Vec<_> = arguments.fields.iter().map(Assignment::as_pair).collect();
    let setup = Setup {
        depth: arguments.link.depth.unwrap_or_else(|| default_depth(line.baud)),
        job_kind,
        records: &fields,
        fields: &texts,
        ..Setup::new(manifest, &settings, line)
    };
    let trial = Trial::new(setup, || plugin.new_instance(), Budget::endless());
    let tried = trial.run(&mut program.file, program.size);
    let tried = tried.map_err(|error| Failure::trial(error, &name))?;
    if let Some(picture) = &arguments.picture {
        draw(tried.lathe.as_deref(), picture)?;
    }
    let Tried { end, supplied, wire, dialogue, answered, took, notes, lathe } = tried;
    let status = match end {
        Some(End::Failed { status, .. } | End::CheckFailed { status, .. }) => status,
        Some(End::Done) | None => 0,
    };
    let (exit, result, failure, message) = match end {
        Some(End::Done) => (Exit::Done, "done", None, None),
        Some(End::Failed { failure, status }) => {
            let reason = reason(manifest, failure, status);
            let message = format!("the transfer would fail: {reason}");
            (Exit::Failed, "failed", Some(failure), Some(message))
        }
        Some(End::CheckFailed { failure, status, line, column }) => {
            let message = check_message(manifest, &name, failure, status, line, column);
            (Exit::Failed, "check-failed", Some(failure), Some(message))
        }
        None => (Exit::Incomplete, "incomplete", None, Some(WAITS.to_owned())),
    };
    show(arguments, screen, &wire, &dialogue, line, took);
    if let Some(lathe) = &lathe {
        screen.note(said(lathe.report()));
    }
    if let Some(message) = &message {
        screen.error(message);
    }
    screen.document(&Document {
        result,
        bytes: supplied,
        sent: wire.len() as u64,
        may_have_left: None,
        seconds: took.as_secs_f64(),
        held_seconds: 0.0,
        holds: 0,
        gaps: 0,
        longest_gap_seconds: 0.0,
        answered: Some(answered).filter(|answered| *answered > 0),
        kept: Vec::new(),
        refused: 0,
        received: 0,
        file: None,
        answer: None,
        lathe: lathe.map(|lathe| LatheDocument::of(lathe.report())),
        failure: failure.map(Why::name),
        status: StatusDocument::new(manifest, status),
        message,
        wire: Some(HEXLOWER.encode(&wire)),
        exchange: dialogue.iter().map(piece).collect(),
        notes: notes.into_iter().map(NoteDocument::of).collect(),
    });
    Ok(exit)
}

fn draw(lathe: Option<&Lathe>, file: &Path) -> Result<(), Failure> {
    let Some(lathe) = lathe else {
        return Err(Failure::usage("--picture: this plug-in's programs are no feed pulses"));
    };
    files::write_picture(file, &lathe.picture(), "--picture")
}

impl NoteDocument {
    fn of(note: Note) -> Self {
        Self { level: note.level.name(), code: note.code, text: note.text }
    }
}

impl LatheDocument {
    fn of(report: &LatheReport) -> Self {
        Self {
            x_millimetres: report.x_millimetres(),
            z_millimetres: report.z_millimetres(),
            x_pulses: report.x_pulses,
            z_pulses: report.z_pulses,
            cut_while_still: report.cut_while_still,
        }
    }
}

fn said(report: &LatheReport) -> String {
    let mut text = format!(
        "ends at x {:+.3} mm (radius), z {:+.2} mm from where it began: {} pulses of x, {} of z",
        report.x_millimetres(),
        report.z_millimetres(),
        numbers::count(report.x_pulses),
        numbers::count(report.z_pulses)
    );
    if report.cut_while_still > 0 {
        text += "; it would cut while the spindle stands still: there is no S before";
    }
    text
}

/// A piece of the dialogue, for machines.
fn piece((side, bytes): &(Side, Vec<u8>)) -> Piece {
    let from = match side {
        Side::Us => "plug-in",
        Side::Partner => "partner",
    };
    Piece { from, hex: HEXLOWER.encode(bytes) }
}

fn show(
    arguments: &Arguments,
    screen: &Screen,
    wire: &[u8],
    dialogue: &[(Side, Vec<u8>)],
    line: LineParameters,
    took: Micros,
) {
    if arguments.raw {
        Screen::raw(wire);
        return;
    }
    if wire.is_empty() {
        return;
    }
    if dialogue.is_empty() && arguments.picture.is_none() {
        screen.say(Dump(wire));
    }
    for (side, bytes) in dialogue {
        // As in a trace: what the partner is sent, and what it says.
        let arrow = if *side == Side::Us { '>' } else { '<' };
        for line in Dump(bytes).to_string().lines() {
            screen.say(format_args!("{arrow} {line}"));
        }
    }
    if !screen.is_json() {
        screen.note(format_args!(
            "{} on the wire, at least {:.3} s at {}",
            numbers::bytes(wire.len() as u64),
            took.as_secs_f64(),
            line_text(&line)
        ));
    }
}
