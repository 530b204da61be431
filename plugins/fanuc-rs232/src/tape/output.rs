//! What the encoder has made, until it finds room in the queue or in a packet.

use super::MOST_PER_BYTE;
use crate::short::shift;
use zerocopy::{FromZeros, Immutable, IntoBytes};

/// The largest packet, and what the encoder gives beyond it.
const CAPACITY: usize = 1_024 + 2 * MOST_PER_BYTE;

/// Bytes on their way. What finds no place is dropped: in a check all may be.
#[derive(Copy, Clone, Debug, FromZeros, IntoBytes, Immutable)]
#[repr(C)]
pub(crate) struct Output {
    length: u16,
    bytes: [u8; CAPACITY],
}

impl Output {
    pub(super) fn push(&mut self, byte: u8) {
        if let Some(place) = self.bytes.get_mut(usize::from(self.length)) {
            *place = byte;
            self.length += 1;
        }
    }

    pub(crate) fn len(&self) -> usize {
        usize::from(self.length)
    }

    /// The first `count` bytes.
    pub(crate) fn first(&self, count: usize) -> &[u8] {
        self.bytes.get(..count).unwrap_or_default()
    }

    /// The first `count` bytes are not needed any more.
    pub(crate) fn drop_first(&mut self, count: usize) {
        let filled = self.bytes.get_mut(..usize::from(self.length)).unwrap_or_default();
        shift(filled, count);
        self.length = self.length.saturating_sub(count as u16);
    }

    pub(crate) fn clear(&mut self) {
        self.length = 0;
    }
}
