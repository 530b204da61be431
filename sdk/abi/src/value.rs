//! Typed values: settings, and the fields of jobs and requests.

use crate::limits::VALUE_BYTES;
use crate::wire::{Malformed, MalformedReason, NoSpace, Reader, Writer};
use core::cmp::Ordering;

/// One typed value.
///
/// ```
/// use softplug_abi::{Value, ValueWriter, Values};
///
/// let mut buffer = [0; 64];
/// let mut writer = ValueWriter::new(&mut buffer);
/// writer.push(0, Value::Int(9_600)).unwrap();
/// writer.push(4, Value::Text("O0001")).unwrap();
/// let values = Values::new(writer.written());
/// assert_eq!(values.find(4), Some(Value::Text("O0001")));
/// ```
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
///
/// ```
/// use softplug_abi::{Value, Values};
///
/// // Setting 2, a flag that is on.
/// let mut values = Values::new(&[2, 0, 1, 0, 1, 0, 1]);
/// assert_eq!(values.next(), Some(Ok((2, Value::Bool(true)))));
/// assert_eq!(values.next(), None);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Values<'a> {
    raw: RawValues<'a>,
}

impl<'a> Values<'a> {
    /// The records in `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { raw: RawValues { bytes, at: 0 } }
    }

    /// The bytes of all records.
    pub fn as_bytes(&self) -> &'a [u8] {
        self.raw.bytes
    }

    /// The records with their payloads not looked at yet.
    pub fn raw(self) -> RawValues<'a> {
        self.raw
    }

    /// The value at `index`, if there is one and all before it are well formed.
    pub fn find(&self, index: u16) -> Option<Value<'a>> {
        self.clone().map_while(Result::ok).find(|(at, _)| *at == index).map(|(_, value)| value)
    }
}

impl<'a> Iterator for Values<'a> {
    type Item = Result<(u16, Value<'a>), Malformed>;

    fn next(&mut self) -> Option<Self::Item> {
        let at = self.raw.at;
        let decoded = self.raw.next()?.and_then(|raw| {
            let value = raw.value().map_err(|reason| Malformed { at, reason })?;
            Ok((raw.index, value))
        });
        if decoded.is_err() {
            self.raw.at = self.raw.bytes.len();
        }
        Some(decoded)
    }
}

/// One value record. A plug-in asks for the type that it expects, and carries
/// no code for the others.
///
/// ```
/// use softplug_abi::Values;
///
/// let raw = Values::new(&[2, 0, 1, 0, 1, 0, 1]).raw().next().unwrap()?;
/// assert_eq!((raw.index, raw.bool(), raw.int()), (2, Some(true), None));
/// # Ok::<(), softplug_abi::Malformed>(())
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct RawValue<'a> {
    /// Place in the manifest.
    pub index: u16,
    kind: u8,
    payload: &'a [u8],
}

impl<'a> RawValue<'a> {
    /// Takes a record from the front; a fault is kept by the reader.
    ///
    /// ```
    /// use softplug_abi::RawValue;
    /// use softplug_abi::wire::Reader;
    ///
    /// let mut reader = Reader::new(&[0, 0, 1, 0, 1, 0, 1]);
    /// assert_eq!(RawValue::read(&mut reader).bool(), Some(true));
    /// assert_eq!(reader.end(), Ok(()));
    /// RawValue::read(&mut reader);
    /// assert!(reader.has_failed());
    /// ```
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    pub fn read(reader: &mut Reader<'a>) -> Self {
        let (index, kind) = (reader.u16(), reader.u8());
        reader.zeros(1);
        let length = usize::from(reader.u16());
        reader.require("length", length <= VALUE_BYTES);
        Self { index, kind, payload: reader.bytes(length) }
    }

    /// The flag, if it is one.
    pub fn bool(&self) -> Option<bool> {
        match (self.kind, self.payload) {
            (BOOL, [0]) => Some(false),
            (BOOL, [1]) => Some(true),
            _ => None,
        }
    }

    /// The number, if it is one.
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    pub fn int(&self) -> Option<i64> {
        let payload: &[u8; 8] = self.payload.try_into().ok()?;
        (self.kind == INT).then(|| i64::from_le_bytes(*payload))
    }

