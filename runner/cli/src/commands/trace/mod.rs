//! `softplug trace`: what works on trace files.

mod case;
mod diff;
mod export;
mod fmt;
mod import;
mod new;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, Subcommand};
use serde::Serialize;
use softplug_trace::exchange::{Format, Note};

use crate::exit::Exit;
use crate::failure::Failure;
use crate::screen::Screen;

/// Works on trace files.
#[derive(Debug, Args)]
pub(crate) struct Arguments {
    #[command(subcommand)]
    verb: Verb,
}

#[derive(Debug, Subcommand)]
enum Verb {
    New(new::Arguments),
    Fmt(fmt::Arguments),
    Case(case::Arguments),
    Import(import::Arguments),
    Export(export::Arguments),
    Diff(diff::Arguments),
}

pub(crate) fn run(arguments: Arguments, screen: &Screen) -> Result<Exit, Failure> {
    match arguments.verb {
        Verb::New(arguments) => new::run(&arguments, screen),
        Verb::Fmt(arguments) => fmt::run(&arguments, screen),
        Verb::Case(arguments) => case::run(&arguments, screen),
        Verb::Import(arguments) => import::run(&arguments, screen),
        Verb::Export(arguments) => export::run(&arguments, screen),
        Verb::Diff(arguments) => diff::run(&arguments, screen),
    }
}

/// A format of another tool, by its name.
fn format_of() -> impl TypedValueParser<Value = Format> {
    let format = |name: String| {
        let mut formats = Format::ALL.iter().copied();
        formats.find(|format| format.name() == name).expect("the parser knows these names alone")
    };
    PossibleValuesParser::new(Format::ALL.iter().map(|format| format.name())).map(format)
}

/// A note for machines.
#[derive(Serialize)]
struct JsonNote {
    what: &'static str,
    count: usize,
    /// A line of the trace or the text, a packet of the capture.
    #[serde(skip_serializing_if = "Option::is_none")]
    first: Option<u32>,
    text: String,
}

/// Tells people what was left out, and gives it for machines.
fn tell(notes: &[Note], screen: &Screen) -> Vec<JsonNote> {
    let tell = |note: &Note| {
        let text = note.to_string();
        screen.note(format_args!("note: {text}"));
        let first = Some(note.first).filter(|first| *first > 0);
        JsonNote { what: note.what.name(), count: note.count, first, text }
    };
    notes.iter().map(tell).collect()
}
