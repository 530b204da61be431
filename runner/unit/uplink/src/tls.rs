//! TLS on a TCP connection between a gateway and a unit.

use std::fmt;
use std::io::{self, Read as _, Write as _};
use std::sync::Arc;

use mio::net::TcpStream;
use rustls::Connection;

use crate::closed::{Closed, TlsError};
use crate::keys::TlsPublicKey;
use crate::pinned::{Pinned, TlsKeys};

/// How a connection of which TLS is not known yet looks if the other side speaks it: a record with a
/// handshake or an alert.
pub(crate) fn is_tls(came: &[u8]) -> bool {
    matches!(came, [0x15 | 0x16, 3, ..])
}

/// A connection with TLS on it.
pub(crate) struct TlsStream {
    stream: TcpStream,
    /// Boxed: it is large beside a connection in the clear.
    connection: Box<Connection>,
    pinned: Arc<Pinned>,
    has_failed: bool,
}

impl TlsStream {
    pub(crate) fn new(stream: TcpStream, keys: &TlsKeys) -> Result<Self, Closed> {
        let connection = Box::new(keys.connection().map_err(TlsError::Failed)?);
        Ok(Self { stream, connection, pinned: Arc::clone(&keys.pinned), has_failed: false })
    }

    pub(crate) fn is_handshaking(&self) -> bool {
        self.connection.is_handshaking()
    }

    /// The key that the other side has shown.
    pub(crate) fn other(&self) -> Option<TlsPublicKey> {
        let shown = self.connection.peer_certificates()?.first()?;
        TlsPublicKey::from_der(shown)
    }

    pub(crate) fn stream(&self) -> &TcpStream {
        &self.stream
    }

    pub(crate) fn stream_mut(&mut self) -> &mut TcpStream {
        &mut self.stream
    }

    /// What has come, in the clear; `None`: not before the stream is readable again.
    pub(crate) fn read(&mut self, to: &mut [u8]) -> Result<Option<usize>, Closed> {
        loop {
            match self.connection.reader().read(to) {
                Ok(0) => return Err(Closed::ByPeer),
                Ok(count) => return Ok(Some(count)),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) => return Err(error.into()),
            }
            if !self.take()? {
                return Ok(None);
            }
        }
    }

    /// Goes on with the handshake as far as there is something to read. Whether it is done.
    pub(crate) fn shake_hands(&mut self) -> Result<bool, Closed> {
        self.flush()?;
        while self.is_handshaking() && self.take()? {}
        Ok(!self.is_handshaking())
    }

    /// Takes up what the stream has; `false`: nothing.
    fn take(&mut self) -> Result<bool, Closed> {
        match self.connection.read_tls(&mut self.stream) {
            Ok(0) => return Err(self.left()),
            Ok(_) => {}
            Err(error) if is_for_later(&error) => return Ok(false),
            Err(error) => return Err(self.broken(error)),
        }
        self.process()?;
        self.flush()?;
        Ok(true)
    }

    fn process(&mut self) -> Result<(), Closed> {
        if let Err(error) = self.connection.process_new_packets() {
            self.has_failed = true;
            // What is wrong is told to the other side, if it listens.
            let _ = self.connection.write_tls(&mut self.stream);
            return Err(self.pinned.blame(error).into());
        }
        Ok(())
    }

    /// Encrypts as much as fits, all of it in as few records as can be, and sends it. How much of it was
    /// taken: nothing while the handshake is under way, or while something else still waits.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> Result<usize, Closed> {
        if !self.flush()? || self.is_handshaking() {
            return Ok(0);
        }
        let count = self.connection.writer().write(bytes)?;
        self.flush()?;
        Ok(count)
    }

    /// Sends what is encrypted. `false`: some of it still waits.
    pub(crate) fn flush(&mut self) -> Result<bool, Closed> {
        while self.connection.wants_write() {
            match self.connection.write_tls(&mut self.stream) {
                Ok(0) => return Err(self.left()),
                Ok(_) => {}
                Err(error) if is_for_later(&error) => return Ok(false),
                Err(error) => return Err(self.broken(error)),
            }
        }
        Ok(true)
    }

    fn left(&self) -> Closed {
        if self.is_handshaking() { TlsError::Left.into() } else { Closed::ByPeer }
    }

    fn broken(&mut self, error: io::Error) -> Closed {
        use io::ErrorKind::{BrokenPipe, ConnectionReset};
        if !matches!(error.kind(), ConnectionReset | BrokenPipe) {
            return error.into();
        }
        // What it said before it went, and nobody has read yet, says more.
        if let Ok(1..) = self.connection.read_tls(&mut self.stream)
            && let Err(closed) = self.process()
        {
            return closed;
        }
        self.left()
    }
}

/// Says that this is the end, as far as that leaves at once.
impl Drop for TlsStream {
    fn drop(&mut self) {
        if !self.has_failed {
            self.connection.send_close_notify();
            let _ = self.connection.write_tls(&mut self.stream);
        }
    }
}

impl fmt::Debug for TlsStream {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TlsStream").field("stream", &self.stream).finish_non_exhaustive()
    }
}

pub(crate) fn is_for_later(error: &io::Error) -> bool {
    matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted)
}
