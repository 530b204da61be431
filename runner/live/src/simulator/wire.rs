//! What a simulated machine hangs on: a pty, or a TCP port that one program at a time connects to.

use std::io::{self, ErrorKind};
use std::net::{SocketAddr, TcpListener};

use crate::PortSpec;
use crate::error::PortError;
use crate::poll::Source;
use crate::port::ReadOutcome;
use crate::port::stream::Stream;
#[cfg(target_os = "linux")]
use crate::pty::PtyPair;

#[derive(Debug)]
pub(super) enum Wire {
    #[cfg(target_os = "linux")]
    Pty(PtyPair),
    Tcp(Listener),
}

/// A TCP port, and who is connected to it.
#[derive(Debug)]
pub(super) struct Listener {
    socket: TcpListener,
    address: SocketAddr,
    client: Option<Stream>,
}

impl Wire {
    #[cfg(target_os = "linux")]
    pub(super) fn pty() -> Result<Self, PortError> {
        Ok(Self::Pty(PtyPair::open()?))
    }

    #[cfg(not(target_os = "linux"))]
    pub(super) fn pty() -> Result<Self, PortError> {
        Err(PortError::NoPty)
    }

    pub(super) fn tcp(address: SocketAddr) -> Result<Self, PortError> {
        let bind = || -> io::Result<Listener> {
            let socket = TcpListener::bind(address)?;
            socket.set_nonblocking(true)?;
            let address = socket.local_addr()?;
            Ok(Listener { socket, address, client: None })
        };
        let failed = |source| PortError::Listen { address: address.to_string(), source };
        bind().map(Self::Tcp).map_err(failed)
    }

    /// What whoever is to connect opens.
    pub(super) fn port(&self) -> PortSpec {
        match self {
            #[cfg(target_os = "linux")]
            Self::Pty(pty) => PortSpec::Device(pty.slave_path().to_owned()),
            Self::Tcp(Listener { address, .. }) => {
                PortSpec::Tcp { host: address.ip().to_string(), port: address.port() }
            }
        }
    }

    /// Whether somebody is connected; of a pty that is not known, and what is written waits there.
    pub(super) fn is_connected(&self) -> bool {
        self.source().is_some()
    }

    /// What to wait for; `None`: nobody is connected.
    pub(super) fn source(&self) -> Option<&dyn Source> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Pty(pty) => Some(pty),
            Self::Tcp(listener) => listener.client.as_ref().map(|client| client as &dyn Source),
        }
    }

    /// Reads what is there; of a client that is gone nothing.
    pub(super) fn read(&mut self, buffer: &mut [u8]) -> Result<usize, PortError> {
        let outcome = match self {
            #[cfg(target_os = "linux")]
            Self::Pty(pty) => pty.read(buffer)?,
            Self::Tcp(listener) => {
                listener.accept();
                let Some(client) = &listener.client else { return Ok(0) };
                client.read(buffer)?
            }
        };
        Ok(match outcome {
            ReadOutcome::Read(count) => count,
            ReadOutcome::Empty => 0,
            ReadOutcome::Gone(_) => {
                self.hang_up();
                0
            }
        })
    }

    /// Writes what it takes; without a client, into the air.
    pub(super) fn write(&mut self, bytes: &[u8]) -> Result<usize, PortError> {
        match self {
            #[cfg(target_os = "linux")]
            Self::Pty(pty) => pty.write(bytes),
            Self::Tcp(listener) => {
                let Some(client) = &listener.client else { return Ok(bytes.len()) };
                match client.write(bytes) {
                    Err(PortError::Gone(_)) => {
                        self.hang_up();
                        Ok(bytes.len())
                    }
                    written => written,
                }
            }
        }
    }

    fn hang_up(&mut self) {
        #[cfg_attr(not(target_os = "linux"), expect(irrefutable_let_patterns))]
        if let Self::Tcp(listener) = self {
            listener.client = None;
        }
    }
}

impl Listener {
    /// Takes whoever comes; a second one is sent away.
    fn accept(&mut self) {
        loop {
            match self.socket.accept() {
                Ok((stream, _)) if self.client.is_none() => {
                    self.client = Stream::over(stream).ok();
                }
                Ok(_) => {}
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                // Nobody is there, or who was has gone again.
                Err(_) => return,
            }
        }
    }
}
