//! Bytes of the job that are not in a packet yet.

use softplug_plugin::{StateError, StateReader, StateWriter, copy};

/// Most of them.
pub(crate) const ROOM: usize = 512;

/// A queue of bytes.
#[derive(Copy, Clone, Debug)]
pub(crate) struct Data {
    bytes: [u8; ROOM],
    length: u16,
}

impl Data {
    pub(crate) const fn new() -> Self {
        Self { bytes: [0; ROOM], length: 0 }
    }

    pub(crate) fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }

    pub(crate) fn length(&self) -> usize {
        usize::from(self.length)
    }

    /// Takes what fits.
    pub(crate) fn push(&mut self, bytes: &[u8]) {
        let free = self.bytes.get_mut(usize::from(self.length)..).unwrap_or_default();
        let count = bytes.len().min(free.len());
        copy(free, bytes.get(..count).unwrap_or_default());
        self.length += count as u16;
    }

    /// The first ones are in a packet.
    pub(crate) fn drop_first(&mut self, count: usize) {
        let length = self.length();
        if count <= length {
            self.bytes.copy_within(count..length, 0);
            self.length -= count as u16;
        }
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u16(self.length);
        state.bytes(self.as_slice());
    }

    pub(crate) fn restore(state: &mut StateReader<'_>) -> Result<Self, StateError> {
        let length = usize::from(state.u16());
        if length > ROOM {
            return Err(StateError::DAMAGED);
        }
        let mut data = Self::new();
        data.push(state.bytes(length));
        Ok(data)
    }
}
