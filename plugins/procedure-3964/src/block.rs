//! Bytes of bounded number, in place.

use softplug_plugin::{StateError, StateReader, StateWriter};

/// Up to `N` bytes.
#[derive(Clone, Debug)]
pub(crate) struct Block<const N: usize> {
    bytes: [u8; N],
    length: u16,
}

impl<const N: usize> Block<N> {
    pub(crate) fn new() -> Self {
        Self { bytes: [0; N], length: 0 }
    }

    pub(crate) fn as_slice(&self) -> &[u8] {
        self.bytes.get(..usize::from(self.length)).unwrap_or_default()
    }

    pub(crate) fn len(&self) -> u16 {
        self.length
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.length == 0
    }

    pub(crate) fn clear(&mut self) {
        self.length = 0;
    }

    /// Appends a byte; `false`: it is full.
    pub(crate) fn push(&mut self, byte: u8) -> bool {
        let place = self.bytes.get_mut(usize::from(self.length));
        let fits = place.is_some();
        if let Some(place) = place {
            *place = byte;
            self.length += 1;
        }
        fits
    }

    /// Appends bytes; `false`: not all of them fitted.
    #[inline(never)]
    pub(crate) fn extend(&mut self, bytes: &[u8]) -> bool {
        bytes.iter().all(|byte| self.push(*byte))
    }

    /// Overwrites a byte that is there.
    pub(crate) fn set(&mut self, at: usize, byte: u8) {
        if let Some(place) = self.bytes.get_mut(at) {
            *place = byte;
        }
    }

    pub(crate) fn save(&self, state: &mut StateWriter<'_>) {
        state.u16(self.length);
        state.bytes(self.as_slice());
    }

    pub(crate) fn restore(&mut self, state: &mut StateReader<'_>) -> Result<(), StateError> {
        let length = usize::from(state.u16());
        self.clear();
        if self.extend(state.bytes(length)) { Ok(()) } else { Err(StateError) }
    }
}
