//! `softplug plan --cell`: the programs of a cell, without machines.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::Path;
use std::time::Duration;

use serde::Serialize;
use softplug_cell::{
    ChannelId, Course, Doing, Machine, Outcome, Program, Rehearsal, Setup, draw, rehearse,
};
use softplug_live::plain_text;
use softplug_service::config::{CellConfig, Config, LinkConfig};
use softplug_service::programs::Programs;

use super::CellArguments;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::numbers::span;
use crate::screen::{BAD, GOOD, Screen};
use crate::table::Table;

/// The longest program that is read.
const MOST_PROGRAM: u64 = 256 << 20;
/// What a line carries if nothing is said of it, in bit/s.
const BAUD: u32 = 9_600;

/// A rehearsal, for machines.
#[derive(Serialize)]
struct Document {
    /// Whether all programs come to their end.
    ends: bool,
    seconds: f64,
    channels: Vec<ChannelTimes>,
    stuck: Vec<String>,
    missing: Vec<String>,
}

#[derive(Serialize)]
struct ChannelTimes {
    channel: String,
    runs_seconds: f64,
    waits_seconds: f64,
    waits: Vec<Wait>,
}

#[derive(Serialize)]
struct Wait {
    from_seconds: f64,
    to_seconds: f64,
    text: String,
}

pub(crate) fn plan_cell(
    file: &Path,
    name: &str,
    arguments: &CellArguments,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let config = Config::read(file).map_err(Failure::usage)?;
    let cell = config.cells.iter().find(|cell| cell.name == name).ok_or_else(|| {
        let known = config.cells.iter().map(|cell| cell.name.as_str());
        let hint = softplug_live::guess::of_names("cells there", name, known);
        let file = plain_text(&file.display().to_string());
        Failure::usage(format_args!("{file} has no cell \"{}\"; {hint}", name.escape_debug()))
    })?;
    let begin = arguments.programs.iter().map(|given| {
        let channel = channel(&cell.setup, &given.name)?;
        if given.value.is_empty() {
            let name = cell.setup.channel_name(channel);
            let what = format!("--program {name}= names no file; write --program {name}=FILE");
            return Err(Failure::usage(what));
        }
        let path = Path::new(&given.value);
        Ok((channel, course(&config, cell, channel, path, arguments.rapid)?))
    });
    let begin = begin.collect::<Result<Vec<_>, Failure>>()?;
    for (at, (channel, _)) in begin.iter().enumerate() {
        if begin[..at].iter().any(|(other, _)| other == channel) {
            let name = cell.setup.channel_name(*channel);
            return Err(Failure::usage(format_args!("{name} is given two programs; give it one")));
        }
    }
    // What is not there is not made: nothing is done but planned.
    let folders = config.gateway.programs.iter().filter(|folder| folder.is_dir()).cloned();
    let shelves = Programs::open(&folders.collect::<Vec<_>>()).map_err(Failure::usage)?;
    let mut wrong = None;
    let mut read: BTreeMap<(ChannelId, String), Option<Course>> = BTreeMap::new();
    let mut load = |channel: ChannelId, program: &str| {
        let link = link(&config, &cell.setup, channel)?;
        let name = shelves.search(&link.search, program).ok().flatten()?;
        let path = config.gateway.programs.iter().map(|folder| folder.join(name.as_str()));
        let path = path.into_iter().find(|path| path.is_file())?;
        match course(&config, cell, channel, &path, arguments.rapid) {
            Ok(course) => Some(course),
            Err(failure) => {
                wrong.get_or_insert(failure);
                None
            }
        }
    };
    let found = rehearse(cell.setup.clone(), begin, |channel, program| {
        let known = read.entry((channel, program.to_owned()));
        known.or_insert_with(|| load(channel, program)).clone()
    });
    if let Some(failure) = wrong {
        return Err(failure);
    }
    if let Some(file) = &arguments.chart {
        files::write_picture(file, &draw(&cell.setup, &found.chart, found.at), "--chart")?;
    }
    let document = document(&cell.setup, &found);
    tell(&document, &found, screen);
    screen.document(&document);
    Ok(if document.ends { Exit::Done } else { Exit::Failed })
}

fn channel(setup: &Setup, name: &str) -> Result<ChannelId, Failure> {
    setup.channel(name).ok_or_else(|| {
        let known = setup.channels().map(|channel| setup.channel_name(channel));
        let hint = softplug_live::guess::of_names("channels of the cell", name, known);
        Failure::usage(format_args!("\"{}\" is no channel; {hint}", name.escape_debug()))
    })
}

