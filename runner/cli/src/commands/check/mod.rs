//! `softplug check`: what a program cannot say on a line, before anything is sent.

mod characters;
mod fate;

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use softplug_abi::manifest::Manifest;
use softplug_catalogue::{Machine, Notation};
use softplug_gateway::pacer::default_depth;
use softplug_gateway::port::line_text;

use self::characters::{Found, characters};
use self::fate::{Fate, Probe};
use super::send::{check_message, fields, job_kind, reason};
use super::trial::{End, Trial, WAITS};
use crate::dump::hex;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::Program;
use crate::line::{Assignment, LinkArguments, field};
use crate::numbers;
use crate::screen::Screen;
use crate::table::Table;

/// Tells what would not arrive of a program as it is written; nothing is sent.
///
/// Each character of the program is tried through the plug-in: whether it passes, is left out, is
/// replaced, or makes the plug-in refuse the program; then the program as a whole. Of each that does
/// not pass: how often it is there, where first, and what to write in its place.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug check O0001.nc --machine haas-vf
  softplug check O0001.nc --plugin fanuc-rs232 --set code=eia
  softplug check O0001.nc --machine fanuc-0m --strict --json")]
pub(crate) struct Arguments {
    /// The program; - is standard input
    #[arg(value_name = "FILE")]
    file: PathBuf,
    #[command(flatten)]
    link: LinkArguments,
    /// A field of the job; may be repeated
    #[arg(long = "field", value_name = "NAME=VALUE", value_parser = field)]
    fields: Vec<Assignment>,
    /// End with 1 also if something is left out or replaced
    #[arg(long)]
    strict: bool,
}

/// What machines get.
#[derive(Serialize)]
struct Document<'a> {
    /// `passes`, `altered` or `refused`.
    result: &'static str,
    plugin: &'a str,
    line: String,
    bytes: u64,
    /// Those that do not pass as they are written.
    characters: &'a [Row],
    /// Why the program is refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<&'a str>,
}

/// A character that does not pass as it is written.
#[derive(Serialize)]
struct Row {
    character: String,
    bytes: String,
    count: u64,
    line: u64,
    column: u64,
    /// `dropped`, `replaced`, `foreign`, `cut` or `refused`.
    fate: &'static str,
    /// The fate, for people.
    what: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    instead: Option<&'static str>,
}

pub(crate) fn run(mut arguments: Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let mut program = Program::open(&arguments.file)?;
    let text = program.read()?;
    let (plugin, settings) = arguments.link.load()?;
    let manifest = plugin.manifest();
    let line = arguments.link.line(manifest, &settings).line;
    let kind = job_kind(manifest)?;
    let records = fields(&manifest.jobs[usize::from(kind)], &arguments.fields)?;
    let trial = Trial {
        plugin: &plugin,
        settings: &settings,
        line,
        depth: arguments.link.depth.unwrap_or_else(|| default_depth(line.baud)),
        job_kind: kind,
        fields: &records,
        asked_fields: &arguments.fields,
        check: manifest.needs.check_pass,
    };
    let name = program.name.clone();
    let message = match trial.run(program)?.end {
        Some(End::Done) => None,
        Some(End::Failed(why, status)) => {
            Some(format!("{name} cannot be sent: {}", reason(manifest, why, status)))
        }
        Some(End::CheckFailed(why, status, row, column)) => {
            Some(check_message(manifest, &name, why, status, row, column))
        }
        None => {
            return Err(Failure::new(Exit::Incomplete, WAITS));
        }
    };
    let found = characters(&text);
    let mut rows = Vec::new();
    if let Some(probe) = Probe::new(&trial)? {
        for found in &found {
            let fate = probe.fate(found.written)?;
            // What is refused in a small program and sent in this one stands in another place.
            let is_sent = message.is_none() && matches!(fate, Fate::Refused(..));
            rows.extend((!is_sent).then(|| row(found, &fate, manifest)).flatten());
        }
    }
    let result = match (&message, rows.is_empty()) {
        (Some(_), _) => "refused",
        (None, true) => "passes",
        (None, false) => "altered",
    };
    screen.document(&Document {
        result,
        plugin: &manifest.name,
        line: line_text(&line),
        bytes: text.len() as u64,
        characters: &rows,
        message: message.as_deref(),
    });
    let on = format!("with {} on {}", manifest.name, line_text(&line));
    let all = numbers::things(found.len() as u64, "character");
    if rows.is_empty() && message.is_none() {
        screen.say(format_args!("{name} passes as it is written {on}: {all} of its own"));
    } else if !rows.is_empty() {
        let count = rows.len();
        screen.say(format_args!("{name}: {count} of {all} do not pass as they are written {on}"));
        screen.say(table(&rows));
    }
    if let Some(text) = arguments.link.machine.find()?.and_then(|machine| unnamed(&machine, &text))
    {
        screen.note(format_args!("{name} {text}"));
    }
    if let Some(message) = &message {
        screen.error(message);
    }
    let is_bad = message.is_some() || arguments.strict && !rows.is_empty();
    Ok(if is_bad { Exit::Failed } else { Exit::Done })
}

/// What is to be known of how the program says its name to this machine; None if all is well.
fn unnamed(machine: &Machine, text: &[u8]) -> Option<String> {
    let names = machine.names.as_ref()?;
    let forms = || std::iter::once(&names.form).chain(&names.also);
    // What does not stand in the text cannot be missed there.
    if names.form.starts_with('{') {
        return None;
    }
    let own = forms().filter_map(|form| form.parse::<Notation>().ok());
    let Some(said) = own.into_iter().find_map(|notation| notation.read(text)) else {
        return Some(format!("does not say its name as {} wants it: {}", machine.name, names.form));
    };
    let count = said.chars().filter(char::is_ascii_digit).count();
    let digits = usize::from(names.digits.filter(|_| names.form.contains("{number}"))?);
    let is_long = count > digits;
    is_long
        .then(|| format!("is called {said}, and a number has {digits} digits on {}", machine.name))
}

/// A character that does not pass; None if it does.
fn row(found: &Found, fate: &Fate, manifest: &Manifest) -> Option<Row> {
    let (fate, what) = match fate {
        Fate::Passes => return None,
        Fate::Dropped => ("dropped", "left out".to_owned()),
        Fate::Replaced(text) if text == " " => ("replaced", "sent as a space".to_owned()),
        Fate::Replaced(text) if text.trim().is_empty() => {
            ("replaced", format!("sent as {} spaces", text.len()))
        }
        Fate::Replaced(text) => ("replaced", format!("sent as {text}")),
        Fate::Foreign(bytes) => {
            ("foreign", format!("sent as {}, which few controls know", hex(bytes)))
        }
        Fate::Cut => ("cut", "a character of this line has 7 bits: arrives as another".to_owned()),
        Fate::Refused(None) => ("refused", WAITS.to_owned()),
        Fate::Refused(Some((why, status))) => ("refused", reason(manifest, *why, *status)),
    };
    let Found { written, count, line, column } = *found;
    let (character, bytes) = (written.shown(), hex(&written.bytes()));
    Some(Row { character, bytes, count, line, column, fate, what, instead: written.instead() })
}

fn table(rows: &[Row]) -> Table {
    let mut table = Table::new(["CHARACTER", "COUNT", "FIRST AT", "WHAT HAPPENS", "INSTEAD"]);
    for row in rows {
        table.row([
            row.character.clone(),
            row.count.to_string(),
            format!("{}:{}", row.line, row.column),
            row.what.clone(),
            row.instead.unwrap_or_default().to_owned(),
        ]);
    }
    table
}
