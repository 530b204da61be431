//! Where output goes: results to standard output, everything else to standard
//! error; for people, or as JSON.

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};

use anstyle::{AnsiColor, Style};
use serde::Serialize;
use tracing_subscriber::EnvFilter;

use crate::arguments::{Color, Global};
use crate::failure::Failure;

const ERROR: Style = AnsiColor::Red.on_default().bold();
const HINT: Style = AnsiColor::Cyan.on_default().bold();
/// Column titles and headings.
pub(crate) const HEADING: Style = Style::new().bold();
pub(crate) const GOOD: Style = AnsiColor::Green.on_default();
pub(crate) const WARNING: Style = AnsiColor::Yellow.on_default();
pub(crate) const BAD: Style = AnsiColor::Red.on_default().bold();

/// The terminal, a pipe or a file that we speak to.
#[derive(Debug)]
pub(crate) struct Screen {
    json: bool,
    quiet: bool,
}

impl Screen {
    /// Also sets the colours.
    pub(crate) fn new(global: &Global) -> Self {
        match global.color {
            // Asks NO_COLOR, CLICOLOR_FORCE and the terminal.
            Color::Auto => anstream::ColorChoice::Auto,
            Color::Always => anstream::ColorChoice::Always,
            Color::Never => anstream::ColorChoice::Never,
        }
        .write_global();
        Self { json: global.json, quiet: global.quiet }
    }

    /// Whether machines read the results.
    pub(crate) fn is_json(&self) -> bool {
        self.json
    }

    /// Whether a progress bar would be seen and is wanted.
    pub(crate) fn shows_progress(&self) -> bool {
        !self.quiet && io::stderr().is_terminal()
    }

    /// A result for people; machines do not get it.
    pub(crate) fn say(&self, text: impl Display) {
        if !self.json {
            forgive(writeln!(anstream::stdout(), "{text}"));
        }
    }

    /// The result for machines, as one document; people do not get it.
    pub(crate) fn document(&self, value: &impl Serialize) {
        if self.json {
            let text = serde_json::to_string_pretty(value).expect("results are plain data");
            forgive(writeln!(io::stdout().lock(), "{text}"));
        }
    }

    /// One of several results for machines, as one line at once.
    pub(crate) fn json_line(&self, value: &impl Serialize) {
        if self.json {
            let text = serde_json::to_string(value).expect("results are plain data");
            let mut out = io::stdout().lock();
            forgive(writeln!(out, "{text}").and_then(|()| out.flush()));
        }
    }

    /// Bytes as they are, with or without `--json`.
    pub(crate) fn raw(bytes: &[u8]) {
        let mut out = io::stdout().lock();
        forgive(out.write_all(bytes).and_then(|()| out.flush()));
    }

    /// Something beside the result, for people.
    pub(crate) fn note(&self, text: impl Display) {
        if !self.quiet {
            forgive(writeln!(anstream::stderr(), "{text}"));
        }
    }

    /// An error for people; machines find it in the document.
    pub(crate) fn error(&self, text: impl Display) {
        self.report(format_args!("{ERROR}error:{ERROR:#} {text}"));
    }

    /// The same, of a text that says itself that it is an error.
    pub(crate) fn report(&self, text: impl Display) {
        if !self.json {
            forgive(writeln!(anstream::stderr(), "{text}"));
        }
    }

    /// The error that ends the command.
    pub(crate) fn failure(&self, failure: &Failure) {
        if self.json {
            forgive(writeln!(io::stdout().lock(), "{}", failure.json()));
            return;
        }
        self.report_failure(failure);
    }

    /// One of several, for people.
    pub(crate) fn report_failure(&self, failure: &Failure) {
        if self.json {
            return;
        }
        self.error(&failure.message);
        if let Some(hint) = &failure.hint {
            forgive(writeln!(anstream::stderr(), "{HINT}hint:{HINT:#} {hint}"));
        }
    }
}

/// Nobody can be told that nobody reads. The exit code still tells the result.
fn forgive(written: io::Result<()>) {
    if let Err(error) = written {
        tracing::debug!(%error, "output not written");
    }
}

/// Which lines the log has: SOFTPLUG_LOG, or a level by the options.
pub(crate) fn log_filter(global: &Global, plain: &str) -> String {
    let level = match (global.quiet, global.verbose) {
        (true, _) => "error",
        (false, 0) => plain,
        (false, 1) => "info",
        (false, 2) => "debug",
        (false, _) => "trace",
    };
    let filter = std::env::var("SOFTPLUG_LOG").ok().filter(|filter| !filter.is_empty());
    filter.unwrap_or_else(|| level.to_owned())
}

/// Whether the log has colours.
pub(crate) fn log_colours(global: &Global) -> bool {
    match global.color {
        Color::Auto => io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none(),
        Color::Always => true,
        Color::Never => false,
    }
}

/// Begins to log.
pub(crate) fn start_log(global: &Global) {
    let log = tracing_subscriber::fmt()
        .with_env_filter(EnvFilter::new(log_filter(global, "warn")))
        .with_writer(io::stderr)
        .with_ansi(log_colours(global))
        .without_time()
        .with_target(false);
    // A second one in one process (tests) keeps the first log.
    let _ = log.try_init();
}
