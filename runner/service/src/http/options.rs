//! Where the API listens, whom it lets in, and its limits.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

/// What [`serve`](super::serve) goes by.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Options {
    /// Address and port; port 0 takes a free one.
    pub listen: SocketAddr,
    /// The file of [tokens](super::Tokens). Without one nobody is let in.
    pub tokens: Option<PathBuf>,
    /// Speak TLS with this certificate.
    pub certificate: Option<Certificate>,
    /// Names by which it may be asked for, beside `localhost` and the address.
    pub names: Vec<String>,
    /// How much of what is taken.
    pub limits: Limits,
}

impl Options {
    /// Plain HTTP at this address, for the holders of these tokens.
    pub fn new(listen: SocketAddr, tokens: Option<PathBuf>) -> Self {
        let (names, limits) = (Vec::new(), Limits::default());
        Self { listen, tokens, certificate: None, names, limits }
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
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Limits {
    /// Largest program or plug-in that is taken, in bytes.
    pub upload_bytes: u64,
    /// Connections at one time; a further one is closed at once.
    pub connections: usize,
    /// Requests in a second that one address may go on with.
    pub requests_per_second: u32,
    /// Requests that it may make at once.
    pub burst: u32,
    /// Until a request's head has come, counted from the last answer; then the connection is
    /// closed.
    pub head_patience: Duration,
    /// A client that takes nothing of its answer for as long is gone.
    pub write_patience: Duration,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            upload_bytes: 64 * 1024 * 1024,
            connections: 1024,
            requests_per_second: 50,
            burst: 200,
            head_patience: Duration::from_secs(30),
            write_patience: Duration::from_secs(30),
        }
    }
}

/// Longest head of a request, in bytes.
pub(super) const HEAD_BYTES: usize = 32 * 1024;
/// Largest JSON document in a request, in bytes.
pub(super) const DOCUMENT_BYTES: usize = 64 * 1024;
/// Until a JSON document has come.
pub(super) const DOCUMENT_PATIENCE: Duration = Duration::from_secs(10);
/// How slowly a body may come, while we are ready to take it.
#[derive(Copy, Clone, Debug)]
pub(super) struct Pace {
    /// In this time …
    pub(super) patience: Duration,
    /// … so many bytes at least.
    pub(super) bytes: u64,
}

/// Of an upload.
pub(super) const UPLOAD_PACE: Pace = Pace { patience: Duration::from_secs(30), bytes: 4096 };
/// Of a direct feed, whose source may be a person or a machine too.
pub(super) const FEED_PACE: Pace = Pace { patience: Duration::from_mins(10), bytes: 1 };
/// Largest plug-in, in bytes; it is held in memory.
pub(super) const PLUGIN_BYTES: u64 = 16 * 1024 * 1024;
/// Lists that are read at one time; more wait.
pub(super) const LOOKS: usize = 2;
/// Programs that are checked at one time, each on a processor; more wait.
pub(super) const CHECKS: usize = 2;
/// Uploads at one time.
pub(super) const UPLOADS: usize = 32;
/// Direct feeds at one time; each has a thread.
pub(super) const FEEDS: usize = 64;
/// Streams of events at one time.
pub(super) const STREAMS: usize = 256;
/// A stream without news says so as often; less than [`Limits::head_patience`].
pub(super) const HEARTBEAT: Duration = Duration::from_secs(10);
/// What passes on a line is looked for as often.
pub(super) const GATHER: Duration = Duration::from_millis(50);
/// Changes are looked for as often.
pub(super) const GATHER_CHANGES: Duration = Duration::from_millis(200);
