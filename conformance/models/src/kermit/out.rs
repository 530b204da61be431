//! What we send.

use crate::model::Broken;
use crate::port::Port;

/// The port with what waits for it, and places in all that it was ever given.
#[derive(Clone, Debug)]
pub(super) struct Out {
    port: Port,
    /// Characters that have ever been queued and not dropped.
    queued: u64,
    left: u64,
    /// The rule by which the latest of them were queued.
    clause: &'static str,
}

impl Out {
    pub(super) fn new(depth: usize) -> Self {
        Self { port: Port::new(depth), queued: 0, left: 0, clause: "kermit.rx.idle" }
    }

    /// These follow all that waits. Returns the place at which they end.
    pub(super) fn send(&mut self, bytes: &[u8], clause: &'static str) -> u64 {
        self.port.send(bytes);
        self.queued += bytes.len() as u64;
        self.clause = clause;
        self.queued
    }

    /// Drops all that the port has not taken; returns how many that were.
    pub(super) fn discard(&mut self) -> u64 {
        let dropped = self.port.waiting() as u64;
        self.port.discard();
        self.queued -= dropped;
        dropped
    }

    pub(super) fn set_gone(&mut self, is_gone: bool) {
        self.port.set_gone(is_gone);
    }

    pub(super) fn begins(&mut self, byte: u8) -> Result<(), Broken> {
        self.port.begins(byte, self.clause)
    }

    pub(super) fn leaves(&mut self) {
        self.port.left();
        self.left += 1;
    }

    /// Whether all up to this place have left.
    pub(super) fn has_left(&self, place: u64) -> bool {
        self.left >= place
    }

    /// Characters up to this place that have not left.
    pub(super) fn remaining(&self, place: u64) -> u64 {
        place.saturating_sub(self.left)
    }

    /// Characters that the port has not taken.
    pub(super) fn waiting(&self) -> usize {
        self.port.waiting()
    }

    pub(super) fn settled(&mut self) -> Result<(), Broken> {
        self.port.settled(self.clause)
    }
}
