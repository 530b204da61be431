//! Little-endian reading and writing with bounds; no padding, no alignment.

use thiserror::Error;

/// The buffer has no space for the record.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
#[error("no space left in the buffer")]
pub struct NoSpace;

/// A record that does not follow the ABI.
///
/// ```
/// use softplug_abi::{Malformed, MalformedReason};
///
/// let error = Malformed { at: 12, reason: MalformedReason::OutOfRange("id") };
/// assert_eq!(error.to_string(), "malformed record at byte 12: field \"id\" is out of range");
/// ```
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

/// Copies as many bytes as both slices hold. A copy that can panic, or an index
/// that can, would bring the formatting of its message into every plug-in: some 5 KiB.
///
/// ```
/// let mut buffer = [0; 3];
/// softplug_abi::wire::copy(&mut buffer, b"G1X2");
/// assert_eq!(&buffer, b"G1X");
/// ```
pub fn copy(to: &mut [u8], from: &[u8]) {
    for (to, from) in to.iter_mut().zip(from) {
        *to = *from;
    }
}

/// As [`copy`], where it is often one byte: as bytes come from a line.
#[inline]
pub(crate) fn copy_quick(to: &mut [u8], from: &[u8]) {
    match (&mut *to, from) {
        ([to], [from]) => *to = *from,
        _ => copy(to, from),
    }
}

/// Takes fields from the front of a slice.
///
/// A field that is not there reads as zero, and the fault is kept: read all,
/// then ask [`end`](Self::end). So a record's layout reads straight down, and the code for it
/// stays small enough for a plug-in; that is also why nothing here is inlined.
///
/// ```
/// use softplug_abi::MalformedReason;
/// use softplug_abi::wire::Reader;
///
/// let mut reader = Reader::new(&[0x34, 0x12, b'G', b'1']);
/// assert_eq!((reader.u16(), reader.rest()), (0x1234, &b"G1"[..]));
/// assert_eq!(reader.end(), Ok(()));
///
/// let mut short = Reader::new(&[1, 2]);
/// assert_eq!(short.u32(), 0);
/// assert_eq!(short.end(), Err(MalformedReason::Truncated));
/// ```
#[derive(Clone, Debug)]
pub struct Reader<'a> {
    rest: &'a [u8],
    fault: Option<MalformedReason>,
}

