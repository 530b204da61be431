//! `softplug trace case`: a case from a record.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;
use softplug_trace::{Assignment as Setting, Trace, limits};

use crate::assignment::Assignment;
use crate::commands::replay::judge_of;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::{self, Partial};
use crate::plugin::Library;
use crate::recorded::{Requests, make, of_flight};
use crate::screen::Screen;

/// Makes a case of a record: asks the plug-in for what was asked on the line, and takes over what
/// it does where it sends the bytes that were recorded.
///
/// Where it sends others, the record's lines stay, the file says where the two part, and the exit
/// code is 1. The partner's bytes and times stay as they were recorded; characters at the line's
/// rate become one line.
///
/// A gateway's flight recording holds settings and requests itself, and nothing of what was sent:
/// the case then has what the plug-in does now.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug trace case session.spt --plugin xon-xoff --set quiet_time=1000 --out lathe.spt
  softplug trace case session.spt --plugin r3964 --set nak_at_start=off --send telegram.bin \\
      --id r3964.tx.press-line --out r3964.tx.press-line.spt
  softplug trace case session.spt --plugin r3964 --set layer=rk512 \\
      --ask \"job 1 read area=DB block=5 offset=10 count=7\" --out case.spt")]
pub(super) struct Arguments {
    /// The record, as `softplug record` and `softplug trace import` write it, or a gateway's
    /// flight recording
    #[arg(value_name = "RECORD")]
    record: PathBuf,
    /// The plug-in that stood on the recorded side: a .wasm file, a name, or native:NAME
    #[arg(long, short = 'x', value_name = "PLUGIN")]
    plugin: String,
    #[command(flatten)]
    library: Library,
    /// A setting that it had, in addition to those of the record; preset=NAME takes a preset; may
    /// be repeated
    #[arg(long = "set", short = 's', value_name = "NAME=VALUE")]
    settings: Vec<Assignment>,
    #[command(flatten)]
    requests: Requests,
    /// The case's id [default: the record's]
    #[arg(long, value_name = "ID")]
    id: Option<String>,
    /// The case to write
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Overwrite FILE
    #[arg(long, short)]
    force: bool,
}

#[derive(Serialize)]
struct Document {
    file: String,
    case: bool,
    standing: String,
}

pub(super) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    Partial::check(&arguments.out, arguments.force)?;
    let name = arguments.record.display().to_string();
    let text = files::read_text(&arguments.record)?;
    let mut record = Trace::parse(&text).map_err(|error| {
        if !screen.is_json() {
            screen.report(error.report(&name));
        }
        Failure::usage(format_args!("{name} is no trace: {error}"))
    })?;
    let plugin = arguments.library.load(&arguments.plugin)?;
    plugin.settings(&arguments.settings)?;
    for Assignment { name, value } in &arguments.settings {
        record.front.config.retain(|setting| setting.name != *name);
        record.front.config.push(Setting { name: name.clone(), value: value.clone() });
    }
    if let Some(id) = &arguments.id {
        record.front.id.clone_from(id);
    }
    let requests = arguments.requests.of(&arguments.out)?;
    let judge = judge_of(&plugin);
    let (case, became) = if record.is_recording() {
        if !requests.is_empty() || !arguments.settings.is_empty() {
            return Err(Failure::usage(format_args!(
                "{name} is a flight recording: it holds settings and requests itself"
            )));
        }
        of_flight(judge.as_ref(), &arguments.record, record)
            .map_err(|reason| Failure::usage(format_args!("{name} makes no case: {reason}")))?
    } else {
        make(judge.as_ref(), &arguments.out, record, &requests)
    };
    let text = case.format();
    // The id, and whatever has become longer.
    Trace::parse(&text).map_err(|error| Failure::usage(error.kind))?;
    debug_assert!(text.len() <= limits::FILE_BYTES, "it was read");
    let partial = Partial::create(&arguments.out, arguments.force)?;
    let file = partial.write(text.as_bytes())?.display().to_string();
    screen.say(&file);
    let standing = became.sentence;
    if became.is_case {
        screen.note(format_args!("a case: {standing}"));
    } else {
        screen.error(format_args!("no case of {}: {standing}", judge.manifest().name));
        screen.report("settings are given with --set, what was asked for with --send or --ask");
    }
    screen.document(&Document { file, case: became.is_case, standing });
    Ok(if became.is_case { Exit::Done } else { Exit::Failed })
}
