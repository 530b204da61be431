//! A raw TCP connection to a device server as a port.

use std::io;
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
use std::os::fd::{AsFd, BorrowedFd};
use std::time::{Duration, Instant};

use rustix::io::{Errno, read, retry_on_intr};
use rustix::net::{SendFlags, send, sockopt};
use softplug_abi::{LineParameters, LinkDownReason};

use super::ioctl;
use super::marks::Input;
use super::open::ReadOutcome;
use super::spec::PortOptions;
use crate::error::PortError;

const READ_BYTES: usize = 4_096;
/// Silence after which the peer is probed, then how often and how many times:
/// a half-open connection is found within half a minute.
const KEEPALIVE: (Duration, Duration, u32) = (Duration::from_secs(10), Duration::from_secs(5), 4);

/// A connection, non-blocking. The server's own flow control holds us by the
/// TCP window, so there is no time-out on unacknowledged bytes.
#[derive(Debug)]
pub struct TcpPort {
    stream: TcpStream,
    line: LineParameters,
    buffer: Box<[u8]>,
}

impl TcpPort {
    /// Connects. Looking a name up may take longer than the time-out.
    pub fn connect(host: &str, port: u16, options: &PortOptions) -> Result<Self, PortError> {
        let failed = |source| PortError::Connect { address: format!("{host}:{port}"), source };
        let addresses: Vec<SocketAddr> = (host, port).to_socket_addrs().map_err(failed)?.collect();
        let stream = connect_any(&addresses, options.connect_timeout).map_err(failed)?;
        prepare(&stream).map_err(|error| PortError::io("set up the connection", error))?;
        let buffer = vec![0; READ_BYTES].into_boxed_slice();
        Ok(Self { stream, line: options.line, buffer })
    }

    /// The descriptor to wait for.
    pub fn fd(&self) -> BorrowedFd<'_> {
        self.stream.as_fd()
    }

    /// The characters on the line behind the server, as they were given.
    pub fn line(&self) -> LineParameters {
        self.line
    }

    /// Reads once, at most `most` bytes, and gives what came to `sink`.
    pub fn read(
        &mut self,
        most: usize,
        sink: &mut impl FnMut(Input<'_>),
    ) -> Result<ReadOutcome, PortError> {
        let most = most.min(READ_BYTES);
        match retry_on_intr(|| read(&self.stream, &mut self.buffer[..most])) {
            Ok(0) => Ok(ReadOutcome::Gone(LinkDownReason::Disconnected)),
            Ok(count) => {
                sink(Input::Bytes(&self.buffer[..count]));
                Ok(ReadOutcome::Read(count))
            }
            Err(Errno::AGAIN) => Ok(ReadOutcome::Empty),
            Err(error) => match reason(error) {
                Some(reason) => Ok(ReadOutcome::Gone(reason)),
                None => Err(PortError::io("read from the connection", error)),
            },
        }
    }

    /// Writes what the connection takes at once; 0 if it is full.
    pub fn write(&mut self, bytes: &[u8]) -> Result<usize, PortError> {
        if bytes.is_empty() {
            return Ok(0);
        }
        match retry_on_intr(|| send(&self.stream, bytes, SendFlags::NOSIGNAL)) {
            Ok(count) => Ok(count),
            Err(Errno::AGAIN) => Ok(0),
            Err(error) => Err(match reason(error) {
                Some(reason) => PortError::Gone(reason),
                None => PortError::io("write to the connection", error),
            }),
        }
    }

    /// Bytes that the server has not acknowledged.
    pub fn unsent(&self) -> usize {
        ioctl::output_queue(&self.stream).unwrap_or(0)
    }
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

fn prepare(stream: &TcpStream) -> io::Result<()> {
    let (idle, interval, count) = KEEPALIVE;
    stream.set_nonblocking(true)?;
    stream.set_nodelay(true)?;
    sockopt::set_socket_keepalive(stream, true)?;
    sockopt::set_tcp_keepidle(stream, idle)?;
    sockopt::set_tcp_keepintvl(stream, interval)?;
    sockopt::set_tcp_keepcnt(stream, count)?;
    Ok(())
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
