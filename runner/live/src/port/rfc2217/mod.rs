//! A device server of RFC 2217 as a port: its serial port is set from here,
//! and tells its modem lines and line errors.

mod liveness;
mod session;

use std::io;
#[cfg(target_os = "linux")]
use std::os::fd::BorrowedFd;
use std::time::{Duration, Instant};

use softplug_abi::{LineParameters, LinkDownReason, Micros, ModemLines};

use self::liveness::Liveness;
use self::session::{Broken, Opening, Session};
use super::input_sink::{Backlog, InputOnly, InputSink};
use super::marks::Input;
use super::read_outcome::ReadOutcome;
use super::scratch::with_scratch;
use super::spec::{PortOptions, address_text};
use super::stream::Stream;
use crate::clock::Clock;
use crate::difference::{SettingDifference, refused};
use crate::error::PortError;
use crate::poll::{Interest, Poller};

/// Once the server has agreed to be set, each setting is answered within a round
/// trip, or never.
const SETTLE: Duration = Duration::from_secs(2);
/// Bytes from the line that are kept while the server is being set.
const EARLY_BYTES: usize = 65_536;

/// A connection to a device server that sets its port as asked. Non-blocking
/// but for [`connect`](Self::connect).
#[derive(Debug)]
pub struct Rfc2217Port {
    stream: Stream,
    session: Session,
    liveness: Liveness,
    /// What came from the line before the port was open.
    early: Vec<u8>,
    /// Lost, maybe found out when some bytes were taken: told by every call from
    /// then on.
    lost: Option<LinkDownReason>,
}

impl Rfc2217Port {
    /// Connects, agrees on the options and sets the server's port. All
    /// together takes at most the time-out, but for looking a name up. A server that
    /// answers with other settings is [`PortError::NotTaken`]; what it does not
    /// answer is found in [`differences`](Self::differences).
    pub fn connect(host: &str, port: u16, options: &PortOptions) -> Result<Self, PortError> {
        let end = Instant::now() + options.connect_timeout;
        let stream = Stream::connect(host, port, options.connect_timeout)?;
        let mut port_of_server = Self {
            stream,
            session: Session::new(options),
            liveness: Liveness::default(),
            early: Vec::new(),
            lost: None,
        };
        port_of_server.negotiate(end).map_err(|error| match error {
            Failed::Port(error) => error,
            Failed::Peer(reason) => {
                PortError::NotRfc2217 { address: address_text(host, port), reason }
            }
            Failed::HungUp => PortError::Connect {
                address: address_text(host, port),
                source: io::Error::new(
                    io::ErrorKind::ConnectionReset,
                    "the server hung up at once; maybe another client has its port",
                ),
            },
        })?;
        port_of_server.session.compare();
        match refused(port_of_server.differences()) {
            None => Ok(port_of_server),
            Some(found) => Err(PortError::NotTaken { port: address_text(host, port), found }),
        }
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

    /// The rate as the server tells it, the rest as it was asked for.
    pub fn line(&self) -> LineParameters {
        self.session.line()
    }

    /// What was asked for and the server did not take, or did not answer.
    pub fn differences(&self) -> &[SettingDifference] {
        self.session.differences()
    }

    /// What the server calls itself, escaped, if it said so.
    pub fn signature(&self) -> Option<&str> {
        self.session.signature()
    }

    /// Reads once, at most `most` bytes of the connection, and gives what the
    /// line brought to `sink`: maybe nothing, if the server only answered.
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
        if !self.early.is_empty() {
            let rest = self.early.split_off(most.min(self.early.len()));
            let early = std::mem::replace(&mut self.early, rest);
            sink.came(|| Backlog { bytes: self.unsent(), is_empty: false });
            sink.heard(Input::Bytes(&early));
            return Ok(ReadOutcome::Read(early.len()));
        }
        let outcome = match self.take_in(most, sink) {
            Err(PortError::Gone(reason)) => ReadOutcome::Gone(reason),
            outcome => outcome?,
        };
        if let ReadOutcome::Gone(reason) = outcome {
            self.lost = Some(reason);
        }
        Ok(outcome)
    }

