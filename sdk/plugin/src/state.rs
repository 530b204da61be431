//! A converter's state as bytes.

use crate::Context;
use core::fmt;
use softplug_abi::wire::{Reader, copy};
use softplug_abi::{Action, Failure, Micros};

/// A saved state that cannot be taken.
///
/// ```
/// let error = softplug_plugin::StateError;
/// assert_eq!(error.to_string(), "the saved state is of another format or damaged");
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct StateError;

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the saved state is of another format or damaged")
    }
}

impl core::error::Error for StateError {}

/// Largest piece of state in one action, in bytes.
const PIECE: usize = 256;

/// Takes a state field by field. What was written before `skip` is left out, so
/// that a long state needs no buffer of its own.
///
/// ```
/// use softplug_plugin::StateWriter;
///
/// /// A counter and a flag: five bytes.
/// fn save(state: &mut StateWriter<'_>, count: u32, is_held: bool) {
///     state.u32(count);
///     state.bool(is_held);
/// }
/// ```
#[derive(Debug)]
pub struct StateWriter<'a> {
    position: usize,
    skip: usize,
    piece: &'a mut [u8],
    filled: usize,
}

impl StateWriter<'_> {
    /// Writes bytes, without their length.
    pub fn bytes(&mut self, bytes: &[u8]) {
        let skipped = self.skip.saturating_sub(self.position).min(bytes.len());
        let wanted = bytes.get(skipped..).unwrap_or_default();
        let free = self.piece.get_mut(self.filled..).unwrap_or_default();
        self.filled += wanted.len().min(free.len());
        copy(free, wanted);
        self.position += bytes.len();
    }

    /// The lowest bytes of a number.
    #[inline(never)]
    fn number(&mut self, value: u64, count: usize) {
        self.bytes(value.to_le_bytes().get(..count).unwrap_or_default());
    }

    /// Writes one byte.
    pub fn u8(&mut self, value: u8) {
        self.number(u64::from(value), 1);
    }

    /// Writes a flag.
    pub fn bool(&mut self, value: bool) {
        self.u8(u8::from(value));
    }

    /// Writes two bytes.
    pub fn u16(&mut self, value: u16) {
        self.number(u64::from(value), 2);
    }

    /// Writes why something failed, or that it did not.
    pub fn failure(&mut self, value: Option<Failure>) {
        self.u16(value.map_or(0, Failure::code));
    }

    /// Writes four bytes.
    pub fn u32(&mut self, value: u32) {
        self.number(u64::from(value), 4);
    }

    /// Writes eight bytes.
    pub fn u64(&mut self, value: u64) {
        self.number(value, 8);
    }

    /// Writes an instant or span.
    pub fn micros(&mut self, value: Micros) {
        self.u64(value.0.cast_unsigned());
    }

    /// Writes an instant, or that there is none.
    pub fn deadline(&mut self, value: Option<Micros>) {
        self.bool(value.is_some());
        self.micros(value.unwrap_or_default());
    }
}

/// Length in bytes of what `write` writes.
pub(crate) fn measure(write: impl FnOnce(&mut StateWriter<'_>)) -> usize {
    let mut counter = StateWriter { position: 0, skip: 0, piece: &mut [], filled: 0 };
    write(&mut counter);
    counter.position
}

/// Emits pieces from `offset` on, as many as fit; returns the offset after them.
pub(crate) fn emit(
    link: &mut Context<'_>,
    format: u16,
    total: usize,
    mut offset: usize,
    write: impl Fn(&mut StateWriter<'_>),
) -> usize {
    loop {
        let mut piece = [0; PIECE];
        let mut writer = StateWriter { position: 0, skip: offset, piece: &mut piece, filled: 0 };
        write(&mut writer);
        let filled = writer.filled;
        let bytes = piece.get(..filled).unwrap_or_default();
        link.push(&Action::Saved { format, offset: offset as u32, total: total as u32, bytes });
        offset += filled;
        if offset >= total || link.output_room() < PIECE + 16 {
            return offset;
        }
    }
}

/// Gives a state back field by field. A field that is not there reads as zero,
/// and the whole restore then fails.
///
/// ```
/// use softplug_plugin::{StateError, StateReader};
///
/// /// The other way round, in the same order; what cannot be is refused.
/// fn restore(state: &mut StateReader<'_>) -> Result<(u32, bool), StateError> {
///     let (count, is_held) = (state.u32(), state.bool());
///     if count > 1_000 { Err(StateError) } else { Ok((count, is_held)) }
/// }
/// ```
#[derive(Debug)]
pub struct StateReader<'a> {
    reader: Reader<'a>,
}

impl<'a> StateReader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { reader: Reader::new(bytes) }
    }

    /// Reads `count` bytes.
    pub fn bytes(&mut self, count: usize) -> &'a [u8] {
        self.reader.bytes(count)
    }

    /// Reads one byte.
    pub fn u8(&mut self) -> u8 {
        self.reader.u8()
    }

    /// Reads a flag.
    pub fn bool(&mut self) -> bool {
        self.reader.flag()
    }

    /// Reads two bytes.
    pub fn u16(&mut self) -> u16 {
        self.reader.u16()
    }

    /// Reads four bytes.
    pub fn u32(&mut self) -> u32 {
        self.reader.u32()
    }

    /// Reads eight bytes.
    pub fn u64(&mut self) -> u64 {
        self.reader.u64()
    }

    /// Reads an instant or span.
    pub fn micros(&mut self) -> Micros {
        Micros(self.reader.i64())
    }

    /// Reads an instant, or that there is none.
    pub fn deadline(&mut self) -> Option<Micros> {
        let there = self.bool();
        let value = self.micros();
        there.then_some(value)
    }

    /// Reads why something failed, or that it did not.
    pub fn failure(&mut self) -> Option<Failure> {
        Failure::from_code(self.u16())
    }

    /// Succeeds if all was there, and all was read.
    pub(crate) fn end(&self) -> Result<(), StateError> {
        self.reader.end().map_err(|_| StateError)
    }
}
