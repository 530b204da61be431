//! An endpoint's client: its connection, what came from it and what waits to be
//! sent to it.

use std::collections::VecDeque;
use std::io;
use std::net::{SocketAddr, TcpStream};
use std::os::fd::{AsRawFd, RawFd};

use mio::event::Event;
use softplug_abi::LineParameters;

use super::telnet::Telnet;
use super::{EndpointKind, EndpointSetup};
use crate::error::PortError;
use crate::port::scratch::{READ_BYTES, with_scratch};
use crate::port::stream::{Received, Stream};
use crate::reactor::{EndpointRequest, LineNews};

/// What is taken in before a job takes it, so that there is known to be some.
const FRONT: usize = 512;

/// What there is to take from a client.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Taken {
    /// So many bytes.
    Bytes(usize),
    /// Nothing now.
    Nothing,
    /// Nothing any more: the client has said all.
    End,
}

#[derive(Debug)]
pub(super) struct Client {
    stream: Stream,
    address: SocketAddr,
    telnet: Option<Box<Telnet>>,
    /// Data from the client that no job has taken yet.
    front: VecDeque<u8>,
    /// What came of the connection and waits for room for its answers.
    input: Vec<u8>,
    /// Deliveries that wait to be sent.
    deliveries: VecDeque<u8>,
    /// Bytes of deliveries that have been sent and not been counted.
    drained: u32,
    /// The connection may have something to read, or room to write.
    readable: bool,
    writable: bool,
    /// Taking in waits for room for the answers.
    is_blocked: bool,
    /// The end of what the client sends is known to be there, or near.
    is_ending: bool,
    /// The client sends no more.
    has_said_all: bool,
    /// The connection is lost, without an end of what it sent.
    is_lost: bool,
    /// Something has been taken in since the last look.
    has_heard: bool,
}

impl Client {
    pub(super) fn new(
        stream: TcpStream,
        address: SocketAddr,
        setup: &EndpointSetup,
        line: Option<LineParameters>,
    ) -> io::Result<Self> {
        let telnet = match setup.kind {
            EndpointKind::Raw => None,
            EndpointKind::Rfc2217 => Some(Box::new(Telnet::new(setup.line, line))),
        };
        Ok(Self {
            stream: Stream::over(stream)?,
            address,
            telnet,
            front: VecDeque::new(),
            input: Vec::new(),
            deliveries: VecDeque::new(),
            drained: 0,
            readable: true,
            writable: true,
            is_blocked: false,
            is_ending: false,
            has_said_all: false,
            is_lost: false,
            has_heard: false,
        })
    }

    pub(super) fn fd(&self) -> RawFd {
        self.stream.fd().as_raw_fd()
    }

    pub(super) fn address(&self) -> SocketAddr {
        self.address
    }

    /// The connection has become ready.
    pub(super) fn ready(&mut self, event: &Event) {
        self.readable |= event.is_readable();
        self.writable |= event.is_writable();
        self.is_ending |= event.is_read_closed();
        self.is_lost |= event.is_error();
    }

    /// Takes a little in if nothing is there, so that a job can be begun for it,
    /// and so that a client that goes is noticed.
    pub(super) fn peek(&mut self) {
        if !self.front.is_empty() {
            return;
        }
        let mut buffer = [0; FRONT];
        if let Taken::Bytes(count) = self.take(&mut buffer) {
            self.front.extend(&buffer[..count]);
        }
    }

    /// Whether data is there.
    pub(super) fn has_data(&self) -> bool {
        !self.front.is_empty()
    }

    /// Whether [`take`](Self::take) may find something.
    pub(super) fn may_have_data(&self) -> bool {
        self.has_data() || self.has_more_to_read()
    }

    /// Whether the client has said all and all of it was taken.
    pub(super) fn has_said_all(&self) -> bool {
        self.has_said_all && self.front.is_empty() && self.input.is_empty()
    }

    /// Whether, but for a job under way, there is nothing left to do.
    pub(super) fn is_done(&self) -> bool {
        self.has_said_all() && !self.has_output()
    }

    /// Whether the connection is lost.
    pub(super) fn is_lost(&self) -> bool {
        self.is_lost
    }

    /// Whether something has come since the last call.
    pub(super) fn has_heard(&mut self) -> bool {
        std::mem::take(&mut self.has_heard)
    }

    /// Takes data.
    pub(super) fn take(&mut self, buffer: &mut [u8]) -> Taken {
        if !self.front.is_empty() {
            let count = buffer.len().min(self.front.len());
            for (to, from) in buffer.iter_mut().zip(self.front.drain(..count)) {
                *to = from;
            }
            return Taken::Bytes(count);
        }
        let taken = match self.telnet {
            None => self.take_raw(buffer),
            Some(_) => self.take_decoded(buffer),
        };
        self.has_heard |= matches!(taken, Taken::Bytes(_));
        taken
    }

    /// Drops what was taken in.
    pub(super) fn drop_front(&mut self) {
        self.front.clear();
    }

    /// Puts bytes of a delivery behind those that wait.
    pub(super) fn deliver(&mut self, bytes: &[u8]) {
        self.deliveries.extend(bytes);
    }

    /// Bytes of deliveries that wait.
    pub(super) fn waiting(&self) -> usize {
        self.deliveries.len()
    }

    /// Whether anything waits to be sent.
    pub(super) fn has_output(&self) -> bool {
        !self.deliveries.is_empty() || self.has_answers()
    }

