//! Short texts of bounded length, and what is done with their bytes.

use core::cell::Cell;
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// The most bytes in it: as long as a delivery's name may be.
pub(crate) const MOST: usize = 128;

/// Moves all bytes so far to the front; the first ones fall away.
#[inline(never)]
pub(crate) fn shift(bytes: &mut [u8], count: usize) {
    let cells = Cell::from_mut(bytes).as_slice_of_cells();
    for (to, from) in cells.iter().zip(cells.get(count..).unwrap_or_default()) {
        to.set(from.get());
    }
}

/// A text without the blanks around it.
#[inline(never)]
pub(crate) fn trimmed(text: &[u8]) -> &[u8] {
    text.trim_ascii()
}

/// Up to [`MOST`] bytes.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct Short {
    length: u8,
    bytes: [u8; MOST],
}

impl Short {
    /// Appends a byte; one that finds no place is dropped.
    #[inline(never)]
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