    /// The text, if it is one.
    pub fn text(&self) -> Option<&'a str> {
        core::str::from_utf8(self.payload).ok().filter(|_| self.kind == TEXT)
    }

    /// The bytes of the text, if it is one. A host has looked whether they are UTF-8.
    pub fn text_bytes(&self) -> Option<&'a [u8]> {
        (self.kind == TEXT).then_some(self.payload)
    }

    /// The bytes, if they are of this type.
    pub fn bytes(&self) -> Option<&'a [u8]> {
        (self.kind == BYTES).then_some(self.payload)
    }

    /// The choice, if it is one.
    pub fn choice(&self) -> Option<u16> {
        let payload: &[u8; 2] = self.payload.try_into().ok()?;
        (self.kind == CHOICE).then(|| u16::from_le_bytes(*payload))
    }

    /// The value, whatever its type.
    pub fn value(&self) -> Result<Value<'a>, MalformedReason> {
        let length = match self.kind {
            BOOL => 1,
            INT => 8,
            CHOICE => 2,
            TEXT | BYTES => self.payload.len(),
            _ => return Err(MalformedReason::OutOfRange("type")),
        };
        match self.payload.len().cmp(&length) {
            Ordering::Less => return Err(MalformedReason::Truncated),
            Ordering::Greater => return Err(MalformedReason::TrailingBytes),
            Ordering::Equal => {}
        }
        let value = match self.kind {
            BOOL => self.bool().map(Value::Bool),
            INT => self.int().map(Value::Int),
            TEXT => return self.text().map(Value::Text).ok_or(MalformedReason::NotUtf8("text")),
            BYTES => self.bytes().map(Value::Bytes),
            _ => self.choice().map(Value::Choice),
        };
        value.ok_or(MalformedReason::OutOfRange("bool"))
    }
}

const BOOL: u8 = 1;
const INT: u8 = 2;
const TEXT: u8 = 3;
const BYTES: u8 = 4;
const CHOICE: u8 = 5;

/// Value records with their payloads not looked at yet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RawValues<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> RawValues<'a> {
    fn record(&self) -> Result<RawValue<'a>, MalformedReason> {
        let mut reader = Reader::new(self.bytes.get(self.at..).unwrap_or_default());
        let record = RawValue::read(&mut reader);
        reader.rest();
        reader.end()?;
        Ok(record)
    }
}

impl<'a> Iterator for RawValues<'a> {
    type Item = Result<RawValue<'a>, Malformed>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.at >= self.bytes.len() {
            return None;
        }
        let at = self.at;
        let record = self.record().map_err(|reason| Malformed { at, reason });
        self.at = match &record {
            Ok(raw) => at + 6 + raw.payload.len(),
            Err(_) => self.bytes.len(),
        };
        Some(record)
    }
}

/// Writes value records one after the other.
///
/// ```
/// use softplug_abi::{NoSpace, Value, ValueWriter};
///
/// let mut buffer = [0; 10];
/// let mut writer = ValueWriter::new(&mut buffer);
/// writer.push(0, Value::Choice(3))?;
/// assert_eq!(writer.written(), [0, 0, 5, 0, 2, 0, 3, 0]);
/// assert_eq!(writer.push(1, Value::Bool(true)), Err(NoSpace));
/// # Ok::<(), NoSpace>(())
/// ```
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
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    pub fn push(&mut self, index: u16, value: Value<'_>) -> Result<(), NoSpace> {
        let start = self.writer.len();
        self.record(index, value)?;
        self.writer.end(start)
    }

    /// Appends a text of ASCII characters; of any other byte the highest bit is left
    /// out. A plug-in without other texts has no need to know UTF-8.
    pub fn push_ascii(&mut self, index: u16, text: &[u8]) -> Result<(), NoSpace> {
        let start = self.writer.len();
        self.head(index, TEXT, text.len())?;
        self.writer.ascii(text);
        self.writer.end(start)
    }

    /// The records so far.
    pub fn written(&self) -> &[u8] {
        self.writer.written()
    }

    #[inline(never)]
    fn head(&mut self, index: u16, kind: u8, length: usize) -> Result<(), NoSpace> {
        if length > VALUE_BYTES {
            return Err(NoSpace);
        }
        self.writer.u16(index);
        self.writer.u8(kind);
        self.writer.u8(0);
        self.writer.u16(length as u16);
        Ok(())
    }

    #[cfg_attr(target_arch = "wasm32", inline(always))]
    fn record(&mut self, index: u16, value: Value<'_>) -> Result<(), NoSpace> {
        let (kind, length) = match value {
            Value::Bool(_) => (BOOL, 1),
            Value::Int(_) => (INT, 8),
            Value::Text(text) => (TEXT, text.len()),
            Value::Bytes(bytes) => (BYTES, bytes.len()),
            Value::Choice(_) => (CHOICE, 2),
        };
        self.head(index, kind, length)?;
        let writer = &mut self.writer;
        match value {
            Value::Bool(value) => writer.u8(u8::from(value)),
            Value::Int(value) => writer.i64(value),
            Value::Text(text) => writer.bytes(text.as_bytes()),
            Value::Bytes(bytes) => writer.bytes(bytes),
            Value::Choice(value) => writer.u16(value),
        }
        Ok(())
    }
}
