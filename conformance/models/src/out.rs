//! What a model expects on the line, for protocols that know places in it: what has left when.

use crate::model::Broken;
use crate::port::Port;

/// The port with what waits for it, and places in all that it was ever given.
#[derive(Clone, Debug)]
pub(crate) struct Out {
    port: Port,
    /// Characters that have ever been queued and not dropped.
    queued: u64,
    left: u64,
    /// The rule by which the latest of them were queued.
    clause: &'static str,
    /// What a byte is on the line.
    made: fn(u8) -> u8,
}

impl Out {
    pub(crate) fn new(depth: usize, clause: &'static str) -> Self {
        Self { port: Port::new(depth), queued: 0, left: 0, clause, made: |byte| byte }
    }

    /// Each byte is made so before it waits: with a parity, say.
    pub(crate) fn made_by(self, made: fn(u8) -> u8) -> Self {
        Self { made, ..self }
    }

    /// These follow all that waits. Returns the place at which they end.
    pub(crate) fn send(&mut self, bytes: &[u8], clause: &'static str) -> u64 {
        self.port.send(&bytes.iter().map(|byte| (self.made)(*byte)).collect::<Vec<u8>>());
        self.queued += bytes.len() as u64;
        self.clause = clause;
        self.queued
    }

    /// Drops all that the port has not taken; returns how many that were.
    pub(crate) fn discard(&mut self) -> u64 {
        let dropped = self.port.waiting() as u64;
        self.port.discard();
        self.queued -= dropped;
        dropped
    }

    pub(crate) fn hold(&mut self, is_held: bool) {
        self.port.hold(is_held);
    }

    pub(crate) fn set_gone(&mut self, is_gone: bool) {
        self.port.set_gone(is_gone);
    }

    /// A character begins.
    pub(crate) fn begins(&mut self, byte: u8) -> Result<(), Broken> {
        self.port.begins(byte, self.clause)
    }

    /// The last bit of a character has left.
    pub(crate) fn leaves(&mut self) {
        self.port.left();
        self.left += 1;
    }

    /// Whether all up to this place have left.
    pub(crate) fn has_left(&self, place: u64) -> bool {
        self.left >= place
    }

    /// Characters up to this place that have not left.
    pub(crate) fn remaining(&self, place: u64) -> u64 {
        place.saturating_sub(self.left)
    }

    /// Characters that the port has not taken.
    pub(crate) fn waiting(&self) -> usize {
        self.port.waiting()
    }

    /// Whether nothing has to leave.
    pub(crate) fn is_empty(&self) -> bool {
        self.port.is_empty()
    }

    pub(crate) fn settled(&mut self) -> Result<(), Broken> {
        self.port.settled(self.clause)
    }
}
