//! A TCP connection that never blocks, and whether its other side still lives.

use std::io;
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use rustix::io::{Errno, read, retry_on_intr};
use rustix::net::{SendFlags, send, sockopt};
use softplug_abi::LinkDownReason;

use super::ioctl;
use super::open::ReadOutcome;
use crate::error::PortError;

/// Silence after which the peer is probed, then how often and how many times:
/// a half-open connection is found within half a minute.
const KEEPALIVE: (Duration, Duration, u32) = (Duration::from_secs(10), Duration::from_secs(5), 4);
/// What the kernel holds of what was written is beyond recall, so it is little:
/// as much as 921,600 baud needs over a round trip of 40 ms, twice.
const SEND_BUFFER: usize = 8_192;
/// Bytes sent again so often without an answer have nobody to answer: 25 s.
const RETRANSMITS: u8 = 7;
/// Questions whether a full peer has room again that have nobody to answer: 25 s.
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
        sockopt::set_socket_send_buffer_size(&stream, SEND_BUFFER)?;
        sockopt::set_socket_keepalive(&stream, true)?;
        sockopt::set_tcp_keepidle(&stream, idle)?;
        sockopt::set_tcp_keepintvl(&stream, interval)?;
        sockopt::set_tcp_keepcnt(&stream, count)?;
        Ok(Self(stream))
    }

    /// The descriptor to wait for.
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
        match retry_on_intr(|| read(&self.0, &mut *buffer)) {
            Ok(0) => Ok(Received::End),
            Ok(count) => Ok(Received::Bytes(count)),
            Err(Errno::AGAIN) => Ok(Received::Nothing),
            Err(error) => match reason(error) {
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
        match retry_on_intr(|| send(&self.0, bytes, SendFlags::NOSIGNAL)) {
            Ok(count) => Ok(count),
            Err(Errno::AGAIN) => Ok(0),
            Err(error) => Err(match reason(error) {
                Some(reason) => PortError::Gone(reason),
                None => PortError::io("write to the connection", error),
            }),
        }
    }

    /// Bytes that the other side has not acknowledged.
    pub(crate) fn unsent(&self) -> usize {
        ioctl::output_queue(&self.0).unwrap_or(0)
    }

    /// Whether the other side has stopped answering altogether. One that is
    /// full and says so lives, for however long.
    pub(crate) fn is_dead(&self) -> bool {
        let unanswered = ioctl::unanswered(&self.0);
        unanswered.is_ok_and(|(again, probes)| again >= RETRANSMITS || probes >= PROBES)
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

/// Why the connection is gone, if this error says that it is.
fn reason(error: Errno) -> Option<LinkDownReason> {
    match error {
        Errno::CONNRESET | Errno::PIPE | Errno::CONNABORTED => Some(LinkDownReason::Disconnected),
        Errno::TIMEDOUT | Errno::HOSTUNREACH | Errno::NETUNREACH | Errno::NETDOWN => {
            Some(LinkDownReason::Failed)
        }
        _ => None,
    }
}
