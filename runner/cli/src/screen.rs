//! Where output goes: results to standard output, everything else to standard
//! error; for people, or as JSON.
//!
//! Nothing else in this command writes to either (`clippy.toml` beside it sees to that): what
//! cannot be written is kept here, and ends the command as an error.
#![expect(clippy::disallowed_methods, reason = "this is the one place that writes")]

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};
use std::sync::OnceLock;

use anstyle::{AnsiColor, Style};
use serde::Serialize;
use softplug_live::plain_text;
use tracing_subscriber::EnvFilter;

use crate::exit::Exit;
use crate::failure::Failure;
use crate::global::{Color, Global};

const ERROR: Style = AnsiColor::Red.on_default().bold();
const HINT: Style = AnsiColor::Cyan.on_default().bold();
/// Column titles and headings.
pub(crate) const HEADING: Style = Style::new().bold();
pub(crate) const GOOD: Style = AnsiColor::Green.on_default();
pub(crate) const WARNING: Style = AnsiColor::Yellow.on_default();
pub(crate) const BAD: Style = AnsiColor::Red.on_default().bold();

/// Why the first result was not written that was not.
static UNWRITTEN: OnceLock<io::Error> = OnceLock::new();

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
            result(writeln!(anstream::stdout(), "{text}"));
        }
    }

    /// The result for machines, as one document; people do not get it.
    pub(crate) fn document(&self, value: &impl Serialize) {
        if self.json {
            let text = serde_json::to_string_pretty(value).expect("results are plain data");
            result(writeln!(io::stdout().lock(), "{text}"));
        }
    }

    /// One of several results for machines, as one line at once.
    pub(crate) fn json_line(&self, value: &impl Serialize) {
        if self.json {
            let text = serde_json::to_string(value).expect("results are plain data");
            let mut out = io::stdout().lock();
            result(writeln!(out, "{text}").and_then(|()| out.flush()));
        }
    }

    /// Bytes as they are, with or without `--json`.
    pub(crate) fn raw(bytes: &[u8]) {
        let mut out = io::stdout().lock();
        result(out.write_all(bytes).and_then(|()| out.flush()));
    }

    /// What the reading of the command line itself has to say, before there is a screen: help and
    /// the version as results, else an error.
    pub(crate) fn early(text: impl Display, is_error: bool, colours: anstream::ColorChoice) {
        if is_error {
            forgive(write!(anstream::AutoStream::new(io::stderr(), colours), "{text}"));
        } else {
            result(write!(anstream::AutoStream::new(io::stdout(), colours), "{text}"));
        }
    }

    /// What a tool that works for us says, as it says it.
    pub(crate) fn pass_on(said: &str) {
        forgive(io::stderr().lock().write_all(said.as_bytes()));
    }

    /// Whether somebody sits at the terminal: standard input and output are one.
    pub(crate) fn is_attended() -> bool {
        io::stdout().is_terminal() && io::stdin().is_terminal()
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

    /// Tells of an error, in a text that says itself that it is one.
    pub(crate) fn report(&self, text: impl Display) {
        if !self.json {
            forgive(writeln!(anstream::stderr(), "{text}"));
        }
    }

    /// The error that ends the command.
    pub(crate) fn failure(&self, failure: &Failure) {
        if self.json {
            result(writeln!(io::stdout().lock(), "{}", failure.json()));
            if UNWRITTEN.get().is_none() {
                return;
            }
        }
        say_failure(failure);
    }

    /// One of several, for people.
    pub(crate) fn report_failure(&self, failure: &Failure) {
        if self.json {
            return;
        }
        say_failure(failure);
    }
}

/// The command has ended with this: all results are brought out, and if one of them was not
/// written that is said, whatever else is to be quiet, and is the exit code of a command that is
/// done otherwise.
pub(crate) fn conclude(exit: Exit) -> Exit {
    result(io::stdout().lock().flush());
    let Some(error) = UNWRITTEN.get() else { return exit };
    say_failure(
        &Failure::usage(format_args!("standard output cannot be written: {error}"))
            .hint("what was printed is not all; what the command did beside printing stands"),
    );
    if exit == Exit::Done { Exit::Usage } else { exit }
}

fn say_failure(failure: &Failure) {
    let message = plain_lines(&failure.message);
    forgive(writeln!(anstream::stderr(), "{ERROR}error:{ERROR:#} {message}"));
    if let Some(hint) = &failure.hint {
        let hint = plain_lines(hint);
        forgive(writeln!(anstream::stderr(), "{HINT}hint:{HINT:#} {hint}"));
    }
}

/// A text of several lines, whose words may be others': names of files, answers, what was typed.
fn plain_lines(text: &str) -> String {
    let lines: Vec<String> = text.split('\n').map(plain_text).collect();
    lines.join("\n")
}

/// Part of a result was written, or was not. Who closes a pipe has read enough: that is no error.
fn result(written: io::Result<()>) {
    match written {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => drop(UNWRITTEN.set(error)),
        written => forgive(written),
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
        // Told on standard error, which is where it was not written, it would end the command.
        .log_internal_errors(false)
        .without_time()
        .with_target(false);
    // A second one in one process (tests) keeps the first log.
    let _ = log.try_init();
}
