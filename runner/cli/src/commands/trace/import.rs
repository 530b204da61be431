//! `softplug trace import`: a trace from the file of another tool.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use clap::Args;
use serde::Serialize;
use softplug_trace::exchange::{self, Format, Import, Source};
use softplug_trace::{FrontMatter, limits};

use super::{JsonNote, format_of, tell};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::{self, Partial};
use crate::screen::Screen;

/// Makes a trace of what another tool has recorded.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug trace import lathe.pcapng --format pcapng --id xon-xoff.rx.lathe \\
      --line \"4800 7E2\" --out xon-xoff.rx.lathe.spt
  softplug trace import table.csv --format saleae --received CNC --sent PC \\
      --id r3964.rx.mill --line \"9600 8E1\" --device \"Mill 7\" --out r3964.rx.mill.spt
  softplug trace import rx.csv tx.csv --format saleae \\
      --id r3964.rx.mill --line \"9600 8E1\" --out r3964.rx.mill.spt

Bytes become `<` and `>` lines, modem lines and line errors `!` lines. What a trace cannot hold is
told; with --json it stands in the document. Nothing is expected of a plug-in but these bytes at
these times: add requests and actions by hand, or let `softplug replay --bless` write them.")]
pub(super) struct Arguments {
    /// The file; for tables of Saleae's first Logic two: received, then sent
    #[arg(required = true, num_args = 1..=2, value_name = "FILE")]
    sources: Vec<PathBuf>,
    /// The format
    #[arg(long, value_parser = format_of(), value_name = "FORMAT")]
    format: Format,
    /// The file to write
    #[arg(long, value_name = "CASE.spt")]
    out: PathBuf,
    /// The id of the case
    #[arg(long)]
    id: String,
    /// The line, as in a trace: "4800 7E2"; baud 0 where the rate is unknown
    #[arg(long)]
    line: String,
    /// The profile [default: the id up to its first dot]
    #[arg(long)]
    profile: Option<String>,
    /// A sentence for people [default: names of file and device]
    #[arg(long)]
    title: Option<String>,
    /// A clause that the case shows; may be repeated [default: PROFILE.unsorted]
    #[arg(long = "clause", value_name = "CLAUSE")]
    clauses: Vec<String>,
    /// How much the clauses bind: must, should or may
    #[arg(long, default_value = "may")]
    level: String,
    /// Settings of the plug-in, as in a trace: "code=iso eob=lf"
    #[arg(long, value_name = "SETTINGS")]
    config: Option<String>,
    /// The revision of the profile that brings the case
    #[arg(long, default_value_t = 1)]
    since: u32,
    /// The device on the other end
    #[arg(long, default_value = "unknown")]
    device: String,
    /// The day of the recording [default: of the capture, else of the file]
    #[arg(long, value_name = "YYYY-MM-DD")]
    date: Option<String>,
    /// What recorded it [default: the format]
    #[arg(long)]
    tool: Option<String>,
    /// Saleae: the analyser at the line that the plug-in receives from [default: rx]; candump: the
    /// identifier of the CAN frames that it receives [default: as R and T say]
    #[arg(long, value_name = "NAME")]
    received: Option<String>,
    /// Saleae: the analyser at the line that the plug-in sends on [default: tx]; candump: the
    /// identifier of the CAN frames that it sends [default: as R and T say]
    #[arg(long, value_name = "NAME")]
    sent: Option<String>,
    /// Count times from the first event, and not as the file has them
    #[arg(long)]
    from_first: bool,
    /// Overwrite the file
    #[arg(long)]
    force: bool,
}

#[derive(Serialize)]
struct Document {
    file: String,
    id: String,
    /// Lines of the trace that are events.
    events: usize,
    /// The time in the source, in µs, at which the trace begins.
    zero: i64,
    notes: Vec<JsonNote>,
}

pub(super) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    Partial::check(&arguments.out, arguments.force)?;
    let contents = arguments
        .sources
        .iter()
        .map(|path| Ok((path.display().to_string(), read(path)?)))
        .collect::<Result<Vec<_>, Failure>>()?;
    let sources: Vec<_> = contents.iter().map(|(name, bytes)| Source { name, bytes }).collect();
    // A day that the file may know better.
    let day = match &arguments.date {
        Some(date) => date.clone(),
        None => date_of(modified(&arguments.sources[0])?),
    };
    let import = Import {
        front: arguments.front(&day)?,
        from_first: arguments.from_first,
        received: arguments.received.clone(),
        sent: arguments.sent.clone(),
    };
    let mut imported =
        exchange::import(&sources, arguments.format, &import).map_err(Failure::usage)?;
    let zero = imported.zero.div_euclid(1_000_000);
    if arguments.date.is_none() && zero > limits::SECONDS as i64 {
        imported.trace.front.origin = arguments.front(&date_of(zero))?.origin;
    }

    let trace = imported.trace;
    let partial = Partial::create(&arguments.out, arguments.force)?;
    let file = partial.write(trace.format().as_bytes())?.display().to_string();
    let notes = tell(&imported.notes, screen);
    if arguments.clauses.is_empty() {
        let clause = &trace.front.clauses[0];
        screen
            .note(format_args!("note: no ledger has the clause {clause}: name one with --clause"));
    }
    if let Err(error) = trace.front.check_path(&arguments.out) {
        screen.note(format_args!("note: {error}"));
    }
    let events = trace.entries().count();
    screen.say(format_args!("{file}: {events} events"));
    let id = trace.front.id;
    screen.document(&Document { file, id, events, zero: imported.zero, notes });
    Ok(Exit::Done)
}

