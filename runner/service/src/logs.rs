//! The gateway's log, to standard error: lines for people, or one JSON object a
//! line for machines.

use std::io;

use tracing_subscriber::EnvFilter;

use crate::config::LogFormat;

/// Begins to log. `filter` is in the form of `SOFTPLUG_LOG`: a level, or levels
/// by part. In a process that logs already nothing changes.
pub fn start(format: LogFormat, filter: &str, colours: bool) {
    let log = tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::new(filter))
        .with_writer(io::stderr)
        .with_ansi(colours)
        // A line that cannot be written is lost. Told on standard error, which is where it could not
        // be written, it would end the process.
        .log_internal_errors(false)
        .with_target(false);
    let started = match format {
        LogFormat::Human => log.try_init(),
        LogFormat::Json => log.json().flatten_event(true).try_init(),
    };
    if let Err(error) = started {
        tracing::debug!(%error, "the log was started before");
    }
}
