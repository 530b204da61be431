//! `softplug trace export`: a trace for another tool.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use softplug_conformance::Case;
use softplug_trace::Trace;
use softplug_trace::exchange::{self, Format};

use super::{JsonNote, format_of, tell};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::{self, Partial};
use crate::screen::Screen;

/// Writes what happens on the line of a trace as a file for another tool.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug trace export case.spt --format pcapng --out case.pcapng
  softplug trace export case.spt --format hexdump --out case.txt
  text2pcap -D -t %s.%f -l 147 case.txt case.pcapng

What the format cannot hold is told; with --json it stands in the document. Times count from the
start of the case, which captures show as the start of 1970. `file:` items are looked for in the
folder `files` beside the trace or one above.")]
pub(super) struct Arguments {
    /// The trace
    #[arg(value_name = "CASE.spt")]
    trace: PathBuf,
    /// The format
    #[arg(long, value_parser = format_of(), value_name = "FORMAT")]
    format: Format,
    /// The file to write
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    /// Overwrite the file
    #[arg(long)]
    force: bool,
}

#[derive(Serialize)]
struct Document {
    file: String,
    format: &'static str,
    bytes: usize,
    notes: Vec<JsonNote>,
}

pub(super) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let name = arguments.trace.display();
    let text = files::read_text(&arguments.trace)?;
    let trace = Trace::parse(&text).map_err(|fault| {
        Failure::usage(format_args!("{name}:{}:{}: {}", fault.line, fault.column, fault.kind))
    })?;
    let case = Case::new(&arguments.trace, trace);
    let exported = exchange::export(&case.trace, arguments.format, &case.files())
        .map_err(|error| Failure::usage(format_args!("{name}: {error}")))?;
    let partial = Partial::create(&arguments.out, arguments.force)?;
    let file = partial.write(&exported.bytes)?.display().to_string();
    let bytes = exported.bytes.len();
    let notes = tell(&exported.notes, screen);
    screen.say(format_args!("{file}: {bytes} bytes"));
    screen.document(&Document { file, format: arguments.format.name(), bytes, notes });
    Ok(Exit::Done)
}