    /// Writes what finds room at once; 0 if there is none, or if the server
    /// [wants a pause](Self::is_suspended).
    pub fn write(&mut self, bytes: &[u8]) -> Result<usize, PortError> {
        self.flush()?;
        let mut taken = 0;
        while taken < bytes.len() && self.session.waiting() == 0 {
            let count = self.session.write(&bytes[taken..]);
            if count == 0 {
                break;
            }
            taken += count;
            self.liveness.wrote();
            match self.flush() {
                Err(PortError::Gone(reason)) => self.lost = Some(reason),
                flushed => flushed?,
            }
        }
        Ok(taken)
    }

    /// Bytes that the server has not acknowledged, as they are on the
    /// connection.
    pub fn unsent(&self) -> usize {
        self.stream.unsent() + self.session.waiting()
    }

    /// Whether the server's port obeys the partner's XON/XOFF.
    pub(super) fn is_stoppable(&self) -> bool {
        self.session.is_stoppable()
    }

    /// Has the server drop what it has not sent.
    pub fn discard_output(&mut self) -> Result<(), PortError> {
        self.session.purge_transmit();
        self.flush()
    }

    /// The lines that the port has, as far as the server has told, and those
    /// that are on.
    pub fn modem_lines(&self) -> (ModemLines, ModemLines) {
        self.session.modem_lines()
    }

    /// Has the server set the lines of `mask`.
    pub fn set_modem_lines(&mut self, mask: ModemLines, on: ModemLines) -> Result<(), PortError> {
        self.session.set_modem_lines(mask, on);
        self.flush()
    }

    /// Has the server hold the line low, or no longer.
    pub fn set_break(&mut self, on: bool) -> Result<(), PortError> {
        self.session.set_break(on);
        self.flush()
    }

    /// Lets wait what waits for room, and asks now and then whether the server
    /// still lives.
    pub fn handle_timeout(&mut self, now: Micros) -> Result<(), PortError> {
        self.flush()?;
        let is_idle = self.session.waiting() == 0;
        match self.liveness.look(now, self.session.rates(), is_idle) {
            liveness::Look::Fine => {}
            liveness::Look::Ask => {
                self.session.ask();
                self.flush()?;
            }
            liveness::Look::Dead => return Err(PortError::Gone(LinkDownReason::Failed)),
        }
        if self.stream.is_dead() { Err(PortError::Gone(LinkDownReason::Failed)) } else { Ok(()) }
    }

    /// When [`handle_timeout`](Self::handle_timeout) wants to be called.
    pub fn poll_timeout(&self) -> Micros {
        self.liveness.poll_timeout()
    }

    /// Whether answers wait for room: then wait for room, too.
    pub fn has_output(&self) -> bool {
        self.session.waiting() > 0
    }

    /// Whether the server wants a pause. Its end comes with what is read.
    pub fn is_suspended(&self) -> bool {
        self.session.is_suspended()
    }

    fn take_in(
        &mut self,
        most: usize,
        sink: &mut impl InputSink,
    ) -> Result<ReadOutcome, PortError> {
        self.flush()?;
        let unsent = self.session.waiting();
        let outcome = if self.session.has_rest() {
            sink.came(|| Backlog { bytes: self.stream.unsent() + unsent, is_empty: false });
            match self.session.resume(most, &mut |input| sink.heard(input)) {
                0 => ReadOutcome::Empty,
                count => ReadOutcome::Read(count),
            }
        } else {
            let (stream, session) = (&self.stream, &mut self.session);
            with_scratch(|buffer| {
                let most = most.min(buffer.len());
                let outcome = stream.read(&mut buffer[..most])?;
                if let ReadOutcome::Read(count) = outcome {
                    sink.came(|| Backlog { bytes: stream.unsent() + unsent, is_empty: false });
                    session.receive(&buffer[..count], &mut |input| sink.heard(input));
                }
                Ok::<_, PortError>(outcome)
            })?
        };
        if matches!(outcome, ReadOutcome::Read(_)) {
            self.liveness.heard();
            // A loss is told by the next call: these bytes count.
            if let Err(PortError::Gone(reason)) = self.flush() {
                self.lost = Some(reason);
            }
        }
        Ok(outcome)
    }

