//! A converter's state as bytes.

use crate::Context;
use core::fmt;
use softplug_abi::wire::Reader;
use softplug_abi::{Action, Micros};

/// A saved state that cannot be taken.
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
        let wanted = &bytes[skipped..];
        let count = wanted.len().min(self.piece.len() - self.filled);
        self.piece[self.filled..self.filled + count].copy_from_slice(&wanted[..count]);
        self.filled += count;
        self.position += bytes.len();
    }

    /// Writes one byte.
    pub fn u8(&mut self, value: u8) {
        self.bytes(&[value]);
    }

    /// Writes a flag.
    pub fn bool(&mut self, value: bool) {
        self.u8(u8::from(value));
    }

    /// Writes four bytes.
    pub fn u32(&mut self, value: u32) {
        self.bytes(&value.to_le_bytes());
    }

    /// Writes eight bytes.
    pub fn u64(&mut self, value: u64) {
        self.bytes(&value.to_le_bytes());
    }

    /// Writes an instant or span.
    pub fn micros(&mut self, value: Micros) {
        self.bytes(&value.0.to_le_bytes());
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
        let bytes = &piece[..filled];
        link.push(&Action::Saved { format, offset: offset as u32, total: total as u32, bytes });
        offset += filled;
        if offset >= total || link.output_room() < PIECE + 16 {
            return offset;
        }
    }
}

/// Gives a state back field by field.
#[derive(Debug)]
pub struct StateReader<'a> {
    reader: Reader<'a>,
}

impl<'a> StateReader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { reader: Reader::new(bytes) }
    }

    /// Reads `count` bytes.
    pub fn bytes(&mut self, count: usize) -> Result<&'a [u8], StateError> {
        self.reader.bytes(count).map_err(|_| StateError)
    }

    /// Reads one byte.
    pub fn u8(&mut self) -> Result<u8, StateError> {
        self.reader.u8().map_err(|_| StateError)
    }

    /// Reads a flag.
    pub fn bool(&mut self) -> Result<bool, StateError> {
        match self.u8()? {
            0 => Ok(false),
            1 => Ok(true),
            _ => Err(StateError),
        }
    }

    /// Reads four bytes.
    pub fn u32(&mut self) -> Result<u32, StateError> {
        self.reader.u32().map_err(|_| StateError)
    }

    /// Reads eight bytes.
    pub fn u64(&mut self) -> Result<u64, StateError> {
        self.reader.u64().map_err(|_| StateError)
    }

    /// Reads an instant or span.
    pub fn micros(&mut self) -> Result<Micros, StateError> {
        self.reader.i64().map(Micros).map_err(|_| StateError)
    }

    /// Reads an instant, or that there is none.
    pub fn deadline(&mut self) -> Result<Option<Micros>, StateError> {
        let there = self.bool()?;
        let value = self.micros()?;
        Ok(there.then_some(value))
    }

    /// Succeeds if all was read.
    pub fn end(&self) -> Result<(), StateError> {
        if self.reader.is_empty() { Ok(()) } else { Err(StateError) }
    }
}
