//! Where the API listens, whom it lets in, and its limits.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// What [`serve`](super::serve) goes by.
#[derive(Clone, Debug)]
pub struct Options {
    /// Address and port; port 0 takes a free one.
    pub listen: SocketAddr,
    /// The file of [tokens](super::Tokens). Without one nobody is let in.
    pub tokens: Option<PathBuf>,
    /// Speak TLS with this certificate.
    pub certificate: Option<Certificate>,
    /// How much of what is taken.
    pub limits: Limits,
}

impl Options {
    /// Plain HTTP at this address, for the holders of these tokens.
    pub fn new(listen: SocketAddr, tokens: Option<PathBuf>) -> Self {
        Self { listen, tokens, certificate: None, limits: Limits::default() }
    }
}

/// A certificate and its key, as PEM files.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Certificate {
    /// The certificate, and those that lead to its authority.
    pub chain: PathBuf,
    /// Its private key.
    pub key: PathBuf,
}

/// Limits of the API; what goes past one gets a problem as its answer.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields, default)]
pub struct Limits {
    /// Largest program or plug-in that is taken, in bytes.
    pub upload_bytes: u64,
    /// Connections at one time; a further one is closed at once.
    pub connections: usize,
    /// Requests in a second that one address may go on with.
    pub requests_per_second: u32,
    /// Requests that it may make at once.
    pub burst: u32,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            upload_bytes: 64 * 1024 * 1024,
            connections: 1024,
            requests_per_second: 50,
            burst: 200,
        }
    }
}

/// Largest JSON document in a request, in bytes.
pub(super) const DOCUMENT_BYTES: usize = 64 * 1024;
/// Until a request's head has come, counted from the last answer; then the connection is closed.
pub(super) const HEAD_PATIENCE: Duration = Duration::from_secs(30);
/// Until a JSON document has come.
pub(super) const DOCUMENT_PATIENCE: Duration = Duration::from_secs(10);
/// A client that takes nothing of its answer for as long is gone.
pub(super) const WRITE_PATIENCE: Duration = Duration::from_secs(60);
/// An upload is looked at as often, and must have brought [`UPLOAD_PACE`] bytes since.
pub(super) const UPLOAD_PATIENCE: Duration = Duration::from_secs(30);
/// See [`UPLOAD_PATIENCE`].
pub(super) const UPLOAD_PACE: u64 = 4096;
/// Uploads and direct feeds at one time.
pub(super) const UPLOADS: usize = 64;
/// Streams of events at one time.
pub(super) const STREAMS: usize = 256;
/// A stream without news says so as often; less than [`HEAD_PATIENCE`].
pub(super) const HEARTBEAT: Duration = Duration::from_secs(10);
/// News are looked for as often.
pub(super) const GATHER: Duration = Duration::from_millis(50);
