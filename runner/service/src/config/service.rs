//! The tables `[gateway]` and `[supervision]`.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use toml::{Spanned, Value};

use super::finding::ConfigFindings;
use super::written::{self, Text};
use crate::programs::FREE_SPACE;
use crate::view::StopHow;
use softplug_live::quantity;

/// The gateway itself.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct GatewayConfig {
    /// Folder of the database and the snapshots.
    pub state: PathBuf,
    /// Folder of the plug-ins.
    pub library: PathBuf,
    /// Folders of programs; uploads go to the first.
    pub programs: Vec<PathBuf>,
    /// Folder below which each link's receptions are put.
    pub receptions: PathBuf,
    /// Folder of the traces that led to faults.
    pub traces: PathBuf,
    /// I/O threads; by the number of links if `None`.
    pub threads: Option<usize>,
    /// Links that one thread serves.
    pub links_per_thread: usize,
    /// Real-time priority of I/O threads; an ordinary one if `None`.
    pub real_time_priority: Option<u8>,
    /// How to log.
    pub log: LogFormat,
    /// What a stop does with jobs.
    pub stop: StopHow,
    /// How long a stop waits for them.
    pub stop_patience: Duration,
    /// A change of the file takes effect at once.
    pub watch: bool,
    /// Entries that the journal keeps.
    pub journal: u64,
    /// Bytes of the disk that only jobs and journal may use.
    pub free_space: u64,
}

/// How to log.
#[derive(Copy, Clone, PartialEq, Eq, Debug, Default)]
pub enum LogFormat {
    /// For people.
    #[default]
    Human,
    /// One JSON object a line.
    Json,
}

/// What becomes of plug-ins that fail.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct Supervision {
    /// Time until the first restart.
    pub first_delay: Duration,
    /// It doubles up to this.
    pub longest_delay: Duration,
    /// So many faults …
    pub faults: u32,
    /// … within this time lead into quarantine.
    pub within: Duration,
}

pub(super) fn gateway(
    written: &written::Gateway,
    folder: &Path,
    problems: &mut ConfigFindings<'_>,
) -> GatewayConfig {
    let path = |text: &Option<Text>, default: PathBuf| {
        text.as_ref().map_or(default, |text| folder.join(text.get_ref()))
    };
    let state = path(&written.state, folder.join("state"));
    let programs = match &written.programs {
        None => vec![folder.join("programs")],
        Some(folders) => folders.iter().map(|text| folder.join(text.get_ref())).collect(),
    };
    if let Some(threads) = &written.threads
        && *threads.get_ref() == 0
    {
        problems.add(threads.span(), "threads is 0", "give at least 1, or leave it out");
    }
    let links_per_thread = written.links_per_thread.as_ref().map_or(256, |links| {
        if *links.get_ref() == 0 {
            problems.add(links.span(), "links-per-thread is 0", "256 suits most");
        }
        usize::from(*links.get_ref())
    });
    if let Some(priority) = &written.real_time_priority
        && !(1..=99).contains(priority.get_ref())
    {
        let hint = "give 1 to 99, of which 1 does, or leave it out";
        problems.add(priority.span(), "there is no such real-time priority", hint);
    }
    let journal = written.journal.as_ref().map_or(100_000, |entries| {
        if !(100..=100_000_000).contains(entries.get_ref()) {
            let range = "give a number of entries from 100 to 100000000";
            problems.add(entries.span(), "the journal cannot be so large or small", range);
        }
        *entries.get_ref()
    });
    let free_space = written
        .free_space
        .as_ref()
        .map_or(FREE_SPACE, |value| bytes(value, 0, 1 << 50, problems).unwrap_or_default());
    GatewayConfig {
        library: path(&written.library, state.join("plugins")),
        programs,
        receptions: path(&written.receptions, state.join("receptions")),
        traces: path(&written.traces, state.join("traces")),
        state,
        threads: written.threads.as_ref().map(|threads| usize::from(*threads.get_ref())),
        links_per_thread,
        real_time_priority: written.real_time_priority.as_ref().map(|value| *value.get_ref()),
        log: choice(
            written.log.as_ref(),
            &[("human", LogFormat::Human), ("json", LogFormat::Json)],
            problems,
        ),
        stop: choice(
            written.stop.as_ref(),
            &[("park", StopHow::Park), ("finish", StopHow::Finish)],
            problems,
        ),
        stop_patience: span(written.stop_patience.as_ref(), 30_000, problems),
        watch: written.watch.unwrap_or(true),
        journal,
        free_space,
    }
}

