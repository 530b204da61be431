//! Frames over a TCP connection, one behind the other.

use std::io::{self, Read, Write};
use std::net::SocketAddr;

use mio::event::Source;
use mio::net::TcpStream;
use mio::{Interest, Registry, Token};
use softplug_unit_protocol::{LONGEST, length_of_frame};

use crate::closed::Closed;

/// Bytes that wait to be sent, past which there is no room for more frames.
const WAITING: usize = 64 * LONGEST;

/// A TCP connection that carries frames.
///
/// ```
/// use softplug_unit_uplink::TcpUplink;
/// use mio::net::TcpListener;
/// use softplug_unit_protocol::{Frame, FrameKind};
///
/// let listener = TcpListener::bind("127.0.0.1:0".parse()?)?;
/// let mut near = TcpUplink::connect(listener.local_addr()?)?;
/// let mut far = loop {
///     if let Ok((far, _)) = listener.accept() {
///         break TcpUplink::new(far);
///     }
/// };
///
/// let mut bytes = [0; 64];
/// let frame = Frame { kind: FrameKind::Data, session: 1, number: 0, taken: 0, payload: b"" };
/// let length = frame.encode(&mut bytes).unwrap();
/// near.send(&bytes[..length])?;
/// let got = loop {
///     if let Some(frame) = far.receive()? {
///         break frame.to_vec();
///     }
/// };
/// assert_eq!(got, bytes[..length]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct TcpUplink {
    stream: TcpStream,
    is_connected: bool,
    /// What came: from `begin` on, not taken yet.
    came: Vec<u8>,
    begin: usize,
    /// The frame that was given out last ends here.
    given: usize,
    leaves: Vec<u8>,
    bits: u64,
}

impl TcpUplink {
    /// A connection that is open.
    pub fn new(stream: TcpStream) -> Self {
        let _ = stream.set_nodelay(true);
        let (came, leaves) = (Vec::new(), Vec::new());
        Self { stream, is_connected: true, came, begin: 0, given: 0, leaves, bits: 0 }
    }

    /// A connection that is being made: it is writable when it is there.
    ///
    /// # Errors
    /// It cannot even be begun.
    pub fn connect(address: SocketAddr) -> io::Result<Self> {
        let stream = TcpStream::connect(address)?;
        Ok(Self { is_connected: false, ..Self::new(stream) })
    }

    /// Whether the connection is there.
    ///
    /// # Errors
    /// It could not be made.
    pub fn is_connected(&mut self) -> Result<bool, Closed> {
        if !self.is_connected {
            if let Some(error) = self.stream.take_error()? {
                return Err(error.into());
            }
            match self.stream.peer_addr() {
                Ok(_) => {
                    self.is_connected = true;
                    let _ = self.stream.set_nodelay(true);
                }
                Err(error) if error.kind() == io::ErrorKind::NotConnected => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(self.is_connected)
    }

    /// The next whole frame that has come; `None`: not before the source is readable again.
    ///
    /// # Errors
    /// The connection has ended, or what comes is no frame.
    pub fn receive(&mut self) -> Result<Option<&[u8]>, Closed> {
        self.begin = self.given;
        loop {
            let rest = &self.came[self.begin..];
            if let Some(length) = length_of_frame(rest)?
                && rest.len() >= length
            {
                self.given = self.begin + length;
                self.bits += 8 * length as u64;
                return Ok(Some(&self.came[self.begin..self.given]));
            }
            if !self.is_connected()? || !self.read()? {
                return Ok(None);
            }
        }
    }

    fn read(&mut self) -> Result<bool, Closed> {
        self.came.drain(..self.begin);
        (self.begin, self.given) = (0, 0);
        let had = self.came.len();
        self.came.resize(had + LONGEST, 0);
        let read = self.stream.read(&mut self.came[had..]);
        self.came.truncate(had + read.as_ref().map_or(0, |count| *count));
        match read {
            Ok(0) => Err(Closed::ByPeer),
            Ok(_) => Ok(true),
            Err(error) if is_for_later(&error) => Ok(false),
            Err(error) => Err(error.into()),
        }
    }

    /// Bits of all frames that were sent or have come since it was asked last; what TCP/IP and the
    /// network put around them is not counted.
    pub fn take_bits(&mut self) -> u64 {
        std::mem::take(&mut self.bits)
    }

    /// Whether another frame would leave soon.
    pub fn has_room(&self) -> bool {
        self.leaves.len() < WAITING
    }

    /// Sends a frame, or keeps what the connection does not take yet.
    ///
    /// # Errors
    /// The connection has ended.
    pub fn send(&mut self, frame: &[u8]) -> Result<(), Closed> {
        self.bits += 8 * frame.len() as u64;
        self.leaves.extend_from_slice(frame);
        self.flush()?;
        Ok(())
    }

    /// Sends what waits. `false`: some of it still does; again when the source is writable.
    ///
    /// # Errors
    /// The connection has ended.
    pub fn flush(&mut self) -> Result<bool, Closed> {
        while !self.leaves.is_empty() {
            if !self.is_connected()? {
                return Ok(false);
            }
            match self.stream.write(&self.leaves) {
                Ok(0) => return Err(Closed::ByPeer),
                Ok(count) => drop(self.leaves.drain(..count)),
                Err(error) if is_for_later(&error) => return Ok(false),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(true)
    }
}

fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}

/// Edge-triggered: after it was told readable, [`TcpUplink::receive`] until `None`.
impl Source for TcpUplink {
    fn register(
        &mut self,
        registry: &Registry,
        token: Token,
        interests: Interest,
    ) -> io::Result<()> {
        self.stream.register(registry, token, interests)
    }

    fn reregister(
        &mut self,
        registry: &Registry,
        token: Token,
        interests: Interest,
    ) -> io::Result<()> {
        self.stream.reregister(registry, token, interests)
    }

    fn deregister(&mut self, registry: &Registry) -> io::Result<()> {
        self.stream.deregister(registry)
    }
}
