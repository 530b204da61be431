//! A short text of bounded length.

use crate::fields::Fields;

/// The most bytes in it: as long as a delivery's name may be.
pub(crate) const MOST: usize = 128;

/// Up to [`MOST`] bytes.
#[derive(Copy, Clone, Debug)]
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

    pub(crate) fn fields(&mut self, fields: &mut Fields<'_, '_>) {
        fields.u8(&mut self.length);
        fields.bytes(&mut self.bytes);
    }
}
