//! Bytes that are gathered, at most as many as a line has.

use crate::LINE;
use softplug_plugin::{StateError, StateReader, StateWriter};

#[derive(Debug)]
pub(crate) struct Buffer {
    bytes: [u8; LINE],
    length: usize,
}

impl Buffer {
    pub(crate) fn new() -> Self {
        Self {
            bytes: [0; LINE],
            length: 0,
        }
    }

    pub(crate) fn as_slice(&self) -> &[u8] {
        &self.bytes[..self.length]
    }

    /// How many more bytes it can take.
    pub(crate) fn room(&self) -> usize {
        LINE - self.length
    }

    /// Takes a byte; `false` if it is full.
    pub(crate) fn push(&mut self, byte: u8) -> bool {
        let has_room = self.room() > 0;
        if has_room {
            self.bytes[self.length] = byte;
            self.length += 1;
        }
        has_room
    }

    /// Drops its first bytes.
    pub(crate) fn drop_front(&mut self, count: usize) {
        self.bytes.copy_within(count..self.length, 0);
        self.length -= count;
    }

    pub(crate) fn clear(&mut self) {
        self.length = 0;
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u16(self.length as u16);
        state.bytes(self.as_slice());
    }

    /// A saved state may come from anywhere: nothing in it is believed unseen.
    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) -> Result<(), StateError> {
        let length = usize::from(state.u16());
        if length > LINE {
            return Err(StateError::DAMAGED);
        }
        self.clear();
        for byte in state.bytes(length) {
            self.push(*byte);
        }
        Ok(())
    }
}
