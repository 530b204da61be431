//! The host's side of a trial, and what is kept of its wire.

use std::io::{self, Read, Seek};

use softplug_abi::{Action, Failure, Instance, JobId, Micros, RequestId};
use softplug_link::{LinkFault, LinkHost, Supply, WireHost};

use crate::budget::Budget;
use crate::closed_loop::ClosedLoop;
use crate::exchange::{Exchange, Side};
use crate::tried::{End, Note};
use crate::willing::Willing;

/// What a program is read from, as often as the plug-in wants.
trait Source: Read + Seek {}

impl<T: Read + Seek> Source for T {}

/// What is kept of a run.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Keep {
    /// How it ended.
    Nothing,
    /// Also what was on the wire.
    Wire,
    All,
}

/// The host's side of the job, and the wire.
pub(crate) struct Paper<'a> {
    program: &'a mut dyn Source,
    keep: Keep,
    budget: &'a Budget,
    pub(crate) supplied: u64,
    pub(crate) wire: Vec<u8>,
    /// When something last left.
    pub(crate) last: Micros,
    pub(crate) exchange: Exchange,
    /// Bytes that answered the job.
    pub(crate) answered: u64,
    requests: Vec<u32>,
    pub(crate) end: Option<End>,
    pub(crate) error: Option<io::Error>,
    pub(crate) notes: Vec<Note>,
    drained: u32,
}

impl<'a> Paper<'a> {
    pub(crate) fn new(
        program: &'a mut (impl Read + Seek),
        keep: Keep,
        exchange: Exchange,
        budget: &'a Budget,
    ) -> Self {
        Self {
            program,
            keep,
            budget,
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

    /// Nothing more may be tried.
    pub(crate) fn is_spent(&self) -> bool {
        self.budget.left() == 0 || self.budget.is_stopped()
    }

    /// What the partner asks for beside the job is not to be had.
    pub(crate) fn refuse<I: Instance>(
        &mut self,
        both: &mut ClosedLoop<I, Willing>,
    ) -> Result<(), LinkFault<I::Fault>> {
        for request in std::mem::take(&mut self.requests) {
            both.line.link.answer(
                both.now(),
                RequestId(request),
                Err(Failure::NotSupported),
                self,
            )?;
            both.settle(self)?;
        }
        Ok(())
    }
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl LinkHost for Paper<'_> {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::JobDone { .. } => self.end = Some(End::Done),
            Action::JobFailed { failure, status, .. } => {
                let (failure, status) = (*failure, *status);
                self.end = Some(End::Failed { failure, status });
            }
            Action::CheckResult { failure: Some(failure), status, line, column, .. } => {
                let (failure, status, line, column) = (*failure, *status, *line, *column);
                self.end = Some(End::CheckFailed { failure, status, line, column });
            }
            Action::Deliver { bytes, .. } => {
                self.drained += bytes.len() as u32;
                self.answered += bytes.len() as u64;
            }
            Action::Request { request, .. } => self.requests.push(request.0),
            Action::Note { level, code, text } if self.keep == Keep::All => {
                let (level, code, text) = (*level, *code, (*text).to_owned());
                self.notes.push(Note { level, code, text });
            }
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
            | Action::Note { .. }
            | Action::Withdraw { .. }
            | Action::State { .. }
            | Action::Saved { .. } => {}
        }
    }

    fn supply(&mut self, _job: JobId, buffer: &mut [u8]) -> Supply {
        if self.error.is_some() {
            return Supply::Later;
        }
        match self.program.read(buffer) {
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

    fn rewind(&mut self, _job: JobId) {
        self.supplied = 0;
        if let Err(error) = self.program.rewind() {
            self.error = Some(error);
        }
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }
}

impl WireHost for Paper<'_> {
    fn on_wire(&mut self, start: Micros, byte: u8) {
        self.budget.take_character();
        self.last = start;
        if self.keep != Keep::Nothing {
            self.wire.push(byte);
        }
        self.exchange.add(Side::Us, start, byte);
    }
}