fn link<'a>(config: &'a Config, setup: &Setup, channel: ChannelId) -> Option<&'a LinkConfig> {
    config.links.iter().find(|link| link.name == setup.channel_name(channel))
}

fn course(
    config: &Config,
    cell: &CellConfig,
    channel: ChannelId,
    path: &Path,
    rapid: f64,
) -> Result<Course, Failure> {
    let shown = plain_text(&path.display().to_string());
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(MOST_PROGRAM + 1).read_to_end(&mut bytes))
        .map_err(|error| Failure::usage(format_args!("{shown} cannot be read: {error}")))?;
    if bytes.len() as u64 > MOST_PROGRAM {
        let most = MOST_PROGRAM >> 20;
        return Err(Failure::usage(format_args!("{shown} is larger than {most} MiB")));
    }
    let program = Program::read(&bytes, channel, &cell.setup, cell.notation(channel))
        .map_err(|error| Failure::usage(format_args!("{shown}: {error}")))?;
    let line = link(config, &cell.setup, channel).map(|link| link.line);
    let (baud, half_bits) = match line {
        Some(line) if line.baud > 0 => (line.baud, line.half_bits()),
        _ => (BAUD, 20),
    };
    let bytes_per_second = f64::from(baud) * 2.0 / f64::from(half_bits);
    let name = path.file_name().map_or(shown, |name| plain_text(&name.to_string_lossy()));
    Ok(Course::new(&name, &program.sent, &program.stops, Machine { bytes_per_second, rapid }))
}

fn document(setup: &Setup, found: &Rehearsal) -> Document {
    let seconds = |millis: u64| millis as f64 / 1_000.0;
    let channels = setup.channels().map(|channel| {
        let mut of = ChannelTimes {
            channel: setup.channel_name(channel).to_owned(),
            runs_seconds: 0.0,
            waits_seconds: 0.0,
            waits: Vec::new(),
        };
        for span in found.chart.spans(channel) {
            let to = span.to.unwrap_or(found.at);
            match &span.doing {
                Doing::Runs(_) => of.runs_seconds += seconds(to - span.from),
                Doing::Idle => {}
                Doing::Waits(text) | Doing::Stands(text) => {
                    of.waits_seconds += seconds(to - span.from);
                    let (from_seconds, to_seconds) = (seconds(span.from), seconds(to));
                    of.waits.push(Wait { from_seconds, to_seconds, text: text.clone() });
                }
            }
        }
        of
    });
    Document {
        ends: found.outcome == Outcome::Ended && found.missing.is_empty(),
        seconds: seconds(found.at),
        channels: channels.collect(),
        stuck: found.cell.stuck().into_iter().map(|stuck| stuck.text).collect(),
        missing: found.missing.clone(),
    }
}

fn tell(document: &Document, found: &Rehearsal, screen: &Screen) {
    let time = |seconds: f64| span(Duration::from_secs_f64(seconds));
    let after = time(document.seconds);
    screen.say(match found.outcome {
        Outcome::Ended => format!("{GOOD}all programs end{GOOD:#} after {after}"),
        Outcome::Stuck => format!("{BAD}stuck{BAD:#} after {after}"),
        Outcome::Endless => format!("{BAD}programs start each other without an end{BAD:#}"),
    });
    for text in &document.stuck {
        screen.say(format_args!("  {}", plain_text(text)));
    }
    for name in &document.missing {
        screen.say(format_args!("  there is no program \"{}\" to load", name.escape_debug()));
    }
    let mut table = Table::new(["channel", "runs", "waits", "from", "to", "what for"]);
    for channel in &document.channels {
        let (runs, waits) = (time(channel.runs_seconds), time(channel.waits_seconds));
        let mut head = [channel.channel.clone(), runs, waits];
        for wait in &channel.waits {
            let [name, runs, waits] = std::mem::take(&mut head);
            let text = plain_text(&wait.text);
            table.row([name, runs, waits, time(wait.from_seconds), time(wait.to_seconds), text]);
        }
        let [name, runs, waits] = head;
        if channel.waits.is_empty() {
            table.row([name, runs, waits, String::new(), String::new(), String::new()]);
        }
    }
    screen.say(table);
}
