//! The partner's command under way, and what the host was asked for it.

use super::telegram::{Command, Kind, MOST};
use softplug_abi::Micros;

/// A command of the partner, as far as it has come.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Series {
    pub(super) command: Command,
    /// Bytes of data of the parts before.
    pub(super) done: usize,
    /// The part at `done` was asked for, and its reaction is not acknowledged.
    pub(super) is_open: bool,
    /// That reaction has left, so that the partner may have it.
    pub(super) has_left: bool,
}

impl Series {
    /// Bytes of the next part.
    pub(super) fn part(&self) -> usize {
        (self.command.bytes() - self.done).min(MOST)
    }
}

/// What the host was asked.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Request {
    /// The plug-in's id for it, once it was seen.
    pub(super) id: Option<u32>,
    pub(super) kind: Kind,
    /// Bytes of data that it is about.
    pub(super) part: usize,
    /// First byte of the reaction.
    pub(super) front: u8,
    pub(super) until: Micros,
}
