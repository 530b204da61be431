//! The descriptor of a port: what the kernel waits for, and what another process can keep.

use std::os::fd::{AsFd, BorrowedFd, OwnedFd};

use super::open::Port;

impl Port {
    /// A descriptor that keeps a device open, as it is, until another process has opened it; see
    /// [`TtyPort::hand_over`](super::TtyPort::hand_over). `None`: there is nothing to keep.
    pub fn hand_over(&mut self) -> Option<OwnedFd> {
        match self {
            Self::Tty(port) => port
                .hand_over()
                .map_err(|error| tracing::warn!(%error, "a port is closed for a moment"))
                .ok(),
            Self::Tcp(_) | Self::Rfc2217(_) | Self::Pty(_) => None,
        }
    }

    /// The descriptor to wait for.
    pub fn fd(&self) -> BorrowedFd<'_> {
        match self {
            Self::Tty(port) => port.fd(),
            Self::Tcp(port) => port.fd(),
            Self::Rfc2217(port) => port.fd(),
            Self::Pty(port) => port.fd(),
        }
    }
}

impl AsFd for Port {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.fd()
    }
}
