//! `softplug trace diff`: in what two traces differ.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use softplug_conformance::Case;
use softplug_trace::{Difference, Trace, diff};

use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::numbers;
use crate::screen::Screen;

/// Tells in what two traces differ: events, bytes and times.
///
/// What is said in comments, and how bytes are spread over lines, makes no difference; of the front
/// matter only what changes the run does. The exit code is 0 if there is none and 1 if there is any.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug trace diff before.spt after.spt
  softplug trace diff recorded.spt written.spt --tolerance 2000 --json

`-` stands before what only the first has, `+` before what only the second has, `~` before what
both have at another time.")]
pub(super) struct Arguments {
    /// The first trace
    first: PathBuf,
    /// The second one
    second: PathBuf,
    /// Times that are no more than so many µs apart are the same
    #[arg(long, value_name = "MICROSECONDS", default_value_t = 0)]
    tolerance: u64,
}

#[derive(Serialize)]
struct Document {
    same: bool,
    differences: Vec<JsonDifference>,
}

#[derive(Serialize)]
struct JsonDifference {
    /// `front`, `first`, `second` or `time`.
    kind: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    at_us: Option<u64>,
    /// As a line of the first trace.
    #[serde(skip_serializing_if = "Option::is_none")]
    first: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    first_line: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    second: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    second_line: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    later_us: Option<i64>,
}

pub(super) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let (first, second) = (read(&arguments.first, screen)?, read(&arguments.second, screen)?);
    let found =
        diff((&first.trace, &first.files()), (&second.trace, &second.files()), arguments.tolerance);
    let found = found.map_err(Failure::usage)?;
    for difference in &found {
        screen.say(difference);
    }
    let differences: Vec<_> = found.iter().map(JsonDifference::of).collect();
    screen.document(&Document { same: found.is_empty(), differences });
    if found.is_empty() {
        screen.say("no difference");
        return Ok(Exit::Done);
    }
    screen.say(numbers::things(found.len() as u64, "difference"));
    Ok(Exit::Failed)
}

fn read(path: &Path, screen: &Screen) -> Result<Case, Failure> {
    let text = files::read_text(path)?;
    let trace = Trace::parse(&text).map_err(|error| {
        let file = path.display().to_string();
        if screen.is_json() {
            return Failure::usage(format_args!("{file}: {error}"));
        }
        screen.report(error.report(&file));
        Failure::usage("a trace cannot be read; nothing was compared")
    })?;
    Ok(Case::new(path, trace))
}

impl JsonDifference {
    fn of(difference: &Difference) -> Self {
        let (first_line, second_line) = difference.lines();
        let (kind, first, second, later_us) = match difference {
            Difference::Front { key, first, second } => {
                ("front", Some(format!("{key}: {first}")), Some(format!("{key}: {second}")), None)
            }
            Difference::First(entry) => ("first", Some(entry.to_string()), None, None),
            Difference::Second(entry) => ("second", None, Some(entry.to_string()), None),
            Difference::Time { first, second, later } => {
                ("time", Some(first.to_string()), Some(second.to_string()), Some(*later))
            }
        };
        let at_us = difference.at().map(|at| at.0);
        Self { kind, at_us, first, first_line, second, second_line, later_us }
    }
}
