//! What a partner sends with: characters one behind the other.

use super::Sent;
use crate::hash::Hash128;
use softplug_abi::Micros;
use std::collections::VecDeque;
use std::hash::Hash;

/// A character on the line.
pub(super) const CHARACTER: Micros = Micros(1_000);

/// Characters that wait, and the wire.
#[derive(Clone, Default)]
pub(super) struct Transmitter {
    waiting: VecDeque<u8>,
    /// When the wire takes the next.
    free_at: Micros,
}

impl Transmitter {
    pub(super) fn hash(&self, now: Micros, state: &mut Hash128) {
        (&self.waiting, (self.free_at.0 - now.0).max(0)).hash(state);
    }

    pub(super) fn send(&mut self, bytes: &[u8]) {
        self.waiting.extend(bytes);
    }

    /// When the wire can take what waits.
    pub(super) fn next(&self) -> Option<Micros> {
        (!self.waiting.is_empty()).then_some(self.free_at)
    }

    /// The wire takes the next character if it is free.
    pub(super) fn transmit(&mut self, now: Micros) -> Sent {
        let mut sent = Sent::default();
        if self.free_at <= now
            && let Some(byte) = self.waiting.pop_front()
        {
            self.free_at = now + CHARACTER;
            sent.left.push((self.free_at, byte));
        }
        sent
    }
}