impl<'a> Reader<'a> {
    /// A reader at the start of `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { rest: bytes, fault: None }
    }

    /// Keeps a fault; the first one stays.
    #[inline(never)]
    pub fn fail(&mut self, reason: MalformedReason) {
        self.fault.get_or_insert(reason);
        self.rest = &[];
    }

    /// Takes `count` bytes; none if there are fewer.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    pub fn bytes(&mut self, count: usize) -> &'a [u8] {
        let Some((head, rest)) = self.rest.split_at_checked(count) else {
            self.truncated();
            return &[];
        };
        self.rest = rest;
        head
    }

    #[cold]
    #[inline(never)]
    fn truncated(&mut self) {
        self.fail(MalformedReason::Truncated);
    }

    fn array<const N: usize>(&mut self) -> [u8; N] {
        let Some((head, rest)) = self.rest.split_first_chunk::<N>() else {
            self.truncated();
            return [0; N];
        };
        self.rest = rest;
        *head
    }

    /// Takes one byte.
    #[inline(never)]
    pub fn u8(&mut self) -> u8 {
        let [byte] = self.array();
        byte
    }

    /// Takes a flag, 0 or 1.
    #[inline(never)]
    pub fn flag(&mut self) -> bool {
        let flag = self.u8();
        self.require("flags", flag <= 1);
        flag == 1
    }

    /// Keeps a fault unless the field is in range. A plug-in does not tell which it
    /// was: the names of the fields are not in there.
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    pub fn require(&mut self, field: &'static str, in_range: bool) {
        if cfg!(target_arch = "wasm32") {
            self.demand(in_range);
        } else if !in_range {
            self.fail(MalformedReason::OutOfRange(field));
        }
    }

    #[inline(never)]
    fn demand(&mut self, is_met: bool) {
        if !is_met {
            self.truncated();
        }
    }

    /// Takes two bytes.
    #[inline(never)]
    pub fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.array())
    }

    /// Takes four bytes.
    #[inline(never)]
    pub fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.array())
    }

    /// Takes four bytes that are not 0.
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    pub fn non_zero(&mut self, field: &'static str) -> u32 {
        if cfg!(target_arch = "wasm32") {
            return self.demand_non_zero();
        }
        let value = self.u32();
        self.require(field, value != 0);
        value
    }

    #[inline(never)]
    fn demand_non_zero(&mut self) -> u32 {
        let value = self.u32();
        self.demand(value != 0);
        value
    }

    /// Takes eight bytes.
    #[inline(never)]
    pub fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.array())
    }

    /// Takes eight bytes, signed.
    #[inline(never)]
    pub fn i64(&mut self) -> i64 {
        i64::from_le_bytes(self.array())
    }

    /// Takes bytes that must be zero.
    #[inline(never)]
    pub fn zeros(&mut self, count: usize) {
        for _ in 0..count {
            let byte = self.u8();
            self.require("zero", byte == 0);
        }
    }

    /// The meaning of a code that was taken; `otherwise` if it has none.
    pub fn known<T>(&mut self, field: &'static str, meaning: Option<T>, otherwise: T) -> T {
        self.require(field, meaning.is_some());
        meaning.unwrap_or(otherwise)
    }

    /// Whether nothing is left.
    pub fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    /// Takes all that is left.
    pub fn rest(&mut self) -> &'a [u8] {
        core::mem::take(&mut self.rest)
    }

    /// Takes all that is left, at least one byte.
    #[inline(never)]
    pub fn rest_not_empty(&mut self) -> &'a [u8] {
        if self.rest.is_empty() {
            self.truncated();
        }
        self.rest()
    }

    /// Takes all that is left as text of at most `limit` bytes.
    pub fn text(&mut self, field: &'static str, limit: usize) -> &'a str {
        let bytes = self.rest();
        if bytes.len() > limit {
            self.fail(MalformedReason::OutOfRange(field));
            return "";
        }
        core::str::from_utf8(bytes).unwrap_or_else(|_| {
            self.fail(MalformedReason::NotUtf8(field));
            ""
        })
    }

    /// Succeeds if all was there, in range, and nothing is left.
    #[inline]
    pub fn end(&self) -> Result<(), MalformedReason> {
        if self.is_sound() { Ok(()) } else { Err(self.reason()) }
    }

    /// Whether something was read that was not there or cannot be.
    pub fn has_failed(&self) -> bool {
        self.fault.is_some()
    }

    /// Whether all was there, in range, and nothing is left.
    #[inline(never)]
    pub fn is_sound(&self) -> bool {
        self.fault.is_none() && self.rest.is_empty()
    }

    #[cold]
    #[inline(never)]
    pub(crate) fn reason(&self) -> MalformedReason {
        self.fault.unwrap_or(MalformedReason::TrailingBytes)
    }
}

/// Appends fields to a slice.
///
/// What does not fit is left out and remembered: write all, then ask
/// [`end`](Self::end).
///
/// ```
/// use softplug_abi::NoSpace;
/// use softplug_abi::wire::Writer;
///
/// let mut buffer = [0; 4];
/// let mut writer = Writer::new(&mut buffer);
/// writer.u16(0x1234);
/// let start = writer.len();
/// writer.u32(7);
/// assert_eq!(writer.end(start), Err(NoSpace));
/// assert_eq!(writer.written(), [0x34, 0x12]);
/// ```
#[derive(Debug)]
pub struct Writer<'a> {
    buffer: &'a mut [u8],
    length: usize,
    overflowed: bool,
}

