//! The job under way: a command in telegrams.

use super::telegram::{Command, FIRST, FOLLOW_UP, Kind, MOST};
use softplug_abi::{Failure, Micros};
use std::sync::Arc;

/// Why a job fails: the failure, its status and the clause.
pub(super) type Fault = (Failure, u16, &'static str);

/// The job under way.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Job {
    pub(super) id: u32,
    pub(super) command: Command,
    /// Data that no telegram has brought to the partner.
    pub(super) rest: Arc<Vec<u8>>,
    /// Data that reactions have brought.
    pub(super) fetched: Arc<Vec<u8>>,
    /// Telegrams whose reactions have come.
    pub(super) telegrams: usize,
    pub(super) stage: Stage,
    /// The next telegram had begun, and gave way to our reaction.
    pub(super) has_begun: bool,
    pub(super) is_paused: bool,
    /// Characters that have left for it.
    pub(super) sent: u64,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Stage {
    /// The next telegram waits for its turn.
    Ready,
    /// It is on the line.
    OnLine,
    /// It is acknowledged, and its reaction awaited until then.
    Awaiting(Micros),
}

impl Job {
    /// Bytes of data that the telegram under way brings or asks for.
    pub(super) fn part(&self) -> usize {
        match self.command.kind {
            Kind::Send => self.rest.len().min(MOST),
            Kind::Fetch => (self.command.bytes() - self.fetched.len()).min(MOST),
        }
    }

    pub(super) fn telegram(&self) -> Vec<u8> {
        let mut telegram =
            if self.telegrams == 0 { self.command.first() } else { self.command.follow_up() };
        if self.command.kind == Kind::Send {
            telegram.extend(&self.rest[..self.part()]);
        }
        telegram
    }

    /// First byte of the reaction.
    pub(super) fn front(&self) -> u8 {
        if self.telegrams == 0 { FIRST } else { FOLLOW_UP }
    }
}
