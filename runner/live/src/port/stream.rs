//! A TCP connection that never blocks, and whether its other side still lives.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
#[cfg(target_os = "linux")]
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use socket2::{SockRef, TcpKeepalive};
use softplug_abi::LinkDownReason;

#[cfg(target_os = "linux")]
use super::ioctl;
use super::read_outcome::ReadOutcome;
use crate::error::PortError;

/// Silence after which the peer is probed, then how often and how many times:
/// a half-open connection is found within half a minute.
const KEEPALIVE: (Duration, Duration, u32) = (Duration::from_secs(10), Duration::from_secs(5), 4);
/// What the kernel holds of what was written is beyond recall, so it is little:
/// as much as 921,600 baud needs over a round trip of 40 ms, twice.
const SEND_BUFFER: usize = 8_192;
/// Bytes sent again so often without an answer have nobody to answer: 25 s.
#[cfg(target_os = "linux")]
const RETRANSMITS: u8 = 7;
/// Questions whether a full peer has room again that have nobody to answer: 25 s.
#[cfg(target_os = "linux")]
const PROBES: u8 = 6;

/// A connection, non-blocking. The other side holds us by the TCP window as
/// long as it likes, so there is no time-out on unacknowledged bytes;
/// [`is_dead`](Self::is_dead) tells a peer that holds from one that is gone.
#[derive(Debug)]
pub(crate) struct Stream(TcpStream);

impl Stream {
    /// Connects. Looking a name up may take longer than the time-out.
    pub(crate) fn connect(host: &str, port: u16, timeout: Duration) -> Result<Self, PortError> {
        let failed = |source| PortError::Connect { address: format!("{host}:{port}"), source };
        let addresses: Vec<SocketAddr> = (host, port).to_socket_addrs().map_err(failed)?.collect();
        let stream = connect_any(&addresses, timeout).map_err(failed)?;
        Self::over(stream).map_err(|error| PortError::io("set up the connection", error))
    }

    /// Takes over a connection that was accepted.
    pub(crate) fn over(stream: TcpStream) -> io::Result<Self> {
        let (idle, interval, count) = KEEPALIVE;
        stream.set_nonblocking(true)?;
        stream.set_nodelay(true)?;
        let socket = SockRef::from(&stream);
        socket.set_send_buffer_size(SEND_BUFFER)?;
        let keepalive = TcpKeepalive::new().with_time(idle).with_interval(interval);
        // Not every system has a number of its own for that.
        if socket.set_tcp_keepalive(&keepalive.clone().with_retries(count)).is_err() {
            socket.set_tcp_keepalive(&keepalive)?;
        }
        Ok(Self(stream))
    }

    /// The descriptor to wait for.
    #[cfg(target_os = "linux")]
    pub(crate) fn fd(&self) -> BorrowedFd<'_> {
        self.0.as_fd()
    }

    /// Reads once into `buffer`, which is not empty.
    pub(crate) fn read(&self, buffer: &mut [u8]) -> Result<ReadOutcome, PortError> {
        Ok(match self.receive(buffer)? {
            Received::Bytes(count) => ReadOutcome::Read(count),
            Received::Nothing => ReadOutcome::Empty,
            Received::End => ReadOutcome::Gone(LinkDownReason::Disconnected),
            Received::Lost(reason) => ReadOutcome::Gone(reason),
        })
    }

    /// Reads, and tells an orderly end from a connection that was lost.
    pub(crate) fn receive(&self, buffer: &mut [u8]) -> Result<Received, PortError> {
        match uninterrupted(|| (&self.0).read(buffer)) {
            Ok(0) => Ok(Received::End),
            Ok(count) => Ok(Received::Bytes(count)),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(Received::Nothing),
            Err(error) => match reason(&error) {
                Some(reason) => Ok(Received::Lost(reason)),
                None => Err(PortError::io("read from the connection", error)),
            },
        }
    }

    /// Writes what the connection takes at once; 0 if it is full.
    pub(crate) fn write(&self, bytes: &[u8]) -> Result<usize, PortError> {
        if bytes.is_empty() {
            return Ok(0);
        }
        match uninterrupted(|| (&self.0).write(bytes)) {
            Ok(count) => Ok(count),
            Err(error) if error.kind() == ErrorKind::WouldBlock => Ok(0),
            Err(error) => Err(match reason(&error) {
                Some(reason) => PortError::Gone(reason),
                None => PortError::io("write to the connection", error),
            }),
        }
    }

    /// Bytes that the other side has not acknowledged; 0 where the system does not tell.
    pub(crate) fn unsent(&self) -> usize {
        #[cfg(target_os = "linux")]
        let unsent = ioctl::output_queue(&self.0).unwrap_or(0);
        #[cfg(not(target_os = "linux"))]
        let unsent = 0;
        unsent
    }

    /// Whether the other side has stopped answering altogether. One that is
    /// full and says so lives, for however long. Where the system does not tell, a read or a
    /// write finds out.
    pub(crate) fn is_dead(&self) -> bool {
        #[cfg(target_os = "linux")]
        let is_dead = ioctl::unanswered(&self.0)
            .is_ok_and(|(again, probes)| again >= RETRANSMITS || probes >= PROBES);
        #[cfg(not(target_os = "linux"))]
        let is_dead = false;
        is_dead
    }
}

#[cfg(target_os = "linux")]
impl AsFd for Stream {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd()
    }
}

#[cfg(not(target_os = "linux"))]
impl crate::poll::Source for Stream {
    fn is_readable(&self) -> bool {
        let looked = self.0.peek(&mut [0]);
        looked.map_or_else(|error| error.kind() != ErrorKind::WouldBlock, |_| true)
    }
}

/// What a read of a connection found.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(crate) enum Received {
    Bytes(usize),
    Nothing,
    /// The other side has said all.
    End,
    /// The connection is lost.
    Lost(LinkDownReason),
}

fn connect_any(addresses: &[SocketAddr], timeout: Duration) -> io::Result<TcpStream> {
    let end = Instant::now() + timeout;
    let mut last = io::Error::new(io::ErrorKind::NotFound, "the name has no address");
    for address in addresses {
        let left = end.saturating_duration_since(Instant::now());
        match TcpStream::connect_timeout(address, left.max(Duration::from_millis(1))) {
            Ok(stream) => return Ok(stream),
            Err(error) => last = error,
        }
    }
    Err(last)
}

/// Does it again as long as a signal comes between.
fn uninterrupted<R>(mut act: impl FnMut() -> io::Result<R>) -> io::Result<R> {
    loop {
        match act() {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            done => return done,
        }
    }
}

/// Why the connection is gone, if this error says that it is.
fn reason(error: &io::Error) -> Option<LinkDownReason> {
    match error.kind() {
        ErrorKind::ConnectionReset | ErrorKind::BrokenPipe | ErrorKind::ConnectionAborted => {
            Some(LinkDownReason::Disconnected)
        }
        ErrorKind::TimedOut
        | ErrorKind::HostUnreachable
        | ErrorKind::NetworkUnreachable
        | ErrorKind::NetworkDown => Some(LinkDownReason::Failed),
        _ => None,
    }
}
