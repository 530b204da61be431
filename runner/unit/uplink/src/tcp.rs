//! Frames over a TCP connection, one behind the other, in the clear or with TLS.

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr};

use mio::event::Source;
use mio::net::TcpStream;
use mio::{Interest, Registry, Token};
use softplug_unit_protocol::{LONGEST, length_of_frame};

use crate::closed::{Closed, TlsError};
use crate::keys::TlsPublicKey;
use crate::pinned::TlsKeys;
use crate::tls::{TlsStream, is_for_later, is_tls};

/// Bytes that wait to be sent, past which there is no room for more frames.
const WAITING: usize = 64 * LONGEST;
/// Reads of what is thrown away, at most, before a connection is closed.
const MOST_THROWN: usize = 64;

/// A TCP connection that carries frames.
///
/// ```
/// use softplug_unit_uplink::TcpUplink;
/// use mio::net::TcpListener;
/// use softplug_unit_protocol::{Frame, FrameKind};
///
/// let listener = TcpListener::bind("127.0.0.1:0".parse()?)?;
/// let mut near = TcpUplink::connect(listener.local_addr()?, None)?;
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
    stream: Stream,
    is_connected: bool,
    /// What came: from `begin` on, not taken yet.
    came: Vec<u8>,
    begin: usize,
    /// The frame that was given out last ends here.
    given: usize,
    leaves: Vec<u8>,
    bits: u64,
}

#[derive(Debug)]
enum Stream {
    Clear(TcpStream),
    Tls(TlsStream),
}

impl TcpUplink {
    /// A connection that is open.
    pub fn new(stream: TcpStream) -> Self {
        let _ = stream.set_nodelay(true);
        Self::over(Stream::Clear(stream))
    }

    /// A connection that is open, with TLS: no frame passes before each side has shown that it has a key
    /// that the other knows.
    ///
    /// # Errors
    /// TLS does not even begin.
    pub fn with_tls(stream: TcpStream, keys: &TlsKeys) -> Result<Self, Closed> {
        let _ = stream.set_nodelay(true);
        Ok(Self::over(Stream::Tls(TlsStream::new(stream, keys)?)))
    }

    /// A connection that is being made, with TLS where there are keys: it is writable when it is there.
    ///
    /// # Errors
    /// It cannot even be begun.
    pub fn connect(address: SocketAddr, keys: Option<&TlsKeys>) -> Result<Self, Closed> {
        let stream = TcpStream::connect(address)?;
        let uplink = match keys {
            Some(keys) => Self::with_tls(stream, keys)?,
            None => Self::new(stream),
        };
        Ok(Self { is_connected: false, ..uplink })
    }

    fn over(stream: Stream) -> Self {
        let (came, leaves) = (Vec::new(), Vec::new());
        Self { stream, is_connected: true, came, begin: 0, given: 0, leaves, bits: 0 }
    }

    /// Goes on with the handshake of TLS; frames that come behind it are kept. Whether it is done, as it
    /// always is in the clear.
    ///
    /// # Errors
    /// The connection has ended, or the other side is not who it should be.
    pub fn shake_hands(&mut self) -> Result<bool, Closed> {
        match &mut self.stream {
            Stream::Clear(_) => Ok(true),
            Stream::Tls(tls) => tls.shake_hands(),
        }
    }

    /// Whether the connection is there, and the handshake of TLS is not done.
    pub fn is_handshaking(&self) -> bool {
        self.is_connected && matches!(&self.stream, Stream::Tls(tls) if tls.is_handshaking())
    }

    /// The key that the other side has shown in the handshake of TLS.
    pub fn peer_key(&self) -> Option<TlsPublicKey> {
        match &self.stream {
            Stream::Clear(_) => None,
            Stream::Tls(tls) => tls.other(),
        }
    }

    /// Who is at the other end, if that is known.
    pub fn peer(&self) -> Option<SocketAddr> {
        self.tcp().peer_addr().ok()
    }

    fn tcp(&self) -> &TcpStream {
        match &self.stream {
            Stream::Clear(stream) => stream,
            Stream::Tls(tls) => tls.stream(),
        }
    }

