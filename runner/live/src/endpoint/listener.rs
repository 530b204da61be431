//! Where an endpoint listens.

use std::io;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::os::fd::AsRawFd;

use mio::unix::SourceFd;
use mio::{Interest, Registry, Token};
use softplug_abi::Micros;

/// Clients that are let in or turned away in a second; others wait.
const ACCEPTS: u32 = 16;
const ACCEPTS_EVERY: Micros = Micros::from_millis(1_000);
/// How long after a failure it is tried again to listen.
const LISTEN_AGAIN: Micros = Micros::from_millis(5_000);

#[derive(Debug)]
pub(super) struct EndpointListener {
    address: SocketAddr,
    token: Token,
    listener: Option<TcpListener>,
    listen_again: Option<Micros>,
    /// Somebody may wait to be let in.
    acceptable: bool,
    /// How many may be let in now.
    accepts: u32,
    accept_again: Option<Micros>,
}

impl EndpointListener {
    /// Listens, or says why not.
    pub(super) fn new(address: SocketAddr) -> (Self, Option<String>) {
        let (listener, failure) = match listen(address) {
            Ok(listener) => (Some(listener), None),
            Err(error) => (None, Some(failed(address, &error))),
        };
        let listener = Self {
            address,
            token: Token(0),
            listener,
            listen_again: None,
            acceptable: false,
            accepts: ACCEPTS,
            accept_again: None,
        };
        (listener, failure)
    }

    /// Where it listens, if it does.
    pub(super) fn address(&self) -> Option<SocketAddr> {
        self.listener.as_ref().and_then(|listener| listener.local_addr().ok())
    }

    pub(super) fn attach(
        &mut self,
        registry: &Registry,
        token: Token,
        now: Micros,
    ) -> io::Result<()> {
        self.token = token;
        let Some(listener) = &self.listener else {
            self.listen_again = Some(now + LISTEN_AGAIN);
            return Ok(());
        };
        registry.register(&mut SourceFd(&listener.as_raw_fd()), token, Interest::READABLE)?;
        self.acceptable = true;
        Ok(())
    }

    /// Is no longer told of who comes, until it is attached again.
    pub(super) fn leave(&mut self, registry: &Registry) {
        if let Some(listener) = &self.listener {
            let _ = registry.deregister(&mut SourceFd(&listener.as_raw_fd()));
        }
    }

    pub(super) fn detach(&mut self, registry: &Registry) {
        self.leave(registry);
        self.listener = None;
        self.listen_again = None;
    }

    /// Somebody has come.
    pub(super) fn ready(&mut self) {
        self.acceptable = true;
    }

    /// Tries again to listen, where it is time; gives a failure of another kind
    /// than that the address is taken.
    pub(super) fn turn(&mut self, registry: &Registry, now: Micros) -> Option<String> {
        if self.listener.is_some() || self.listen_again.is_none_or(|at| at > now) {
            return None;
        }
        self.listen_again = None;
        self.listener = listen(self.address).ok();
        let attached = self.attach(registry, self.token, now);
        attached.err().map(|error| failed(self.address, &error))
    }

    /// The next client that wants to connect.
    pub(super) fn next(&mut self, now: Micros) -> Option<(TcpStream, SocketAddr)> {
        if self.accept_again.is_some_and(|at| at <= now) {
            self.accept_again = None;
            self.accepts = ACCEPTS;
        }
        let listener = self.listener.as_ref().filter(|_| self.acceptable)?;
        if self.accepts > 0 {
            match listener.accept() {
                Ok(accepted) => {
                    self.accepts -= 1;
                    return Some(accepted);
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    self.acceptable = false;
                    return None;
                }
                // Somebody who went before being let in, or no descriptors left.
                Err(_) => self.accepts = 0,
            }
        }
        self.accept_again.get_or_insert(now + ACCEPTS_EVERY);
        None
    }

    pub(super) fn poll_timeout(&self) -> Option<Micros> {
        [self.listen_again, self.accept_again].into_iter().flatten().min()
    }

    /// The time began anew: what was to come is looked at now.
    pub(super) fn look_at(&mut self, now: Micros) {
        self.listen_again = self.listen_again.map(|_| now);
        self.accept_again = self.accept_again.map(|_| now);
    }
}

fn listen(address: SocketAddr) -> io::Result<TcpListener> {
    let listener = TcpListener::bind(address)?;
    listener.set_nonblocking(true)?;
    Ok(listener)
}

fn failed(address: SocketAddr, error: &io::Error) -> String {
    format!("failed to listen on {address}: {error}")
}
