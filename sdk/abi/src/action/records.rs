//! Actions one after the other in an output buffer, read and written.

use super::{Action, kind};
use crate::limits::{RECORD_BYTES, TIMERS};
use crate::wire::{Malformed, MalformedReason, NoSpace, Reader, Writer};
use crate::{DeliveryId, JobId, MarkId, Micros};

/// Reads the records of an output buffer, checking each.
///
/// ```
/// use softplug_abi::{Action, Actions, MalformedReason};
///
/// // `hold`, then a kind that does not exist.
/// let mut actions = Actions::new(&[3, 0, 0, 0, 99, 0, 0, 0]);
/// assert_eq!(actions.next(), Some(Ok(Action::Hold)));
/// let error = actions.next().unwrap().unwrap_err();
/// assert_eq!((error.at, error.reason), (4, MalformedReason::UnknownKind(99)));
/// // Nothing behind a malformed record can be read.
/// assert_eq!(actions.next(), None);
/// ```
#[derive(Clone, Debug)]
pub struct Actions<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Actions<'a> {
    /// The records in `bytes`.
    pub fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    fn record(&self) -> Result<(Action<'a>, usize), MalformedReason> {
        let mut reader = Reader::new(self.bytes.get(self.at..).unwrap_or_default());
        let kind = reader.u16();
        let length = usize::from(reader.u16());
        let payload = reader.bytes(length);
        reader.rest();
        reader.end()?;
        Ok((Action::decode(kind, payload)?, 4 + length))
    }
}

impl<'a> Iterator for Actions<'a> {
    type Item = Result<Action<'a>, Malformed>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.at >= self.bytes.len() {
            return None;
        }
        let at = self.at;
        match self.record() {
            Ok((action, length)) => {
                self.at += length;
                Some(Ok(action))
            }
            Err(reason) => {
                self.at = self.bytes.len();
                Some(Err(Malformed { at, reason }))
            }
        }
    }
}

/// Writes records into an output buffer.
///
/// Bytes for the queue or for one delivery that follow each other become one
/// record, so that a plug-in may push them one by one.
///
/// ```
/// use softplug_abi::{Action, ActionWriter, NoSpace};
///
/// let mut buffer = [0; 12];
/// let mut writer = ActionWriter::new(&mut buffer);
/// writer.transmit(b"G1")?;
/// writer.transmit(b"X2")?;
/// assert_eq!(writer.written(), [1, 0, 8, 0, 0, 0, 0, 0, b'G', b'1', b'X', b'2']);
/// // What does not fit leaves the rest whole.
/// assert_eq!(writer.push(&Action::Release), Err(NoSpace));
/// assert_eq!((writer.len(), writer.room()), (12, 0));
/// # Ok::<(), NoSpace>(())
/// ```
#[derive(Debug)]
pub struct ActionWriter<'a> {
    writer: Writer<'a>,
    /// Start of the last record and whose it is, if bytes may be appended to it.
    open: Option<(usize, Stream)>,
}

impl<'a> ActionWriter<'a> {
    /// A writer at the start of `buffer`.
    #[inline]
    pub fn new(buffer: &'a mut [u8]) -> Self {
        Self { writer: Writer::new(buffer), open: None }
    }

    /// Bytes written.
    #[inline]
    pub fn len(&self) -> usize {
        self.writer.len()
    }

    /// Whether nothing was written.
    pub fn is_empty(&self) -> bool {
        self.writer.is_empty()
    }

    /// Bytes that still fit, record headers included.
    #[inline]
    pub fn room(&self) -> usize {
        self.writer.room()
    }

    /// The records so far.
    pub fn written(&self) -> &[u8] {
        self.writer.written()
    }

    /// Appends a record; on `NoSpace` the records before it stay whole.
    ///
    /// In a plug-in it is inlined for each kind of action, where nothing but that
    /// kind's fields is left: the action itself is never put together.
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    pub fn push(&mut self, action: &Action<'_>) -> Result<(), NoSpace> {
        match action {
            Action::Transmit { mark: MarkId::NONE, bytes } => return self.transmit(bytes),
            Action::Deliver { delivery, bytes } => return self.deliver(*delivery, bytes),
            Action::SetTimer { id, deadline } => return self.set_timer(*id, *deadline),
            Action::Want { job, bytes } => return self.want(*job, *bytes),
            _ => {}
        }
        let start = self.begin(action.kind());
        action.write(&mut self.writer);
        self.end(start)
    }

    /// Begins a record, whose length is not known yet.
    #[inline(never)]
    fn begin(&mut self, kind: u16) -> usize {
        let start = self.writer.len();
        self.writer.u32(u32::from(kind));
        start
    }

