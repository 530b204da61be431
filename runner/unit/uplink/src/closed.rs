//! Why an uplink is of no more use.

use std::io;

use softplug_unit_protocol::FrameError;
use thiserror::Error;

use crate::tls::TlsError;

/// The connection is of no more use.
#[derive(Debug, Error)]
pub enum Closed {
    /// The other side closed it.
    #[error("the other side closed the connection")]
    ByPeer,
    /// The connection failed.
    #[error("the connection failed: {0}")]
    Io(#[from] io::Error),
    /// What comes is not the unit protocol, or another version of it.
    #[error("what comes over the connection is not the unit protocol: {0}")]
    NoFrame(#[from] FrameError),
    /// Both sides were to show their keys first.
    #[error(transparent)]
    Tls(#[from] TlsError),
}

impl Closed {
    /// Whether the other side has ended it, orderly or not.
    pub fn is_by_peer(&self) -> bool {
        match self {
            Self::ByPeer => true,
            Self::Io(error) => error.kind() == io::ErrorKind::ConnectionReset,
            Self::NoFrame(_) | Self::Tls(_) => false,
        }
    }
}
