//! A short text of bounded length.

use zerocopy::{FromZeros, Immutable, IntoBytes};

/// The most bytes in it: as long as a delivery's name may be.
pub(crate) const MOST: usize = 128;

/// Up to [`MOST`] bytes.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct Short {
    length: u8,
    bytes: [u8; MOST],
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
}
