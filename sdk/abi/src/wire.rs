//! Little-endian reading and writing with bounds; no padding, no alignment.

use thiserror::Error;

/// The buffer has no space for the record.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
#[error("no space left in the buffer")]
pub struct NoSpace;

/// A record that does not follow the ABI.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
#[error("malformed record at byte {at}: {reason}")]
pub struct Malformed {
    /// Where the record begins, in bytes from the start of what was decoded.
    pub at: usize,
    /// What is wrong with it.
    pub reason: MalformedReason,
}

/// What is wrong with a record.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum MalformedReason {
    /// The bytes end inside the record.
    #[error("it ends too early")]
    Truncated,
    /// Bytes are left over inside the record.
    #[error("it is longer than its kind allows")]
    TrailingBytes,
    /// No such kind in this version.
    #[error("kind {0} does not exist")]
    UnknownKind(u16),
    /// A field has a value outside its range.
    #[error("field \"{0}\" is out of range")]
    OutOfRange(&'static str),
    /// A text is not UTF-8.
    #[error("field \"{0}\" is not UTF-8")]
    NotUtf8(&'static str),
}

/// Takes fields from the front of a slice.
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
}

impl<'a> Reader<'a> {
    /// A reader at the start of `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes }
    }

    /// Takes `count` bytes.
    pub fn bytes(&mut self, count: usize) -> Result<&'a [u8], MalformedReason> {
        let (head, rest) = self.rest.split_at_checked(count).ok_or(MalformedReason::Truncated)?;
        self.rest = rest;
        Ok(head)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], MalformedReason> {
        let (head, rest) = self.rest.split_first_chunk::<N>().ok_or(MalformedReason::Truncated)?;
        self.rest = rest;
        Ok(*head)
    }

    /// Takes one byte.
    pub fn u8(&mut self) -> Result<u8, MalformedReason> {
        Ok(self.array::<1>()?[0])
    }

    /// Takes two bytes.
    pub fn u16(&mut self) -> Result<u16, MalformedReason> {
        self.array().map(u16::from_le_bytes)
    }

    /// Takes four bytes.
    pub fn u32(&mut self) -> Result<u32, MalformedReason> {
        self.array().map(u32::from_le_bytes)
    }

    /// Takes eight bytes.
    pub fn u64(&mut self) -> Result<u64, MalformedReason> {
        self.array().map(u64::from_le_bytes)
    }

    /// Takes eight bytes, signed.
    pub fn i64(&mut self) -> Result<i64, MalformedReason> {
        self.array().map(i64::from_le_bytes)
    }

    /// Takes all that is left.
    pub fn rest(&mut self) -> &'a [u8] {
        core::mem::take(&mut self.rest)
    }

    /// Takes all that is left as text of at most `limit` bytes.
    pub fn text(&mut self, field: &'static str, limit: usize) -> Result<&'a str, MalformedReason> {
        if self.rest.len() > limit {
            return Err(MalformedReason::OutOfRange(field));
        }
        core::str::from_utf8(self.rest()).map_err(|_| MalformedReason::NotUtf8(field))
    }

    /// Whether all has been taken.
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// Succeeds if all has been taken.
    pub fn end(&self) -> Result<(), MalformedReason> {
        if self.rest.is_empty() { Ok(()) } else { Err(MalformedReason::TrailingBytes) }
    }
}

/// Appends fields to a slice.
#[derive(Debug)]
pub struct Writer<'a> {
    buffer: &'a mut [u8],
    length: usize,
}

impl<'a> Writer<'a> {
    /// A writer at the start of `buffer`.
    pub fn new(buffer: &'a mut [u8]) -> Self {
        Self { buffer, length: 0 }
    }

    /// How many bytes have been written.
    pub fn len(&self) -> usize {
        self.length
    }

    /// Whether nothing has been written.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// How many bytes still fit.
    pub fn room(&self) -> usize {
        self.buffer.len() - self.length
    }

    /// What has been written.
    pub fn written(&self) -> &[u8] {
        &self.buffer[..self.length]
    }

    /// Appends bytes.
    pub fn bytes(&mut self, bytes: &[u8]) -> Result<(), NoSpace> {
        let end = self.length.checked_add(bytes.len()).ok_or(NoSpace)?;
        self.buffer.get_mut(self.length..end).ok_or(NoSpace)?.copy_from_slice(bytes);
        self.length = end;
        Ok(())
    }

    /// Appends one byte.
    pub fn u8(&mut self, value: u8) -> Result<(), NoSpace> {
        self.bytes(&[value])
    }

    /// Appends two bytes.
    pub fn u16(&mut self, value: u16) -> Result<(), NoSpace> {
        self.bytes(&value.to_le_bytes())
    }

    /// Appends four bytes.
    pub fn u32(&mut self, value: u32) -> Result<(), NoSpace> {
        self.bytes(&value.to_le_bytes())
    }

    /// Appends eight bytes.
    pub fn u64(&mut self, value: u64) -> Result<(), NoSpace> {
        self.bytes(&value.to_le_bytes())
    }

    /// Appends eight bytes, signed.
    pub fn i64(&mut self, value: i64) -> Result<(), NoSpace> {
        self.bytes(&value.to_le_bytes())
    }

    /// Overwrites two bytes at `at`, which must have been written before.
    pub(crate) fn patch_u16(&mut self, at: usize, value: u16) {
        self.buffer[at..at + 2].copy_from_slice(&value.to_le_bytes());
    }

    /// Forgets all that was written from `length` on.
    pub(crate) fn truncate(&mut self, length: usize) {
        self.length = self.length.min(length);
    }
}
