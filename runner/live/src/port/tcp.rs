//! A raw TCP connection to a device server as a port.

#[cfg(target_os = "linux")]
use std::os::fd::BorrowedFd;

use softplug_abi::{LineParameters, LinkDownReason, Micros};

use super::input_sink::{Backlog, InputOnly, InputSink};
use super::marks::Input;
use super::read_outcome::ReadOutcome;
use super::scratch::with_scratch;
use super::spec::PortOptions;
use super::stream::Stream;
use crate::error::PortError;

/// How often it is asked whether the server still answers.
const LOOK_EVERY: Micros = Micros::from_secs(10);

/// A connection, non-blocking. The server's own flow control holds us.
#[derive(Debug)]
pub struct TcpPort {
    stream: Stream,
    line: LineParameters,
    next_look: Micros,
}

impl TcpPort {
    /// Connects. Looking a name up may take longer than the time-out.
    pub fn connect(host: &str, port: u16, options: &PortOptions) -> Result<Self, PortError> {
        let stream = Stream::connect(host, port, options.connect_timeout)?;
        Ok(Self { stream, line: options.line, next_look: Micros(0) })
    }

    /// The descriptor to wait for.
    #[cfg(target_os = "linux")]
    pub fn fd(&self) -> BorrowedFd<'_> {
        self.stream.fd()
    }

    #[cfg(not(target_os = "linux"))]
    pub(super) fn stream(&self) -> &Stream {
        &self.stream
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
        self.read_to(most, &mut InputOnly(sink))
    }

    pub(super) fn read_to(
        &mut self,
        most: usize,
        sink: &mut impl InputSink,
    ) -> Result<ReadOutcome, PortError> {
        with_scratch(|buffer| {
            let most = most.min(buffer.len());
            let outcome = self.stream.read(&mut buffer[..most])?;
            if let ReadOutcome::Read(count) = outcome {
                sink.came(|| Backlog { bytes: self.stream.unsent(), is_empty: false });
                sink.heard(Input::Bytes(&buffer[..count]));
            }
            Ok(outcome)
        })
    }

    /// Writes what the connection takes at once; 0 if it is full.
    pub fn write(&mut self, bytes: &[u8]) -> Result<usize, PortError> {
        self.stream.write(bytes)
    }

    /// Bytes that the server has not acknowledged.
    pub fn unsent(&self) -> usize {
        self.stream.unsent()
    }

    /// Looks now and then whether the server still answers.
    pub fn handle_timeout(&mut self, now: Micros) -> Result<(), PortError> {
        if now < self.next_look {
            return Ok(());
        }
        self.next_look = now + LOOK_EVERY;
        if self.stream.is_dead() { Err(PortError::Gone(LinkDownReason::Failed)) } else { Ok(()) }
    }

    /// When [`handle_timeout`](Self::handle_timeout) wants to be called.
    pub fn poll_timeout(&self) -> Micros {
        self.next_look
    }
}
