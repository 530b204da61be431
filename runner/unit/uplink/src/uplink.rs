//! An uplink of whatever kind, and what a session says over it.

use std::io;
use std::net::SocketAddr;

use mio::event::Source;
use mio::{Interest, Registry, Token};
use softplug_abi::Micros;
use softplug_unit_protocol::{LONGEST, Session};

use crate::can::CanUplink;
use crate::closed::Closed;
use crate::outbox::Outbox;
use crate::tcp::TcpUplink;

/// What carries frames.
#[derive(Debug)]
pub enum Uplink {
    /// A TCP connection.
    Tcp(TcpUplink),
    /// ISO-TP between two addresses of a CAN bus.
    Can(CanUplink),
}

impl Uplink {
    /// The next whole frame that has come; `None`: not before the source is readable again.
    ///
    /// # Errors
    /// The uplink is of no more use.
    pub fn receive(&mut self) -> Result<Option<&[u8]>, Closed> {
        match self {
            Self::Tcp(uplink) => uplink.receive(),
            Self::Can(uplink) => uplink.receive(),
        }
    }

    /// Bits that went over it, both ways, since it was asked last: over TCP those of the frames
    /// alone, over CAN with what ISO-TP and CAN put around them.
    pub fn take_bits(&mut self) -> u64 {
        match self {
            Self::Tcp(uplink) => uplink.take_bits(),
            Self::Can(uplink) => uplink.take_bits(),
        }
    }

    /// Whether another frame would leave soon. A session that is asked for frames earlier takes the
    /// time that they wait for time on their way, and sends them again.
    pub fn has_room(&self) -> bool {
        match self {
            Self::Tcp(uplink) => uplink.has_room(),
            Self::Can(uplink) => uplink.has_room(),
        }
    }

    /// Sends a frame, or keeps what does not leave yet.
    ///
    /// # Errors
    /// The uplink is of no more use.
    pub fn send(&mut self, frame: &[u8]) -> Result<(), Closed> {
        match self {
            Self::Tcp(uplink) => uplink.send(frame),
            Self::Can(uplink) => uplink.send(frame),
        }
    }

    /// Sends a frame behind which nothing follows, to somebody whose frames are none.
    ///
    /// # Errors
    /// The uplink is of no more use.
    pub fn send_last(&mut self, frame: &[u8]) -> Result<(), Closed> {
        self.send(frame)?;
        match self {
            Self::Tcp(uplink) => uplink.finish(),
            Self::Can(_) => Ok(()),
        }
    }

    /// Sends what waits. `false`: some of it still does; again when the source is writable.
    ///
    /// # Errors
    /// The uplink is of no more use.
    pub fn flush(&mut self) -> Result<bool, Closed> {
        match self {
            Self::Tcp(uplink) => uplink.flush(),
            Self::Can(uplink) => uplink.flush(),
        }
    }

    /// Sends what a session has to say, and what waits in an outbox for room in it, as far as there
    /// is room; the rest when the source is writable.
    ///
    /// # Errors
    /// The uplink is of no more use.
    pub fn speak<const SLOTS: usize, const BYTES: usize>(
        &mut self,
        session: &mut Session<SLOTS, BYTES>,
        outbox: &mut Outbox,
        now: Micros,
    ) -> Result<(), Closed> {
        self.flush()?;
        outbox.pump(session);
        let mut frame = [0; LONGEST];
        while self.has_room()
            && let Some(length) = session.poll_transmit(now, &mut frame)
        {
            match self {
                Self::Tcp(uplink) => uplink.keep(&frame[..length]),
                Self::Can(uplink) => uplink.send(&frame[..length])?,
            }
            outbox.pump(session);
            if !self.has_room() {
                self.flush()?;
            }
        }
        self.flush()?;
        Ok(())
    }

    /// Whether the handshake of TLS is under way.
    pub fn is_handshaking(&self) -> bool {
        match self {
            Self::Tcp(uplink) => uplink.is_handshaking(),
            Self::Can(_) => false,
        }
    }

    /// Who is at the other end of a TCP connection, if that is known.
    pub fn peer(&self) -> Option<SocketAddr> {
        match self {
            Self::Tcp(uplink) => uplink.peer(),
            Self::Can(_) => None,
        }
    }

    fn source(&mut self) -> &mut dyn Source {
        match self {
            Self::Tcp(uplink) => uplink,
            Self::Can(uplink) => uplink,
        }
    }
}

/// Edge-triggered: after it was told readable, [`Uplink::receive`] until `None`.
impl Source for Uplink {
    fn register(
        &mut self,
        registry: &Registry,
        token: Token,
        interests: Interest,
    ) -> io::Result<()> {
        self.source().register(registry, token, interests)
    }

    fn reregister(
        &mut self,
        registry: &Registry,
        token: Token,
        interests: Interest,
    ) -> io::Result<()> {
        self.source().reregister(registry, token, interests)
    }

    fn deregister(&mut self, registry: &Registry) -> io::Result<()> {
        self.source().deregister(registry)
    }
}