pub(super) fn supervision(
    written: &written::Supervision,
    problems: &mut ConfigFindings<'_>,
) -> Supervision {
    let first_delay = span(written.first_delay.as_ref(), 100, problems);
    let longest_delay = span(written.longest_delay.as_ref(), 30_000, problems);
    if let Some(text) = &written.longest_delay
        && longest_delay < first_delay
    {
        problems.add(text.span(), "longest-delay is under first-delay", "make it larger");
    }
    let faults = written.faults.as_ref().map_or(5, |faults| {
        if *faults.get_ref() == 0 {
            problems.add(faults.span(), "faults is 0", "1 puts a link into quarantine at once");
        }
        *faults.get_ref()
    });
    let within = span(written.within.as_ref(), 600_000, problems);
    Supervision { first_delay, longest_delay, faults, within }
}

pub(super) fn address(text: &Text, problems: &mut ConfigFindings<'_>) -> Option<SocketAddr> {
    let parsed = text.get_ref().parse().ok();
    if parsed.is_none() {
        problems.add(
            text.span(),
            format_args!("\"{}\" is not an address and a port", text.get_ref().escape_debug()),
            "write it as 127.0.0.1:8117 or [::1]:8117; a host's name does not do",
        );
    }
    parsed
}

pub(super) fn choice<T: Copy + Default>(
    text: Option<&Text>,
    choices: &[(&str, T)],
    problems: &mut ConfigFindings<'_>,
) -> T {
    let Some(text) = text else { return T::default() };
    if let Some((_, value)) = choices.iter().find(|(name, _)| name == text.get_ref()) {
        return *value;
    }
    let given = text.get_ref();
    problems.add(
        text.span(),
        format_args!("\"{}\" is not known here", given.escape_debug()),
        super::of_names("known here", given, choices.iter().map(|(name, _)| *name)),
    );
    T::default()
}

pub(super) fn span(
    text: Option<&Text>,
    default_millis: u64,
    problems: &mut ConfigFindings<'_>,
) -> Duration {
    optional_span(text, problems).unwrap_or(Duration::from_millis(default_millis))
}

pub(super) fn optional_span(
    text: Option<&Text>,
    problems: &mut ConfigFindings<'_>,
) -> Option<Duration> {
    let text = text?;
    match quantity::span(text.get_ref()) {
        Ok(span) => Some(span),
        Err(hint) => {
            let given = text.get_ref().escape_debug();
            problems.add(text.span(), format_args!("\"{given}\" is not a span of time"), hint);
            None
        }
    }
}

/// A number of bytes: a number, or a text with a unit.
pub(super) fn bytes(
    value: &Spanned<Value>,
    least: u64,
    most: u64,
    problems: &mut ConfigFindings<'_>,
) -> Option<u64> {
    let parsed = match value.get_ref() {
        Value::Integer(number) => u64::try_from(*number).map_err(|_| "it is negative"),
        Value::String(text) => quantity::bytes(text),
        _ => Err("write a number of bytes: 512, \"16KiB\" or \"64MiB\""),
    };
    match parsed {
        Ok(bytes) if (least..=most).contains(&bytes) => Some(bytes),
        Ok(bytes) => {
            let hint = format!("give {least} to {most} bytes");
            problems.add(value.span(), format_args!("{bytes} bytes do not do here"), hint);
            None
        }
        Err(hint) => {
            problems.add(value.span(), "this is not a number of bytes", hint);
            None
        }
    }
}
