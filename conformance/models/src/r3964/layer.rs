//! What a layer on top sees of a station: blocks go down, and it is told what became
//! of them and which have come.

use super::frame::{NAK, block};
use super::outgoing::Part;
use super::rules::{Procedure, Rule};
use super::state::State;
use super::{Quiet, Station};
use crate::model::{Conditions, Effect};
use softplug_abi::Failure;

/// What a layer is told.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Report {
    /// Our block is acknowledged; so many characters left for it.
    Sent(u64),
    /// Our block has failed.
    Failed {
        /// Why.
        failure: Failure,
        /// Its status number.
        status: u16,
        /// Characters that left for it.
        sent: u64,
        /// Where that stands.
        clause: &'static str,
    },
    /// A good block has come.
    Received(Vec<u8>),
}

impl Station {
    /// One that carries telegrams. What is delivered is the layer's, and so is the
    /// host's room.
    pub(crate) fn of_telegrams(conditions: &Conditions) -> Option<Self> {
        Self::new(Procedure::Rk512, conditions, u32::MAX)
    }

    /// One that carries plain blocks, as the layer is off.
    pub(crate) fn without_layer(conditions: &Conditions) -> Option<Self> {
        Self::new(Procedure::Rk512, conditions, conditions.delivery_room)
    }

    /// A block to send; there is one at a time.
    pub(crate) fn send(&mut self, data: &[u8]) {
        self.take_job(self.jobs + 1, "send", data);
    }

    /// Whether there is no buffer.
    pub(crate) fn set_full(&mut self, is_full: bool) {
        self.is_full = is_full;
    }

    /// The block that it has is no longer to be sent.
    pub(crate) fn abort_sending(&mut self, has_sent: bool) {
        self.abort_behind(self.jobs, has_sent);
    }

    /// Forgets the block that it has begun again just now, as it gave way before, and
    /// tells how many characters had left for it.
    pub(crate) fn forget_block(&mut self) -> u64 {
        self.job = None;
        self.out.take_back();
        self.state = State::Idle;
        // An STX from before may still wait for the port.
        self.out.leaving()
    }

    /// One NAK, as an abort sends it between two blocks.
    pub(crate) fn say_nak(&mut self) {
        self.out.send(&[NAK], Part::Answer, Rule::Abort);
    }

    /// Whether nothing is under way.
    pub(crate) fn is_idle(&self) -> bool {
        self.state == State::Idle
    }

    /// Whether a block may begin at once.
    pub(crate) fn may_begin(&self) -> bool {
        self.state == State::Idle && self.quiet == Quiet::No
    }

    /// Whether our block gave way and has begun again since it was asked last: both may be
    /// in one instant.
    pub(crate) fn takes_begun_again(&mut self) -> bool {
        std::mem::take(&mut self.begun_again)
    }

    /// Whether our block has left and is not acknowledged.
    pub(crate) fn awaits_acknowledgement(&self) -> bool {
        matches!(self.state, State::WaitingForAcknowledgement { .. })
    }

    /// A block as the partner sends it, behind its set-up.
    pub(crate) fn framed(&self, data: &[u8]) -> Vec<u8> {
        block(&self.parameters, data)
    }

    /// Whether a DLE of data goes twice.
    pub(crate) fn doubles(&self) -> bool {
        self.parameters.doubling
    }

    /// µs of so many characters.
    pub(crate) fn characters(&self, count: u64) -> i64 {
        self.parameters.line.characters(count).0
    }

    /// Whether it has a block of ours.
    pub(crate) fn has_block(&self) -> bool {
        self.job.is_some()
    }

    /// What happened since it was asked last.
    pub(crate) fn reports(&mut self) -> Vec<Report> {
        let procedure = self.parameters.procedure;
        let report = |(rule, effect)| match effect {
            Effect::Done { sent, .. } => Some(Report::Sent(sent)),
            Effect::Failed { failure, status, sent, .. } => {
                Some(Report::Failed { failure, status, sent, clause: procedure.clause(rule) })
            }
            Effect::Delivered { bytes, failure: None, .. } => Some(Report::Received(bytes)),
            // A reception that failed leaves nothing.
            _ => None,
        };
        self.awaited.take().into_iter().filter_map(report).collect()
    }
}
