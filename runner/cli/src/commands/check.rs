//! `softplug check`: what a program cannot say on a line, before anything is sent.

use std::io::Cursor;
use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use softplug_abi::manifest::Manifest;
use softplug_live::pacer::default_depth;
use softplug_live::port::line_text;
use softplug_trial::{Altered, Budget, Setup, Trial};

use super::send::{fields, job_kind};
use crate::assignment::{Assignment, field};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::Program;
use crate::line::LinkArguments;
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
    let texts: Vec<_> = arguments.fields.iter().map(Assignment::as_pair).collect();
    let setup = Setup {
        depth: arguments.link.depth.unwrap_or_else(|| default_depth(line.baud)),
        job_kind: kind,
        records: &records,
        fields: &texts,
        ..Setup::new(manifest, &settings, line)
    };
    let trial = Trial::new(setup, || plugin.new_instance(), Budget::endless());
    let name = &program.name;
    let checked = trial.check(&mut Cursor::new(&text), text.len() as u64);
    let checked = checked.map_err(|error| Failure::trial(error, name))?;
    let rows: Vec<_> = checked.altered.iter().filter_map(|one| row(one, manifest)).collect();
    let message = checked.refused.map(|refused| refused.message(manifest, name));
    screen.document(&Document {
        result: checked.result().name(),
        plugin: &manifest.name,
        line: line_text(&line),
        bytes: text.len() as u64,
        characters: &rows,
        message: message.as_deref(),
    });
    let on = format!("with {} on {}", manifest.name, line_text(&line));
    let all = numbers::things(checked.characters, "character");
    if rows.is_empty() && message.is_none() {
        screen.say(format_args!("{name} passes as it is written {on}: {all} of its own"));
    } else if !rows.is_empty() {
        let count = rows.len();
        screen.say(format_args!("{name}: {count} of {all} do not pass as they are written {on}"));
        screen.say(table(&rows));
    }
    let machine = arguments.link.machine.find()?;
    if let Some(remark) = machine.and_then(|machine| machine.remark_on_name(&text)) {
        screen.note(format_args!("{name} {remark}"));
    }
    if let Some(message) = &message {
        screen.error(message);
    }
    let is_bad = message.is_some() || arguments.strict && !rows.is_empty();
    Ok(if is_bad { Exit::Failed } else { Exit::Done })
}

/// As it is shown.
fn row(altered: &Altered, manifest: &Manifest) -> Option<Row> {
    let Altered { found, fate } = altered;
    Some(Row {
        character: found.written.shown(),
        bytes: found.written.hex(),
        count: found.count,
        line: found.line,
        column: found.column,
        fate: fate.name()?,
        what: fate.what(manifest),
        instead: found.written.instead(),
    })
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
