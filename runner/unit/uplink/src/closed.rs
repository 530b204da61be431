//! Why an uplink is of no more use.

use std::io;

use rustls::Error as RustlsError;
use softplug_unit_protocol::FrameError;
use thiserror::Error;

use crate::keys::TlsPublicKey;

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

/// Why TLS with the other side came to nothing.
#[derive(Debug, Error)]
pub enum TlsError {
    /// It has another key.
    #[error("the other side has the key {got}, and not {expected}")]
    OtherKey {
        /// What it has.
        got: TlsPublicKey,
        /// What is expected; several, with commas.
        expected: String,
    },
    /// It has a key or a certificate of another kind.
    #[error("the other side has no Ed25519 key of its own, and {expected} is expected")]
    NoKey {
        /// What is expected; several, with commas.
        expected: String,
    },
    /// It expects another key of this side.
    #[error("the other side does not know this side's key {own}")]
    Unknown {
        /// What this side has.
        own: TlsPublicKey,
    },
    /// It speaks in the clear.
    #[error("the other side speaks without TLS")]
    Plain,
    /// It wants TLS, and this side has no keys for it.
    #[error("the other side speaks TLS, and no key is configured for it here")]
    Wanted,
    /// It went away in the middle of the handshake.
    #[error("the other side closed the connection in the handshake of TLS: it may know no TLS")]
    Left,
    /// It did not come to an end of the handshake.
    #[error("the handshake of TLS has not come to an end in time")]
    Slow,
    /// Anything else.
    #[error("TLS failed: {0}")]
    Failed(RustlsError),
}
