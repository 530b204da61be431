//! `softplug send --dry-run`: what would be on the wire, in virtual time, with a partner that wants
//! it.

use std::io::{self, Read, Seek};

use softplug_abi::{Action, Failure as Why, Instance, LineParameters, Micros};
use softplug_conformance::closed_loop::ClosedLoop;
use softplug_gateway::pacer::default_depth;
use softplug_gateway::port::line_text;
use softplug_link::{Job, LinkFault, LinkHost, LinkOptions, Supply};

use super::send::{
    Arguments, Document, NoteDocument, Piece, Prepared, StatusDocument, check_message, reason,
};
use super::willing::{Exchange, Side, Willing};
use crate::dump::{Dump, hex};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::Program;
use crate::numbers;
use crate::screen::Screen;

const JOB: u32 = 1;
/// A plug-in that sends nothing for so long waits for a partner that is not there.
const PATIENCE: Micros = Micros::from_secs(3_600);

pub(super) fn run(
    arguments: &Arguments,
    prepared: Prepared,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let Prepared { program, plugin, settings, job_kind, fields, check } = prepared;
    let manifest = plugin.manifest();
    let line = arguments.link.line(manifest, &settings).line;
    let name = program.name.clone();
    let partner = Willing::new(manifest, &settings, line, &arguments.fields)?;
    let is_dialogue = partner.is_dialogue();
    let mut paper = Paper::new(program, partner.exchange());

    let options = LinkOptions { line, settings, ..LinkOptions::default() };
    let depth = arguments.link.depth.unwrap_or_else(|| default_depth(line.baud));
    let mut both = ClosedLoop::new(plugin.instantiate()?, options, depth as usize, partner);
    let job = Job { id: JOB, kind: job_kind, size: Some(paper.size), fields, check };
    let ran = (|| {
        both.line.link.open(Micros::ZERO, &mut paper)?;
        both.line.link.begin_job(Micros::ZERO, job, &mut paper)?;
        both.settle(&mut paper)?;
        while paper.end.is_none() && paper.error.is_none() {
            let limit = paper.last + PATIENCE;
            if !both.step(limit, &mut paper)? {
                break;
            }
            paper.refuse(&mut both)?;
        }
        Ok(both.now())
    })();
    let took = ran.map_err(|fault: LinkFault<_>| {
        Failure::new(Exit::Failed, format_args!("the plug-in cannot go on: {fault}"))
    })?;
    if let Some(error) = paper.error {
        return Err(Failure::usage(format_args!("cannot read {name}: {error}")));
    }
    let status = match paper.end {
        Some(End::Failed(_, status) | End::CheckFailed(_, status, ..)) => status,
        Some(End::Done) | None => 0,
    };
    let (exit, result, failure, message) = match paper.end {
        Some(End::Done) => (Exit::Done, "done", None, None),
        Some(End::Failed(why, status)) => {
            let message = format!("the transfer would fail: {}", reason(manifest, why, status));
            (Exit::Failed, "failed", Some(why), Some(message))
        }
        Some(End::CheckFailed(why, status, row, column)) => {
            let message = check_message(manifest, &name, why, status, row, column);
            (Exit::Failed, "check-failed", Some(why), Some(message))
        }
        None => {
            let message = "the plug-in waits for something that only a real partner sends";
            (Exit::Incomplete, "incomplete", None, Some(message.to_owned()))
        }
    };
    let dialogue = if is_dialogue { paper.exchange.pieces() } else { Vec::new() };
    show(arguments, screen, &paper.wire, &dialogue, line, took);
    if let Some(message) = &message {
        screen.error(message);
    }
    screen.document(&Document {
        result,
        bytes: paper.supplied,
        sent: paper.wire.len() as u64,
        may_have_left: None,
        seconds: took.as_secs_f64(),
        held_seconds: 0.0,
        holds: 0,
        answered: Some(paper.answered).filter(|answered| *answered > 0),
        kept: Vec::new(),
        refused: 0,
        received: 0,
        file: None,
        answer: None,
        failure: failure.map(Why::name),
        status: StatusDocument::new(manifest, status),
        message,
        wire: Some(hex(&paper.wire)),
        exchange: dialogue.iter().map(piece).collect(),
        notes: paper.notes,
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

enum End {
    Done,
    Failed(Why, u16),
    /// Why, status, line, column.
    CheckFailed(Why, u16, u32, u32),
}

/// The host's side of the job, and the wire.
struct Paper {
    program: Program,
    size: u64,
    supplied: u64,
    wire: Vec<u8>,
    /// When something last left.
    last: Micros,
    exchange: Exchange,
    /// Bytes that answered the job.
    answered: u64,
    requests: Vec<u32>,
    end: Option<End>,
    error: Option<io::Error>,
    notes: Vec<NoteDocument>,
    drained: u32,
}

impl Paper {
    fn new(program: Program, exchange: Exchange) -> Self {
        Self {
            size: program.size,
            program,
            supplied: 0,
            wire: Vec::new(),
            last: Micros::ZERO,
            exchange,
            answered: 0,
            requests: Vec::new(),
            end: None,
            error: None,
            notes: Vec::new(),
            drained: 0,
        }
    }

    /// What the partner asks for beside the job is not to be had.
    fn refuse<I: Instance>(
        &mut self,
        both: &mut ClosedLoop<I, Willing>,
    ) -> Result<(), LinkFault<I::Fault>> {
        for request in std::mem::take(&mut self.requests) {
            both.line.link.answer(both.now(), request, Err(Why::NotSupported), self)?;
            both.settle(self)?;
        }
        Ok(())
    }
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl LinkHost for Paper {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::JobDone { .. } => self.end = Some(End::Done),
            Action::JobFailed { failure, status, .. } => {
                self.end = Some(End::Failed(*failure, *status));
            }
            Action::CheckResult { failure: Some(failure), status, line, column, .. } => {
                self.end = Some(End::CheckFailed(*failure, *status, *line, *column));
            }
            Action::Deliver { bytes, .. } => {
                self.drained += bytes.len() as u32;
                self.answered += bytes.len() as u64;
            }
            Action::Request { request, .. } => self.requests.push(*request),
            Action::Note { level, code, text } => self.notes.push(NoteDocument {
                level: level.name(),
                code: *code,
                text: (*text).to_owned(),
            }),
            Action::Transmit { .. }
            | Action::TransmitUrgent { .. }
            | Action::Hold
            | Action::Release
            | Action::Discard
            | Action::SetTimer { .. }
            | Action::CancelTimer { .. }
            | Action::ModemLines { .. }
            | Action::Break { .. }
            | Action::Want { .. }
            | Action::DeliveryBegin { .. }
            | Action::DeliveryName { .. }
            | Action::DeliveryEnd { .. }
            | Action::CheckResult { .. }
            | Action::Withdraw { .. }
            | Action::State { .. }
            | Action::Saved { .. } => {}
        }
    }

    fn supply(&mut self, _job: u32, buffer: &mut [u8]) -> Supply {
        if self.error.is_some() {
            return Supply::Later;
        }
        match self.program.file.read(buffer) {
            Ok(0) => Supply::End,
            Ok(count) => {
                self.supplied += count as u64;
                Supply::Bytes(count)
            }
            Err(error) => {
                self.error = Some(error);
                Supply::Later
            }
        }
    }

    fn rewind(&mut self, _job: u32) {
        self.supplied = 0;
        if let Err(error) = self.program.file.rewind() {
            self.error = Some(error);
        }
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }

    fn on_wire(&mut self, start: Micros, byte: u8) {
        self.last = start;
        self.wire.push(byte);
        self.exchange.add(Side::Us, start, byte);
    }
}
