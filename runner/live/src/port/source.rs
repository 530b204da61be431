//! Whether a port has something to read.

use super::open::Port;
use crate::poll::Source;

impl Source for Port {
    fn is_readable(&self) -> bool {
        match self {
            Self::Tty(port) => port.is_readable(),
            Self::Tcp(port) => port.stream().is_readable(),
            Self::Rfc2217(port) => port.stream().is_readable(),
            Self::Pty(port) => match *port {},
        }
    }
}
