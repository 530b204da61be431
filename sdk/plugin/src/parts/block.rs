//! Bytes that are gathered.

use super::move_to_front;
use crate::{State, StateReader, StateWriter};
use softplug_abi::wire::copy;

/// Bytes that are gathered, at most `N` of them, 65,535 at most: a line, a frame, data that waits.
///
/// As a state it is its length in two bytes and the bytes that are there; a length above `N` is refused.
///
/// ```
/// use softplug_plugin::parts::Block;
///
/// let mut line = Block::<8>::new();
/// assert_eq!(line.extend(b"G1 X10 Z5"), 8);
/// assert!(!line.push(b'5'));
/// line.drop_first(3);
/// assert_eq!((line.as_slice(), line.room()), (b"X10 Z".as_slice(), 3));
/// line.truncate(3);
/// line.as_mut_slice()[0] = b'Y';
/// assert_eq!(line.as_slice(), b"Y10");
/// ```
#[derive(Copy, Clone, Debug)]
pub struct Block<const N: usize> {
    bytes: [u8; N],
    length: u16,
}

impl<const N: usize> Block<N> {
    /// None yet; all zeros.
    #[allow(clippy::new_without_default, reason = "it is below, and this is const")]
    pub const fn new() -> Self {
        const { assert!(N <= u16::MAX as usize, "a block has at most 65,535 bytes") };
        Self { bytes: [0; N], length: 0 }
    }

    /// The bytes that are there.
    pub fn as_slice(&self) -> &[u8] {
        self.bytes.get(..self.len()).unwrap_or_default()
    }

    /// The bytes that are there, to be changed.
    pub fn as_mut_slice(&mut self) -> &mut [u8] {
        self.bytes.get_mut(..usize::from(self.length)).unwrap_or_default()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        usize::from(self.length)
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// How many more it can take.
    pub fn room(&self) -> usize {
        N - self.len()
    }

    /// Takes a byte; `false` if it is full.
    pub fn push(&mut self, byte: u8) -> bool {
        let place = self.bytes.get_mut(usize::from(self.length));
        let fits = place.is_some();
        if let Some(place) = place {
            *place = byte;
            self.length += 1;
        }
        fits
    }

    /// Takes as many of these as fit, and tells how many.
    pub fn extend(&mut self, bytes: &[u8]) -> usize {
        let free = self.bytes.get_mut(usize::from(self.length)..).unwrap_or_default();
        let count = bytes.len().min(free.len());
        copy(free, bytes.get(..count).unwrap_or_default());
        self.length += count as u16;
        count
    }

    /// Drops the first bytes: all, if there are fewer.
    pub fn drop_first(&mut self, count: usize) {
        let count = count.min(self.len());
        move_to_front(&mut self.bytes, count, usize::from(self.length));
        self.length -= count as u16;
    }

    /// Drops what stands behind the first `length` bytes.
    pub fn truncate(&mut self, length: usize) {
        self.length = self.len().min(length) as u16;
    }

    /// Drops the last byte.
    pub fn drop_last(&mut self) {
        self.length = self.length.saturating_sub(1);
    }

    /// Drops all.
    pub fn clear(&mut self) {
        self.length = 0;
    }
}

impl<const N: usize> Default for Block<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> PartialEq for Block<N> {
    fn eq(&self, other: &Self) -> bool {
        self.as_slice() == other.as_slice()
    }
}

impl<const N: usize> Eq for Block<N> {}

impl<const N: usize> State for Block<N> {
    fn save(&self, state: &mut StateWriter<'_>) {
        save(&self.bytes, self.length, state);
    }

    fn restore(&mut self, state: &mut StateReader<'_>) {
        self.length = state.u16();
        restore(&mut self.bytes, &mut self.length, state);
    }
}

/// Once for blocks of all lengths, as `restore`.
#[inline(never)]
fn save(bytes: &[u8], length: u16, state: &mut StateWriter<'_>) {
    state.u16(length);
    state.bytes(bytes.get(..usize::from(length)).unwrap_or_default());
}

/// Takes so many bytes.
#[inline(never)]
fn restore(bytes: &mut [u8], length: &mut u16, state: &mut StateReader<'_>) {
    if let Some(place) = bytes.get_mut(..usize::from(*length)) {
        copy(place, state.bytes(place.len()));
    } else {
        *length = 0;
        state.refuse();
    }
}