    fn tcp_mut(&mut self) -> &mut TcpStream {
        match &mut self.stream {
            Stream::Clear(stream) => stream,
            Stream::Tls(tls) => tls.stream_mut(),
        }
    }

    /// Whether the connection is there.
    ///
    /// # Errors
    /// It could not be made.
    pub fn is_connected(&mut self) -> Result<bool, Closed> {
        if !self.is_connected {
            if let Some(error) = self.tcp().take_error()? {
                return Err(error.into());
            }
            match self.tcp().peer_addr() {
                Ok(_) => {
                    self.is_connected = true;
                    let _ = self.tcp().set_nodelay(true);
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
            if is_tls(rest) && matches!(self.stream, Stream::Clear(_)) {
                return Err(TlsError::Wanted.into());
            }
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
        let count = read.as_ref().map_or(0, |read| read.unwrap_or(0));
        self.came.truncate(had + count);
        read.map(|read| read.is_some())
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
        self.keep(frame);
        self.flush()?;
        Ok(())
    }

    /// Keeps a frame until [`flush`](Self::flush): what leaves at once costs one system call and, with TLS,
    /// one record.
    pub fn keep(&mut self, frame: &[u8]) {
        self.bits += 8 * frame.len() as u64;
        self.leaves.extend_from_slice(frame);
    }

    /// Sends what waits. `false`: some of it still does; again when the source is writable.
    ///
    /// # Errors
    /// The connection has ended.
    pub fn flush(&mut self) -> Result<bool, Closed> {
        if !self.is_connected()? {
            return Ok(self.leaves.is_empty());
        }
        while !self.leaves.is_empty() {
            match self.stream.write(&self.leaves)? {
                0 => return Ok(false),
                count => drop(self.leaves.drain(..count)),
            }
        }
        self.stream.flush()
    }

    /// Nothing is sent any more. What has come and is not read is thrown away: with it in the way,
    /// the system would throw away what was sent.
    pub(crate) fn finish(&mut self) -> Result<(), Closed> {
        self.tcp().shutdown(Shutdown::Write)?;
        let mut thrown = [0; LONGEST];
        for _ in 0..MOST_THROWN {
            match self.stream.read(&mut thrown) {
                Ok(Some(_)) => {}
                Ok(None) | Err(Closed::ByPeer) => break,
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}

impl Stream {
    /// `None`: not before it is readable again.
    fn read(&mut self, to: &mut [u8]) -> Result<Option<usize>, Closed> {
        match self {
            Self::Clear(stream) => match stream.read(to) {
                Ok(0) => Err(Closed::ByPeer),
                Ok(count) => Ok(Some(count)),
                Err(error) if is_for_later(&error) => Ok(None),
                Err(error) => Err(error.into()),
            },
            Self::Tls(tls) => tls.read(to),
        }
    }

    /// 0: no more before it is writable again.
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Closed> {
        match self {
            Self::Clear(stream) => match stream.write(bytes) {
                Ok(0) => Err(Closed::ByPeer),
                Ok(count) => Ok(count),
                Err(error) if is_for_later(&error) => Ok(0),
                Err(error) => Err(error.into()),
            },
            Self::Tls(tls) => tls.write(bytes),
        }
    }

    fn flush(&mut self) -> Result<bool, Closed> {
        match self {
            Self::Clear(_) => Ok(true),
            Self::Tls(tls) => tls.flush(),
        }
    }
}

/// Edge-triggered: after it was told readable, [`TcpUplink::receive`] until `None`.
impl Source for TcpUplink {
    fn register(
        &mut self,
        registry: &Registry,
        token: Token,
        interests: Interest,
    ) -> io::Result<()> {
        self.tcp_mut().register(registry, token, interests)
    }

    fn reregister(
        &mut self,
        registry: &Registry,
        token: Token,
        interests: Interest,
    ) -> io::Result<()> {
        self.tcp_mut().reregister(registry, token, interests)
    }

    fn deregister(&mut self, registry: &Registry) -> io::Result<()> {
        self.tcp_mut().deregister(registry)
    }
}