impl Arguments {
    /// The front matter that the options tell, recorded on `date`.
    fn front(&self, date: &str) -> Result<FrontMatter, Failure> {
        let profile = self
            .profile
            .clone()
            .unwrap_or_else(|| self.id.split('.').next().unwrap_or_default().to_owned());
        let clauses = match &self.clauses[..] {
            [] => format!("{profile}.unsorted"),
            clauses => clauses.join(" "),
        };
        let source = self.sources[0].file_name().unwrap_or_default().to_string_lossy();
        let title = self.title.clone().unwrap_or_else(|| {
            // A file's name may hold anything and be long.
            let plain = |c: char| if c.is_control() { '?' } else { c };
            let title = format!("{source}, recorded from {}", self.device);
            title.chars().map(plain).take(limits::TITLE_CHARACTERS).collect()
        });
        let tool = self.tool.as_deref().unwrap_or(self.format.name());
        let origin = format!("recorded({}, {date}, {tool})", self.device);
        let keys = [
            ("--id", "id", self.id.clone()),
            ("--title", "title", title),
            ("--profile", "profile", profile),
            ("--clause", "clauses", clauses),
            ("--level", "level", self.level.clone()),
            ("--line", "line", self.line.clone()),
            ("--since", "since", self.since.to_string()),
            ("--device, --date and --tool", "origin", origin),
            ("--config", "config", self.config.clone().unwrap_or_default()),
        ];
        let keys = keys.iter().filter(|(_, key, value)| *key != "config" || !value.is_empty());
        let mut text = String::new();
        for (option, key, value) in keys.clone() {
            // It would end the line.
            if value.contains(['\n', '\r']) {
                return Err(Failure::usage(format_args!("{option} takes a single line")));
            }
            text.extend([key, ": ", value, "\n"]);
        }
        FrontMatter::parse(&text).map_err(|fault| {
            let option =
                keys.clone().nth(fault.line as usize - 1).map_or("--id", |(option, ..)| option);
            Failure::usage(format_args!("{option}: {}", fault.kind))
        })
    }
}

/// All of a file, but not more than can be imported and one byte.
fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    let mut bytes = Vec::new();
    File::open(path)
        .and_then(|file| file.take(limits::IMPORT_BYTES as u64 + 1).read_to_end(&mut bytes))
        .map_err(|error| files::unreadable(path, &error))?;
    Ok(bytes)
}

/// When a file was last changed, in seconds since 1970.
fn modified(path: &Path) -> Result<i64, Failure> {
    let time = std::fs::metadata(path)
        .and_then(|metadata| metadata.modified())
        .map_err(|error| files::unreadable(path, &error))?;
    let since = |from: SystemTime, to: SystemTime| {
        to.duration_since(from).map(|time| time.as_secs() as i64)
    };
    Ok(since(UNIX_EPOCH, time).unwrap_or(0))
}

/// The day (UTC) of a time in seconds since 1970.
fn date_of(seconds: i64) -> String {
    // Years that begin in March have their leap day at their end.
    let days = seconds.div_euclid(86_400) + 719_468;
    let era = days.div_euclid(146_097);
    let day_of_era = days.rem_euclid(146_097);
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted + 2) / 5 + 1;
    let month = if shifted < 10 { shifted + 3 } else { shifted - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!("{year:04}-{month:02}-{day:02}")
}

#[cfg(test)]
mod tests {
    use super::date_of;

    #[test]
    fn days_are_those_of_the_calendar() {
        let cases = [
            (0, "1970-01-01"),
            (951_782_399, "2000-02-28"),
            (951_782_400, "2000-02-29"),
            (951_868_800, "2000-03-01"),
            (1_700_000_000, "2023-11-14"),
            (4_107_542_399, "2100-02-28"),
            (4_107_542_400, "2100-03-01"),
        ];
        for (seconds, date) in cases {
            assert_eq!(date_of(seconds), date);
        }
    }
}
