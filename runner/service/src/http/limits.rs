//! Limits of the API that nobody configures.

use std::time::Duration;

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
/// A stream without news says so as often; less than [`Limits::head_patience`](super::Limits::head_patience).
pub(super) const HEARTBEAT: Duration = Duration::from_secs(10);
/// What passes on a line is looked for as often.
pub(super) const GATHER: Duration = Duration::from_millis(50);
/// Changes are looked for as often.
pub(super) const GATHER_CHANGES: Duration = Duration::from_millis(200);
