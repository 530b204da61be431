//! The messages.
//!
//! A frame's payload is one message behind the other, each: type u8, length of the body u16, body.
//! A type that this version does not know ends the reading: what stands behind it is not guessed
//! at.

mod codes;
mod field;
mod table;

use core::marker::PhantomData;
use softplug_abi::wire::{Reader, Writer};
use softplug_abi::{MalformedReason, NoSpace};
use thiserror::Error;

pub use codes::{Outcome, SlotState, SwapOutcome, WhenCode};
pub use table::{ToServer, ToUnit};

/// Bytes before a message's body.
const HEAD: usize = 3;

/// SHA-256 of a module.
pub type Digest = [u8; 32];

/// In the place of settings: those that the link has.
pub const KEPT_SETTINGS: &[u8] = &[0];

/// A message that can be written.
pub trait Encode {
    /// Writes it to the start of `buffer`, and returns its length in bytes, the head included.
    ///
    /// # Errors
    /// It does not fit. What `buffer` holds then means nothing.
    fn encode(&self, buffer: &mut [u8]) -> Result<usize, NoSpace>;
}

/// A message that has been written already, to be sent.
///
/// ```
/// use softplug_unit_protocol::{Encode, Encoded, ToUnit};
///
/// let mut bytes = [0; 3];
/// let length = ToUnit::Query {}.encode(&mut bytes).unwrap();
/// let mut again = [0; 3];
/// assert_eq!(Encoded(&bytes[..length]).encode(&mut again), Ok(3));
/// assert_eq!(bytes, again);
/// ```
#[derive(Copy, Clone, Debug)]
pub struct Encoded<'a>(pub &'a [u8]);

impl Encode for Encoded<'_> {
    fn encode(&self, buffer: &mut [u8]) -> Result<usize, NoSpace> {
        buffer.get_mut(..self.0.len()).ok_or(NoSpace)?.copy_from_slice(self.0);
        Ok(self.0.len())
    }
}

impl<E: Encode + ?Sized> Encode for &E {
    fn encode(&self, buffer: &mut [u8]) -> Result<usize, NoSpace> {
        (**self).encode(buffer)
    }
}

/// A message that can be read.
pub trait Decode<'a>: Sized {
    /// The message of this type with this body.
    ///
    /// # Errors
    /// There is no such type, or the body is not laid out as it says.
    fn decode(kind: u8, body: &'a [u8]) -> Result<Self, MalformedReason>;
}

/// A message that cannot be read.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
#[error("message {kind} at byte {at} of a frame: {reason}")]
pub struct MessageError {
    /// Its type, 0 where the frame ends before that.
    pub kind: u8,
    /// Where it begins, in bytes of the payload.
    pub at: usize,
    /// What is wrong with it.
    pub reason: MalformedReason,
}

/// The messages of a payload, of type `M`: [`ToUnit`] or [`ToServer`]. It ends with the first that
/// cannot be read.
///
/// ```
/// use softplug_unit_protocol::{Encode, Messages, ToUnit};
///
/// let mut payload = [0; 64];
/// let begins = ToUnit::Data { link: 1, job: 9, pass: 0, at: 0, bytes: b"G1X2" };
/// let mut length = begins.encode(&mut payload).unwrap();
/// let ends = ToUnit::End { link: 1, job: 9, pass: 0, size: 4 };
/// length += ends.encode(&mut payload[length..]).unwrap();
/// let read: Vec<ToUnit> = Messages::new(&payload[..length]).collect::<Result<_, _>>().unwrap();
/// assert_eq!(read, [begins, ends]);
/// ```
#[derive(Clone, Debug)]
pub struct Messages<'a, M> {
    payload: &'a [u8],
    at: usize,
    of: PhantomData<M>,
}

impl<'a, M> Messages<'a, M> {
    /// The messages in `payload`.
    pub fn new(payload: &'a [u8]) -> Self {
        Self { payload, at: 0, of: PhantomData }
    }
}

impl<'a, M: Decode<'a>> Iterator for Messages<'a, M> {
    type Item = Result<M, MessageError>;

    fn next(&mut self) -> Option<Self::Item> {
        let rest = self.payload.get(self.at..).filter(|rest| !rest.is_empty())?;
        let mut reader = Reader::new(rest);
        let (kind, length) = (reader.u8(), usize::from(reader.u16()));
        let body = reader.bytes(length);
        let left = reader.rest().len();
        let decoded = reader.end().and_then(|()| M::decode(kind, body));
        let at = core::mem::replace(&mut self.at, self.payload.len() - left);
        Some(decoded.map_err(|reason| {
            self.at = self.payload.len();
            MessageError { kind, at, reason }
        }))
    }
}

/// Writes head and body.
fn encode(
    kind: u8,
    buffer: &mut [u8],
    body: impl FnOnce(&mut Writer<'_>),
) -> Result<usize, NoSpace> {
    let (head, rest) = buffer.split_at_mut_checked(HEAD).ok_or(NoSpace)?;
    let mut writer = Writer::new(rest);
    body(&mut writer);
    writer.end(0)?;
    let length = writer.len();
    let mut writer = Writer::new(head);
    writer.u8(kind);
    writer.u16(u16::try_from(length).map_err(|_| NoSpace)?);
    Ok(HEAD + length)
}
