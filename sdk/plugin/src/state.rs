//! A converter's state as bytes.

use crate::Context;
use core::fmt;
use softplug_abi::wire::{Reader, copy};
use softplug_abi::{Action, Failure, Micros};

/// Why a saved state cannot be taken: the field that is wrong, or what else.
///
/// ```
/// use softplug_plugin::StateError;
///
/// let error = StateError::at(&"given");
/// assert_eq!(error.to_string(), "the saved state cannot be taken: given");
/// ```
#[derive(Copy, Clone, PartialEq, Eq)]
pub struct StateError {
    /// A name; or that of a structure, and those of its fields, each on a line of its own.
    /// As a thin pointer, and each structure's names once: a plug-in is small.
    names: &'static &'static str,
    /// Which of the structure's fields, from 1; 0: the structure, or what else the name says.
    field: u8,
}

impl StateError {
    /// It was saved in a format that is not taken.
    pub const FORMAT: Self = Self::at(&"its format");
    /// It is damaged, and nobody said where.
    pub const DAMAGED: Self = Self::at(&"damaged");
    /// What stands in front of the place, for people.
    pub(crate) const TEXT: &'static str = "the saved state cannot be taken: ";

    /// What is called so cannot be what it is, or is not there as a whole.
    pub const fn at(name: &'static &'static str) -> Self {
        Self { names: name, field: 0 }
    }

    /// What is wrong, byte by byte of UTF-8: `Sender.given`; `its format`, `its end` or `damaged`
    /// if it is no field. By hand: the library's ways to split a text would be 0.7 KB of every plug-in.
    pub(crate) fn tell(self, mut push: impl FnMut(u8)) {
        let mut line = 0;
        for byte in self.names.as_bytes() {
            let is_end = *byte == b'\n';
            line += u8::from(is_end);
            if line == 0 || line == self.field {
                push(if is_end { b'.' } else { *byte });
            }
        }
    }
}

impl fmt::Display for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::TEXT)?;
        let mut names = self.names.split('\n');
        f.write_str(names.next().unwrap_or_default())?;
        match self.field.checked_sub(1).and_then(|at| names.nth(at.into())) {
            Some(field) => write!(f, ".{field}"),
            None => Ok(()),
        }
    }
}

impl fmt::Debug for StateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "StateError({self})")
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
///     if count > 1_000 { Err(StateError::at(&"count")) } else { Ok((count, is_held)) }
/// }
/// ```
#[derive(Debug)]
pub struct StateReader<'a> {
    reader: Reader<'a>,
    format: u16,
    /// What is being read.
    field: StateError,
    /// The first that was wrong.
    wrong: Option<StateError>,
}

impl<'a> StateReader<'a> {
    pub(crate) fn new(format: u16, bytes: &'a [u8]) -> Self {
        Self { reader: Reader::new(bytes), format, field: StateError::DAMAGED, wrong: None }
    }

    /// The format in which the state was saved.
    pub fn format(&self) -> u16 {
        self.format
    }

    /// What is read from here on is this field: an error tells its name.
    pub fn field(&mut self, name: &'static &'static str) {
        self.field_of(name, 0);
    }

    /// What is read from here on is this field of a structure, from 1, by its [names](StateError); for
    /// `#[derive(State)]`.
    #[doc(hidden)]
    #[inline(never)]
    pub fn field_of(&mut self, names: &'static &'static str, field: u8) {
        self.look();
        self.field = StateError { names, field };
    }

    /// What is read from here on is the field behind the one that was read last.
    #[doc(hidden)]
    #[inline(never)]
    pub fn next_field(&mut self) {
        self.look();
        self.field.field += 1;
    }

    /// What was read last cannot be: the whole restore fails, and tells the field. Only the first
    /// refusal counts.
    #[inline(never)]
    pub fn refuse(&mut self) {
        self.wrong = self.wrong.or(Some(self.field));
    }

    /// Refuses the field if the state has ended in it.
    fn look(&mut self) {
        if self.reader.has_failed() {
            self.refuse();
        }
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

    /// What was refused, or is not there, or was not read.
    pub(crate) fn wrong(&mut self) -> Option<StateError> {
        if !self.reader.is_sound() {
            self.refuse();
        }
        self.wrong
    }
}
