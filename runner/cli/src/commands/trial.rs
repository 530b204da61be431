//! A job in virtual time, with a partner that wants it.

use std::io::{self, Read, Seek};

use softplug_abi::manifest::SettingValues;
use softplug_abi::{Action, Failure as Why, Instance, LineParameters, Micros};
use softplug_conformance::closed_loop::ClosedLoop;
use softplug_link::{Job, LinkFault, LinkHost, LinkOptions, Supply};
use softplug_machines::pulse_lathe::Lathe;

use super::send::NoteDocument;
use super::willing::{Exchange, Side, Willing};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::Program;
use crate::line::Assignment;
use crate::plugin::Chosen;

/// Of a job that does not end.
pub(super) const WAITS: &str = "the plug-in waits for something that only a real partner sends";

const JOB: u32 = 1;
/// A plug-in that sends nothing for so long waits for a partner that is not there.
const PATIENCE: Micros = Micros::from_secs(3_600);

/// What is tried, but for the program.
pub(super) struct Trial<'a> {
    pub(super) plugin: &'a Chosen,
    pub(super) settings: &'a SettingValues,
    pub(super) line: LineParameters,
    pub(super) depth: u32,
    pub(super) job_kind: u16,
    /// The job's fields, as value records and as they were asked for.
    pub(super) fields: &'a [u8],
    pub(super) asked_fields: &'a [Assignment],
    pub(super) check: bool,
}

/// What came of it.
pub(super) struct Tried {
    /// None: the plug-in waits for something that only a real partner sends.
    pub(super) end: Option<End>,
    /// Bytes of the program that were taken.
    pub(super) supplied: u64,
    pub(super) wire: Vec<u8>,
    /// What was said both ways; empty if the protocol is no dialogue.
    pub(super) dialogue: Vec<(Side, Vec<u8>)>,
    /// Bytes that answered the job.
    pub(super) answered: u64,
    pub(super) took: Micros,
    pub(super) notes: Vec<NoteDocument>,
    /// The lathe that took its pulses, if that is what the program is.
    pub(super) lathe: Option<Box<Lathe>>,
}

/// How a job ended.
pub(super) enum End {
    Done,
    Failed(Why, u16),
    /// Why, status, line, column.
    CheckFailed(Why, u16, u32, u32),
}

impl Trial<'_> {
    pub(super) fn run(&self, program: Program) -> Result<Tried, Failure> {
        let manifest = self.plugin.manifest();
        let name = program.name.clone();
        let partner = Willing::new(manifest, self.settings, self.line, self.asked_fields)?;
        let is_dialogue = partner.is_dialogue();
        let mut paper = Paper::new(program, partner.exchange());
        let settings = self.settings.clone();
        let options = LinkOptions { line: self.line, settings, ..LinkOptions::default() };
        let instance = self.plugin.instantiate()?;
        let mut both = ClosedLoop::new(instance, options, self.depth as usize, partner);
        let fields = self.fields.to_vec();
        let (size, check) = (Some(paper.size), self.check);
        let job = Job { id: JOB, kind: self.job_kind, size, fields, check };
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
        Ok(Tried {
            end: paper.end,
            supplied: paper.supplied,
            wire: paper.wire,
            dialogue: if is_dialogue { paper.exchange.pieces() } else { Vec::new() },
            answered: paper.answered,
            took,
            notes: paper.notes,
            lathe: both.partner.into_lathe(),
        })
    }
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
