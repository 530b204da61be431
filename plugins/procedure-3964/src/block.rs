//! Bytes of bounded number, in place.

use softplug_abi::wire::copy;
use softplug_plugin::{StateError, StateReader, StateWriter};

/// Up to `N` bytes.
#[derive(Clone, Debug)]
#[repr(C)]
pub(crate) struct Block<const N: usize> {
    length: u16,
    bytes: [u8; N],
}

impl<const N: usize> Block<N> {
    pub(crate) const fn new() -> Self {
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

    /// Forgets all but the first bytes.
    pub(crate) fn truncate(&mut self, length: u16) {
        self.length = self.length.min(length);
    }

    /// Appends a byte; `false`: it is full.
    pub(crate) fn push(&mut self, byte: u8) -> bool {
        self.extend(&[byte])
    }

    /// Appends bytes; `false`: not all of them fitted.
    pub(crate) fn extend(&mut self, bytes: &[u8]) -> bool {
        append(&mut self.bytes, &mut self.length, bytes)
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
        if self.extend(state.bytes(length)) { Ok(()) } else { Err(StateError::DAMAGED) }
    }
}

/// Once for blocks of all sizes.
#[inline(never)]
fn append(block: &mut [u8], length: &mut u16, bytes: &[u8]) -> bool {
    let free = block.get_mut(usize::from(*length)..).unwrap_or_default();
    let fits = bytes.len() <= free.len();
    *length += bytes.len().min(free.len()) as u16;
    copy(free, bytes);
    fits
}
