//! A short text of bounded length.

use softplug_plugin::{StateReader, StateWriter};

/// The most bytes in it: as long as a delivery's name may be.
pub(crate) const MOST: usize = 128;

/// Up to [`MOST`] bytes.
#[derive(Clone, Debug)]
pub(crate) struct Short {
    bytes: [u8; MOST],
    length: u8,
}

impl Default for Short {
    fn default() -> Self {
        Self { bytes: [0; MOST], length: 0 }
    }
}

impl Short {
    /// Appends a byte; one that finds no place is dropped.
    pub(crate) fn push(&mut self, byte: u8) {
        if let Some(place) = self.bytes.get_mut(usize::from(self.length)) {
            *place = byte;
            self.length += 1;
        }
    }

    pub(crate) fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }

    pub(crate) fn is_full(&self) -> bool {
        usize::from(self.length) == MOST
    }

    pub(crate) fn clear(&mut self) {
        self.length = 0;
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u8(self.length);
        state.bytes(self.as_slice());
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) {
        self.clear();
        let length = state.u8();
        for byte in state.bytes(usize::from(length)) {
            self.push(*byte);
        }
    }
}