    /// Writes what the session has to say, as far as there is room.
    fn flush(&mut self) -> Result<(), PortError> {
        if let Some(reason) = self.lost {
            return Err(PortError::Gone(reason));
        }
        if self.session.broken().is_some() {
            return Err(PortError::Gone(LinkDownReason::Failed));
        }
        loop {
            let output = self.session.output();
            if output.is_empty() {
                return Ok(());
            }
            match self.stream.write(output)? {
                0 => return Ok(()),
                count => self.session.sent(count),
            }
        }
    }

    fn negotiate(&mut self, mut end: Instant) -> Result<(), Failed> {
        let mut is_settling = false;
        let mut poller = Poller::new(Clock::start()).map_err(Failed::Port)?;
        loop {
            self.exchange()?;
            match self.session.opening() {
                Opening::Done => return Ok(()),
                Opening::Setting if !is_settling => {
                    is_settling = true;
                    end = end.min(Instant::now() + SETTLE);
                }
                Opening::Setting | Opening::Offered => {}
            }
            if Instant::now() >= end {
                return match self.session.opening() {
                    Opening::Offered => Err(Failed::Peer("it does not answer the offer")),
                    // It answers no more, which is a difference.
                    Opening::Setting | Opening::Done => Ok(()),
                };
            }
            self.wait(&mut poller, end)?;
        }
    }

    /// Writes and reads what there is.
    fn exchange(&mut self) -> Result<(), Failed> {
        loop {
            let mut early = std::mem::take(&mut self.early);
            let most = EARLY_BYTES.saturating_sub(early.len());
            let mut keep = |input: Input<'_>| {
                if let Input::Bytes(bytes) = input {
                    early.extend_from_slice(bytes);
                }
            };
            let outcome = self.take_in(most, &mut InputOnly(&mut keep));
            self.early = early;
            match self.session.broken() {
                Some(Broken::Refused) => return Err(Failed::Peer("it refuses to set its port")),
                Some(Broken::Echo) => return Err(Failed::Peer("it sends back what it is sent")),
                Some(Broken::Overlong) => {
                    return Err(Failed::Peer("its subnegotiation is longer than any can be"));
                }
                Some(Broken::Deaf | Broken::Reset) | None => {}
            }
            let outcome = outcome.map_err(|error| match error {
                PortError::Gone(_) => Failed::HungUp,
                error => Failed::Port(error),
            })?;
            match outcome {
                ReadOutcome::Read(_) if self.early.len() < EARLY_BYTES => {}
                ReadOutcome::Read(_) | ReadOutcome::Empty => return Ok(()),
                ReadOutcome::Gone(_) => return Err(Failed::HungUp),
            }
        }
    }

    fn wait(&self, poller: &mut Poller, end: Instant) -> Result<(), Failed> {
        let left = end.saturating_duration_since(Instant::now());
        let left = Micros(i64::try_from(left.as_micros()).unwrap_or(i64::MAX));
        let interest = Interest { read: true, write: self.has_output() };
        let deadline = poller.clock().now() + left;
        poller.wait(Some(&self.stream), interest, Some(deadline)).map_err(Failed::Port)?;
        Ok(())
    }
}

/// Why opening failed.
enum Failed {
    Port(PortError),
    Peer(&'static str),
    HungUp,
}
