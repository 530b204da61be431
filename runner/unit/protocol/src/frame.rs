//! A frame: what goes over the uplink at once.

use crc::{CRC_32_ISO_HDLC, Crc};
use softplug_abi::wire::{Reader, Writer};
use softplug_abi::{MalformedReason, NoSpace};
use thiserror::Error;

/// The protocol's version: the first byte of every frame.
pub const VERSION: u8 = 1;
/// Bytes before the payload.
pub const HEADER: usize = 16;
/// Bytes behind the payload: the check.
pub const TRAILER: usize = 4;
/// The most bytes of payload in a frame.
pub const PAYLOAD: usize = 1_024;
/// The longest frame, in bytes.
pub const LONGEST: usize = HEADER + PAYLOAD + TRAILER;

const CHECK: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);

/// What a frame is for.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum FrameKind {
    /// The server calls.
    Hello,
    /// The unit answers: a session begins.
    Welcome,
    /// There is no session, and why.
    Refuse,
    /// Messages, or nothing but how far those of the other side have come.
    Data,
}

impl FrameKind {
    const ALL: [Self; 4] = [Self::Hello, Self::Welcome, Self::Refuse, Self::Data];

    /// Its byte in a frame.
    pub const fn code(self) -> u8 {
        self as u8 + 1
    }

    fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.code() == code)
    }
}

/// A frame. Layout, little-endian: version u8, kind u8, length of the payload u16, session u32,
/// number u32, taken u32, payload, CRC-32 of all that u32.
///
/// ```
/// use softplug_unit_protocol::{Frame, FrameKind};
///
/// let frame =
///     Frame { kind: FrameKind::Data, session: 7, number: 1, taken: 0, payload: b"G1X2" };
/// let mut buffer = [0; 64];
/// let length = frame.encode(&mut buffer).unwrap();
/// assert_eq!(length, 24);
/// assert_eq!(Frame::decode(&buffer[..length]), Ok(frame));
///
/// buffer[17] ^= 1;
/// assert!(Frame::decode(&buffer[..length]).is_err());
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Frame<'a> {
    /// What it is for.
    pub kind: FrameKind,
    /// The session; 0 in a [`FrameKind::Hello`].
    pub session: u32,
    /// Counts frames with messages, from 1; 0 without.
    pub number: u32,
    /// All frames of the other side up to this number have come.
    pub taken: u32,
    /// Messages, or what the kind has.
    pub payload: &'a [u8],
}

/// Bytes that are no frame.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Error)]
pub enum FrameError {
    /// Of another version of the protocol.
    #[error("version {0} of the unit protocol; this is version {VERSION}")]
    Version(u8),
    /// Longer than a frame may be, in bytes of payload.
    #[error("a frame with {0} bytes of payload; {PAYLOAD} are the most")]
    TooLong(u16),
    /// The check does not match.
    #[error("a frame was damaged on its way")]
    Check,
    /// Not laid out as a frame.
    #[error("a frame is malformed: {0}")]
    Malformed(MalformedReason),
}

/// How long the frame is that begins with `bytes`, in bytes; `None` while too little is there to
/// tell. For uplinks that carry a stream.
///
/// ```
/// use softplug_unit_protocol::{FrameError, length_of_frame};
///
/// assert_eq!(length_of_frame(&[1, 4, 3]), Ok(None));
/// assert_eq!(length_of_frame(&[1, 4, 3, 0]), Ok(Some(23)));
/// assert_eq!(length_of_frame(b"GET / HTTP"), Err(FrameError::Version(b'G')));
/// ```
///
/// # Errors
/// What begins there is no frame of this version: nothing that follows can be trusted either.
pub fn length_of_frame(bytes: &[u8]) -> Result<Option<usize>, FrameError> {
    let Some(&version) = bytes.first() else { return Ok(None) };
    if version != VERSION {
        return Err(FrameError::Version(version));
    }
    let &[_, _, low, high, ..] = bytes else { return Ok(None) };
    let length = u16::from_le_bytes([low, high]);
    if usize::from(length) > PAYLOAD {
        return Err(FrameError::TooLong(length));
    }
    Ok(Some(HEADER + usize::from(length) + TRAILER))
}

impl<'a> Frame<'a> {
    /// Writes the frame to the start of `buffer`, and returns its length in bytes.
    ///
    /// # Errors
    /// It does not fit into `buffer`, or its payload is over [`PAYLOAD`].
    pub fn encode(&self, buffer: &mut [u8]) -> Result<usize, NoSpace> {
        if self.payload.len() > PAYLOAD {
            return Err(NoSpace);
        }
        let mut writer = Writer::new(buffer);
        writer.u8(VERSION);
        writer.u8(self.kind.code());
        writer.u16(self.payload.len() as u16);
        writer.u32(self.session);
        writer.u32(self.number);
        writer.u32(self.taken);
        writer.bytes(self.payload);
        let check = CHECK.checksum(writer.written());
        writer.u32(check);
        writer.end(0)?;
        Ok(writer.len())
    }

    /// Reads a frame that is all of `bytes`.
    ///
    /// # Errors
    /// It is not one, or not one of this version.
    pub fn decode(bytes: &'a [u8]) -> Result<Self, FrameError> {
        let truncated = FrameError::Malformed(MalformedReason::Truncated);
        let length = length_of_frame(bytes)?.ok_or(truncated)?;
        match bytes.len() {
            have if have < length => return Err(truncated),
            have if have > length => {
                return Err(FrameError::Malformed(MalformedReason::TrailingBytes));
            }
            _ => {}
        }
        let (covered, check) = bytes.split_at(length - TRAILER);
        if Reader::new(check).u32() != CHECK.checksum(covered) {
            return Err(FrameError::Check);
        }
        let mut reader = Reader::new(covered);
        reader.bytes(1);
        let kind = FrameKind::from_code(reader.u8());
        let kind = reader.known("kind", kind, FrameKind::Data);
        reader.u16();
        let (session, number, taken) = (reader.u32(), reader.u32(), reader.u32());
        let payload = reader.rest();
        reader.end().map_err(FrameError::Malformed)?;
        Ok(Self { kind, session, number, taken, payload })
    }
}
