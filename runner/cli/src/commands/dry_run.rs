//! `softplug send --dry-run`: what would be on the wire, in virtual time.

use std::io::{self, Read, Seek};

use softplug_abi::manifest::{Manifest, OwnedValue, SettingValues};
use softplug_abi::{Action, Failure as Why, LineParameters, Micros};
use softplug_gateway::pacer::default_depth;
use softplug_gateway::port::line_text;
use softplug_link::{Job, LinkOptions, Outside, Supply, VirtualLine};

use super::send::{Arguments, Document, NoteDocument, Prepared, check_message, reason};
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
    let xon = xon(manifest, &settings);
    let name = program.name.clone();
    let mut paper = Paper::new(program);

    let options = LinkOptions { line, settings, ..LinkOptions::default() };
    let depth = arguments.link.depth.unwrap_or_else(|| default_depth(line.baud));
    let mut wire = VirtualLine::new(plugin.instantiate()?, options, depth as usize);
    let job = Job { id: JOB, kind: job_kind, size: Some(paper.size), fields, check };
    let ran = (|| {
        wire.link.open(Micros::ZERO, &mut paper)?;
        wire.link.begin_job(Micros::ZERO, job, &mut paper)?;
        wire.transmit(Micros::ZERO, &mut paper)?;
        if let Some(xon) = xon {
            let now = line.characters(1);
            wire.run_until(now, &mut paper)?;
            wire.link.received(now, &[xon], &mut paper)?;
            wire.tick(now, &mut paper)?;
        }
        while paper.end.is_none() && paper.error.is_none() {
            let Some(next) = wire.next().filter(|next| *next < paper.last + PATIENCE) else {
                break;
            };
            wire.tick(next.max(wire.link.now()), &mut paper)?;
        }
        Ok(wire.link.now())
    })();
    let took = ran.map_err(|fault: softplug_link::LinkFault<_>| {
        Failure::new(Exit::Failed, format_args!("the plug-in cannot go on: {fault}"))
    })?;
    if let Some(error) = paper.error {
        return Err(Failure::usage(format_args!("cannot read {name}: {error}")));
    }
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
    show(arguments, screen, &paper.wire, line, took);
    if let Some(message) = &message {
        screen.error(message);
    }
    screen.document(&Document {
        result,
        bytes: paper.supplied,
        sent: paper.wire.len() as u64,
        seconds: took.as_secs_f64(),
        held_seconds: 0.0,
        holds: 0,
        answered: None,
        received: 0,
        file: None,
        answer: None,
        failure: failure.map(Why::name),
        message,
        wire: Some(hex(&paper.wire)),
        notes: paper.notes,
    });
    Ok(exit)
}

fn show(arguments: &Arguments, screen: &Screen, wire: &[u8], line: LineParameters, took: Micros) {
    if arguments.raw {
        Screen::raw(wire);
        return;
    }
    if wire.is_empty() {
        return;
    }
    screen.say(Dump(wire));
    if !screen.is_json() {
        screen.note(format_args!(
            "{} on the wire, at least {:.3} s at {}",
            numbers::bytes(wire.len() as u64),
            took.as_secs_f64(),
            line_text(&line)
        ));
    }
}

/// The XON of a partner, where the settings say that one is waited for.
fn xon(manifest: &Manifest, settings: &SettingValues) -> Option<u8> {
    let value = |name: &str| {
        let at = manifest.settings.iter().position(|setting| setting.name == name)?;
        settings.as_slice().get(at)
    };
    match (value("wait_for_xon")?, value("xon")?) {
        (OwnedValue::Bool(true), OwnedValue::Int(xon)) => u8::try_from(*xon).ok(),
        _ => None,
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
    end: Option<End>,
    error: Option<io::Error>,
    notes: Vec<NoteDocument>,
    drained: u32,
}

impl Paper {
    fn new(program: Program) -> Self {
        Self {
            size: program.size,
            program,
            supplied: 0,
            wire: Vec::new(),
            last: Micros::ZERO,
            end: None,
            error: None,
            notes: Vec::new(),
            drained: 0,
        }
    }
}

impl Outside for Paper {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::JobDone { .. } => self.end = Some(End::Done),
            Action::JobFailed { failure, status, .. } => {
                self.end = Some(End::Failed(*failure, *status));
            }
            Action::CheckResult { failure: Some(failure), status, line, column, .. } => {
                self.end = Some(End::CheckFailed(*failure, *status, *line, *column));
            }
            Action::Deliver { bytes, .. } => self.drained += bytes.len() as u32,
            Action::Note { level, code, text } => self.notes.push(NoteDocument {
                level: level.name(),
                code: *code,
                text: (*text).to_owned(),
            }),
            _ => {}
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
    }
}