impl<'a> Writer<'a> {
    /// A writer at the start of `buffer`.
    #[inline]
    pub fn new(buffer: &'a mut [u8]) -> Self {
        Self { buffer, length: 0, overflowed: false }
    }

    /// How many bytes have been written.
    #[inline]
    pub fn len(&self) -> usize {
        self.length
    }

    /// Whether nothing has been written.
    pub fn is_empty(&self) -> bool {
        self.length == 0
    }

    /// How many bytes still fit.
    #[inline]
    pub fn room(&self) -> usize {
        self.buffer.len() - self.length
    }

    /// What has been written.
    pub fn written(&self) -> &[u8] {
        self.buffer.get(..self.length).unwrap_or_default()
    }

    /// Appends bytes.
    pub fn bytes(&mut self, bytes: &[u8]) {
        let place = self.buffer.get_mut(self.length..).and_then(|free| free.get_mut(..bytes.len()));
        let Some(place) = place else {
            self.overflowed = true;
            return;
        };
        copy(place, bytes);
        self.length += bytes.len();
    }

    /// Appends characters of ASCII; of any other byte the highest bit is left out.
    pub(crate) fn ascii(&mut self, text: &[u8]) {
        for byte in text {
            self.u8(byte & 0x7F);
        }
    }

    /// A field of fixed length is one store, where `bytes` is a loop. In a plug-in
    /// its callers are not inlined: each would come a dozen times.
    #[inline]
    pub(crate) fn array<const N: usize>(&mut self, value: [u8; N]) {
        let place = self.buffer.get_mut(self.length..).and_then(<[u8]>::first_chunk_mut);
        let Some(place) = place else {
            self.overflowed = true;
            return;
        };
        *place = value;
        self.length += N;
    }

    /// Appends one byte.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    pub fn u8(&mut self, value: u8) {
        self.array([value]);
    }

    /// Appends two bytes.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    pub fn u16(&mut self, value: u16) {
        self.array(value.to_le_bytes());
    }

    /// Appends four bytes.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    pub fn u32(&mut self, value: u32) {
        self.array(value.to_le_bytes());
    }

    /// Appends eight bytes.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    pub fn u64(&mut self, value: u64) {
        self.array(value.to_le_bytes());
    }

    /// Appends eight bytes, signed.
    #[cfg_attr(target_arch = "wasm32", inline(never))]
    pub fn i64(&mut self, value: i64) {
        self.array(value.to_le_bytes());
    }

    /// Succeeds if all that was written since `start` fitted; otherwise forgets it.
    #[inline]
    pub fn end(&mut self, start: usize) -> Result<(), NoSpace> {
        if core::mem::take(&mut self.overflowed) {
            self.length = start;
            return Err(NoSpace);
        }
        Ok(())
    }

    /// Forgets all that was written from `length` on.
    pub(crate) fn forget(&mut self, length: usize) {
        self.length = self.length.min(length);
    }

    /// Room for a record of fixed length, which counts as written.
    #[inline]
    pub(crate) fn take<const N: usize>(&mut self) -> Option<&mut [u8; N]> {
        let place = self.buffer.get_mut(self.length..)?.first_chunk_mut()?;
        self.length += N;
        Some(place)
    }

    /// Writes bytes at `at`, behind which nothing has been written yet; all before them
    /// counts as written too.
    #[inline]
    pub(crate) fn put(&mut self, at: usize, bytes: &[u8]) -> Result<(), NoSpace> {
        let place = self.buffer.get_mut(at..).and_then(|free| free.get_mut(..bytes.len()));
        let Some(place) = place else { return Err(NoSpace) };
        copy_quick(place, bytes);
        self.length = at + bytes.len();
        Ok(())
    }

    /// Overwrites bytes at `at`, which must have been written before.
    #[inline]
    pub(crate) fn patch<const N: usize>(&mut self, at: usize, value: [u8; N]) {
        if let Some(place) = self.buffer.get_mut(at..).and_then(<[u8]>::first_chunk_mut) {
            *place = value;
        }
    }
}
