//! Typed values: settings, and the fields of jobs and requests.

use crate::limits::VALUE_BYTES;
use crate::wire::{Malformed, MalformedReason, NoSpace, Reader, Writer};

/// One typed value.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum Value<'a> {
    /// Yes or no.
    Bool(bool),
    /// A number in the unit that the manifest names.
    Int(i64),
    /// Text of at most [`VALUE_BYTES`].
    Text(&'a str),
    /// Bytes, at most [`VALUE_BYTES`].
    Bytes(&'a [u8]),
    /// One of the manifest's choices, counted from 0.
    Choice(u16),
}

/// Value records, in the order in which they stand. Each is: index u16 (the
/// place in the manifest), type u8, zero u8, length u16, payload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Values<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Values<'a> {
    /// The records in `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The bytes of all records.
    pub fn as_bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// The value at `index`, if there is one and all before it are well formed.
    pub fn find(&self, index: u16) -> Option<Value<'a>> {
        self.clone().map_while(Result::ok).find(|(at, _)| *at == index).map(|(_, value)| value)
    }

    fn record(&self) -> Result<((u16, Value<'a>), usize), MalformedReason> {
        let mut reader = Reader::new(self.bytes.get(self.at..).unwrap_or_default());
        let index = reader.u16()?;
        let kind = reader.u8()?;
        if reader.u8()? != 0 {
            return Err(MalformedReason::OutOfRange("zero"));
        }
        let length = usize::from(reader.u16()?);
        if length > VALUE_BYTES {
            return Err(MalformedReason::OutOfRange("length"));
        }
        let mut payload = Reader::new(reader.bytes(length)?);
        let value = match kind {
            1 => Value::Bool(match payload.u8()? {
                0 => false,
                1 => true,
                _ => return Err(MalformedReason::OutOfRange("bool")),
            }),
            2 => Value::Int(payload.i64()?),
            3 => Value::Text(payload.text("text", VALUE_BYTES)?),
            4 => Value::Bytes(payload.rest()),
            5 => Value::Choice(payload.u16()?),
            _ => return Err(MalformedReason::OutOfRange("type")),
        };
        payload.end()?;
        Ok(((index, value), 6 + length))
    }
}

impl<'a> Iterator for Values<'a> {
    type Item = Result<(u16, Value<'a>), Malformed>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.at >= self.bytes.len() {
            return None;
        }
        let at = self.at;
        match self.record() {
            Ok((item, length)) => {
                self.at += length;
                Some(Ok(item))
            }
            Err(reason) => {
                self.at = self.bytes.len();
                Some(Err(Malformed { at, reason }))
            }
        }
    }
}

/// Writes value records one after the other.
#[derive(Debug)]
pub struct ValueWriter<'a> {
    writer: Writer<'a>,
}

impl<'a> ValueWriter<'a> {
    /// A writer at the start of `buffer`.
    pub fn new(buffer: &'a mut [u8]) -> Self {
        Self { writer: Writer::new(buffer) }
    }

    /// Appends one record; on `NoSpace` the records before it stay whole.
    pub fn push(&mut self, index: u16, value: Value<'_>) -> Result<(), NoSpace> {
        let start = self.writer.len();
        let written = self.record(index, value);
        if written.is_err() {
            self.writer.truncate(start);
        }
        written
    }

    /// The records so far.
    pub fn written(&self) -> &[u8] {
        self.writer.written()
    }

    fn record(&mut self, index: u16, value: Value<'_>) -> Result<(), NoSpace> {
        let writer = &mut self.writer;
        let (kind, length) = match value {
            Value::Bool(_) => (1, 1),
            Value::Int(_) => (2, 8),
            Value::Text(text) => (3, text.len()),
            Value::Bytes(bytes) => (4, bytes.len()),
            Value::Choice(_) => (5, 2),
        };
        if length > VALUE_BYTES {
            return Err(NoSpace);
        }
        writer.u16(index)?;
        writer.u8(kind)?;
        writer.u8(0)?;
        writer.u16(length as u16)?;
        match value {
            Value::Bool(value) => writer.u8(u8::from(value)),
            Value::Int(value) => writer.i64(value),
            Value::Text(text) => writer.bytes(text.as_bytes()),
            Value::Bytes(bytes) => writer.bytes(bytes),
            Value::Choice(value) => writer.u16(value),
        }
    }
}