    #[inline(never)]
    fn end(&mut self, start: usize) -> Result<(), NoSpace> {
        let length = self.writer.len() - start;
        self.writer.end(start)?;
        let Ok(length) = u16::try_from(length - 4) else {
            self.writer.forget(start);
            return Err(NoSpace);
        };
        self.writer.patch(start + 2, length.to_le_bytes());
        self.open = None;
        Ok(())
    }

    /// The quick way to push a [`Transmit`](Action::Transmit) without a mark.
    #[inline]
    pub fn transmit(&mut self, bytes: &[u8]) -> Result<(), NoSpace> {
        self.stream(Stream::new(kind::TRANSMIT, 0), bytes)
    }

    /// Pushes a [`Transmit`](Action::Transmit), which may have a mark. Bytes without one are not joined with
    /// those before.
    #[cfg_attr(target_arch = "wasm32", inline(always))]
    pub fn transmit_marked(&mut self, mark: MarkId, bytes: &[u8]) -> Result<(), NoSpace> {
        let start = self.begin(kind::TRANSMIT);
        Action::Transmit { mark, bytes }.write(&mut self.writer);
        self.end(start)
    }

    /// The quick way to push a [`Deliver`](Action::Deliver).
    #[inline]
    pub fn deliver(&mut self, delivery: DeliveryId, bytes: &[u8]) -> Result<(), NoSpace> {
        self.stream(Stream::new(kind::DELIVER, delivery.0), bytes)
    }

    /// The quick way to push a [`SetTimer`](Action::SetTimer).
    #[inline]
    #[expect(clippy::many_single_char_names, reason = "the bytes of a record")]
    pub fn set_timer(&mut self, id: u8, deadline: Micros) -> Result<(), NoSpace> {
        debug_assert!(id < TIMERS, "there is no timer {id}");
        let [a, b, c, d] = head(kind::SET_TIMER, 9);
        let [e, f, g, h, i, j, k, l] = deadline.0.to_le_bytes();
        self.whole([a, b, c, d, id, e, f, g, h, i, j, k, l])
    }

    /// The quick way to push a [`Want`](Action::Want).
    #[inline]
    #[expect(clippy::many_single_char_names, reason = "the bytes of a record")]
    pub fn want(&mut self, job: JobId, bytes: u32) -> Result<(), NoSpace> {
        let ([a, b, c, d], [e, f, g, h]) = (head(kind::WANT, 8), job.0.to_le_bytes());
        let [i, j, k, l] = bytes.to_le_bytes();
        self.whole([a, b, c, d, e, f, g, h, i, j, k, l])
    }

    /// A record of fixed length.
    #[inline]
    fn whole<const N: usize>(&mut self, record: [u8; N]) -> Result<(), NoSpace> {
        *self.writer.take().ok_or(NoSpace)? = record;
        self.open = None;
        Ok(())
    }

    /// Pushes a [`DeliveryName`](Action::DeliveryName) of ASCII characters; of any
    /// other byte the highest bit is left out.
    pub fn delivery_name_ascii(
        &mut self,
        delivery: DeliveryId,
        name: &[u8],
    ) -> Result<(), NoSpace> {
        let start = self.begin(kind::DELIVERY_NAME);
        self.writer.u32(delivery.0);
        self.writer.ascii(name);
        self.end(start)
    }

    /// In a plug-in the bytes are copied in one place whether they begin a record or
    /// not, and without a call but that of the copy: a call there costs what twenty
    /// instructions do, and an argument more than these would go over the stack.
    fn stream(&mut self, stream: Stream, bytes: &[u8]) -> Result<(), NoSpace> {
        if bytes.is_empty() {
            return Ok(());
        }
        let at = self.writer.len();
        let (start, head) = match self.open {
            Some((start, open))
                if open == stream && at - start - 4 + bytes.len() <= RECORD_BYTES =>
            {
                (start, 0)
            }
            _ => (at, 8),
        };
        let length = at + head - start - 4 + bytes.len();
        if length > RECORD_BYTES {
            return Err(NoSpace);
        }
        self.writer.put(at + head, bytes)?;
        self.writer.patch(start, stream.head(length as u16));
        self.open = Some((start, stream));
        Ok(())
    }
}

/// Kind and length of a record.
#[inline]
fn head(kind: u16, length: u16) -> [u8; 4] {
    (u32::from(kind) | u32::from(length) << 16).to_le_bytes()
}

/// Whose the bytes of a record are, as at the record's head: kind and id, between them
/// the length, which is left out here.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
struct Stream(u64);

impl Stream {
    #[inline]
    fn new(kind: u16, id: u32) -> Self {
        Self(u64::from(kind) | u64::from(id) << 32)
    }

    #[inline]
    fn head(self, length: u16) -> [u8; 8] {
        (self.0 | u64::from(length) << 16).to_le_bytes()
    }
}