    /// Sends what can be sent: answers always, deliveries if `deliveries`.
    pub(super) fn flush(&mut self, deliveries: bool) {
        while self.writable && !self.is_lost {
            let sent = match &mut self.telnet {
                None if deliveries => {
                    let sent = send(&self.stream, self.deliveries.as_slices().0);
                    if let Sent::Bytes(count) = sent {
                        self.deliveries.drain(..count);
                        self.drained += count as u32;
                    }
                    sent
                }
                None => return,
                Some(telnet) => {
                    if deliveries {
                        let count = telnet.deliver(self.deliveries.as_slices().0);
                        self.deliveries.drain(..count);
                        self.drained += count as u32;
                    }
                    let sent = send(&self.stream, telnet.output());
                    if let Sent::Bytes(count) = sent {
                        telnet.sent(count);
                        self.is_blocked = false;
                    }
                    sent
                }
            };
            match sent {
                Sent::Bytes(_) => {}
                Sent::Nothing => return,
                Sent::Full => self.writable = false,
                Sent::Lost => self.is_lost = true,
            }
        }
    }

    /// Bytes of deliveries that the connection took since the last call.
    pub(super) fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }

    pub(super) fn next_request(&mut self) -> Option<EndpointRequest> {
        let request = self.telnet.as_mut()?.next_request();
        // There is room for another.
        self.is_blocked &= request.is_none();
        request
    }

    /// Drops deliveries that wait, if the client wants that.
    pub(super) fn purge(&mut self) {
        if self.telnet.as_mut().is_some_and(|telnet| telnet.purges_received()) {
            self.drained += self.deliveries.len() as u32;
            self.deliveries.clear();
        }
    }

    pub(super) fn line_news(&mut self, news: &LineNews) {
        if let Some(telnet) = &mut self.telnet {
            telnet.line_news(news);
        }
    }

    /// Whether the other side has stopped answering altogether.
    pub(super) fn is_dead(&self) -> bool {
        self.stream.is_dead()
    }

    /// Sends a word to whoever is not let in.
    pub(super) fn turn_away(stream: &TcpStream, first: SocketAddr) {
        let word = format!("the link is in use by {first}\r\n");
        // If even this has no room, hanging up is all there is to say.
        let _ = stream.set_nonblocking(true);
        let _ = io::Write::write(&mut &*stream, word.as_bytes());
    }

    /// Whether the connection was not read to the end while nothing of it waits.
    pub(super) fn has_unread(&self) -> bool {
        !self.has_data() && self.has_more_to_read()
    }

    fn has_answers(&self) -> bool {
        self.telnet.as_ref().is_some_and(|telnet| !telnet.output().is_empty())
    }

    fn has_more_to_read(&self) -> bool {
        let can_read = self.readable && !self.has_said_all && !self.is_lost;
        !self.is_blocked && (can_read || !self.input.is_empty())
    }

    fn take_raw(&mut self, buffer: &mut [u8]) -> Taken {
        if !self.has_more_to_read() {
            return self.nothing();
        }
        let received = self.stream.receive(buffer);
        match self.received(&received, buffer.len()) {
            0 => self.nothing(),
            count => Taken::Bytes(count),
        }
    }

    fn take_decoded(&mut self, buffer: &mut [u8]) -> Taken {
        while self.has_more_to_read() {
            if self.input.is_empty() {
                let most = buffer.len().min(READ_BYTES);
                let received = with_scratch(|scratch| {
                    let received = self.stream.receive(&mut scratch[..most]);
                    if let Ok(Received::Bytes(count)) = received {
                        self.input.extend_from_slice(&scratch[..count]);
                    }
                    received
                });
                if self.received(&received, most) == 0 {
                    break;
                }
            }
            let Some(telnet) = &mut self.telnet else { break };
            let (taken, count) = telnet.receive(&self.input, buffer);
            self.input.drain(..taken);
            if telnet.is_broken() && !self.is_lost {
                tracing::warn!(client = %self.address, "its subnegotiation is too long; hanging up");
                self.is_lost = true;
            } else if taken == 0 {
                self.is_blocked = true;
            }
            self.flush(false);
            if count > 0 {
                return Taken::Bytes(count);
            }
        }
        self.nothing()
    }

    fn nothing(&self) -> Taken {
        if self.has_said_all() { Taken::End } else { Taken::Nothing }
    }

    /// What that means; how many bytes it brought.
    fn received(&mut self, received: &Result<Received, PortError>, asked: usize) -> usize {
        match received {
            Ok(Received::Bytes(count)) => {
                // A connection that gives less than was asked for has no more: what
                // comes later is told anew. The end may have been told already.
                self.readable = *count == asked || self.is_ending;
                return *count;
            }
            Ok(Received::Nothing) => self.readable = false,
            Ok(Received::End) => self.has_said_all = true,
            Ok(Received::Lost(_)) | Err(_) => self.is_lost = true,
        }
        0
    }
}

enum Sent {
    Bytes(usize),
    Nothing,
    Full,
    Lost,
}

fn send(stream: &Stream, bytes: &[u8]) -> Sent {
    if bytes.is_empty() {
        return Sent::Nothing;
    }
    match stream.write(bytes) {
        Ok(0) => Sent::Full,
        Ok(count) => Sent::Bytes(count),
        Err(_) => Sent::Lost,
    }
}
