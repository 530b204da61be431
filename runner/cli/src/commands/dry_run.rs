//! `softplug send --dry-run`: what would be on the wire, in virtual time, with a partner that wants
//! it.

use softplug_abi::{Failure as Why, LineParameters, Micros};
use softplug_gateway::pacer::default_depth;
use softplug_gateway::port::line_text;

use super::send::{Arguments, Document, Piece, Prepared, StatusDocument, check_message, reason};
use super::trial::{End, Trial, Tried, WAITS};
use super::willing::Side;
use crate::dump::{Dump, hex};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers;
use crate::screen::Screen;

pub(super) fn run(
    arguments: &Arguments,
    prepared: Prepared,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let Prepared { program, plugin, settings, job_kind, fields, check } = prepared;
    let manifest = plugin.manifest();
    let line = arguments.link.line(manifest, &settings).line;
    let name = program.name.clone();
    let trial = Trial {
        plugin: &plugin,
        settings: &settings,
        line,
        depth: arguments.link.depth.unwrap_or_else(|| default_depth(line.baud)),
        job_kind,
        fields: &fields,
        asked_fields: &arguments.fields,
        check,
    };
    let Tried { end, supplied, wire, dialogue, answered, took, notes } = trial.run(program)?;
    let status = match end {
        Some(End::Failed(_, status) | End::CheckFailed(_, status, ..)) => status,
        Some(End::Done) | None => 0,
    };
    let (exit, result, failure, message) = match end {
        Some(End::Done) => (Exit::Done, "done", None, None),
        Some(End::Failed(why, status)) => {
            let message = format!("the transfer would fail: {}", reason(manifest, why, status));
            (Exit::Failed, "failed", Some(why), Some(message))
        }
        Some(End::CheckFailed(why, status, row, column)) => {
            let message = check_message(manifest, &name, why, status, row, column);
            (Exit::Failed, "check-failed", Some(why), Some(message))
        }
        None => (Exit::Incomplete, "incomplete", None, Some(WAITS.to_owned())),
    };
    show(arguments, screen, &wire, &dialogue, line, took);
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
        failure: failure.map(Why::name),
        status: StatusDocument::new(manifest, status),
        message,
        wire: Some(hex(&wire)),
        exchange: dialogue.iter().map(piece).collect(),
        notes,
    });
    Ok(exit)
}

/// A piece of the dialogue, for machines.
fn piece((side, bytes): &(Side, Vec<u8>)) -> Piece {
    let from = match side {
        Side::Us => "plug-in",
        Side::Partner => "partner",
    };
    Piece { from, hex: hex(bytes) }
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
    if dialogue.is_empty() {
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
