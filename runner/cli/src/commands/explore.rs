//! `softplug explore`: everything that a line and a host may do to a plug-in.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use softplug_conformance::traces_of_way;
use softplug_explore::{
    Bounds, Changes, Counterexample, Exploration, ExploreError, Kept, Progress, explore, plan,
};

use crate::commands::certify::random;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers::{count, things};
use crate::plugin::Library;
use crate::screen::{BAD, GOOD, HEADING, Screen, WARNING};
use crate::stop;

/// The file in the folder in which the states are kept.
const STATES: &str = "states";

/// Tries everything that a line, a partner and a host may do to a plug-in, up to so many faults.
///
/// Characters are lost, doubled, altered, damaged, late or put in; jobs, pauses and deliveries are
/// aborted; the port is gone and back; the plug-in is saved and restored. It is the module as it is
/// shipped that is explored, state by state: what is not found within the bounds cannot happen
/// within them.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug explore r3964 --profile r3964
  softplug explore my-plugin.wasm --profile r3964 --faults 2 --out explored
  softplug explore my-plugin.wasm --profile r3964 --faults 2 --out explored --resume
  softplug explore r3964 --profile r3964 --set qvz=100 --data 4731 --peer-data 4732
  softplug explore my-plugin.wasm --profile xon-xoff --faults 3 --time 10min --json")]
pub(crate) struct Arguments {
    /// The plug-in: a .wasm file, or a name to look up
    plugin: String,
    #[command(flatten)]
    library: Library,
    /// The profile: what stands at the other end, and what must hold
    #[arg(long, value_name = "PROFILE")]
    profile: String,
    /// Faults and requests out of turn, together
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = clap::value_parser!(u8).range(..=8))]
    faults: u8,
    /// Data of a job, as hex digits; may be given again for one job after the other
    #[arg(long, value_name = "HEX", value_parser = hex)]
    data: Vec<Hex>,
    /// The same of the second plug-in, where the partner is one
    #[arg(long, value_name = "HEX", value_parser = hex)]
    peer_data: Vec<Hex>,
    /// A setting of the plug-in, and of a partner that is one
    #[arg(long = "set", value_name = "NAME=VALUE", value_parser = setting)]
    settings: Vec<(String, String)>,
    /// A setting of a partner that is a plug-in
    #[arg(long = "peer-set", value_name = "NAME=VALUE", value_parser = setting)]
    peer_settings: Vec<(String, String)>,
    /// Hold the plug-in to the promises alone, not to each rule of the profile
    #[arg(long)]
    without_model: bool,
    /// At most so many choices one after the other
    #[arg(long, value_name = "N")]
    depth: Option<u32>,
    /// About so many states at most
    #[arg(long, value_name = "N")]
    states: Option<u64>,
    /// At most so long, such as 90s, 10min or 1h
    #[arg(long, value_name = "SPAN", value_parser = random::time)]
    time: Option<Duration>,
    /// Threads to run on; they change nothing of what is found
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    /// Folder for the states and for what is found, made if it is missing
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Go on from the states that an exploration before left in the folder
    #[arg(long, requires = "out")]
    resume: bool,
}

/// Bytes, given as hex digits.
#[derive(Clone, Debug)]
struct Hex(Vec<u8>);

fn hex(text: &str) -> Result<Hex, String> {
    let wrong = || format!("\"{text}\" are no bytes: give hex digits in pairs, such as 473158");
    let pairs = text.as_bytes().chunks(2);
    let bytes = pairs.map(|pair| {
        let pair = std::str::from_utf8(pair).ok().filter(|pair| pair.len() == 2);
        let is_hex = |pair: &&str| pair.bytes().all(|digit| digit.is_ascii_hexdigit());
        pair.filter(is_hex).and_then(|pair| u8::from_str_radix(pair, 16).ok())
    });
    bytes.collect::<Option<_>>().map(Hex).ok_or_else(wrong)
}

fn setting(text: &str) -> Result<(String, String), String> {
    let (name, value) =
        text.split_once('=').ok_or_else(|| format!("\"{text}\" is no setting: NAME=VALUE"))?;
    Ok((name.to_owned(), value.to_owned()))
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let module = arguments.library.read(&arguments.plugin)?;
    let plan = plan(&arguments.profile).map_err(Failure::usage)?;
    let stop = stop::on_signals()?;
    if let Some(folder) = &arguments.out {
        fs::create_dir_all(folder)
            .map_err(|error| Failure::usage(format_args!("{}: {error}", folder.display())))?;
    }
    let mut peer_settings = arguments.settings.clone();
    peer_settings.extend_from_slice(&arguments.peer_settings);
    let jobs = |data: &[Hex]| {
        let jobs: Vec<_> = data.iter().map(|Hex(data)| data.clone()).collect();
        (!jobs.is_empty()).then_some(jobs)
    };
    let changes = Changes {
        settings: [arguments.settings.clone(), peer_settings],
        jobs: [jobs(&arguments.data), jobs(&arguments.peer_data)],
        without_model: arguments.without_model,
    };
    let threads = arguments.threads.map(usize::from);
    let all = || std::thread::available_parallelism().map_or(1, usize::from);
    let bounds = Bounds {
        faults: arguments.faults,
        depth: arguments.depth,
        states: arguments.states,
        time: arguments.time,
        threads: threads.unwrap_or_else(all),
        keep: arguments
            .out
            .as_ref()
            .map(|folder| Kept { file: folder.join(STATES), goes_on: arguments.resume }),
    };
    let (bar, begin) = (bar(screen), Instant::now());
    let tell = |progress: Progress| {
        let rate = progress.transitions as f64 / begin.elapsed().as_secs_f64().max(1e-3);
        bar.set_message(format!(
            "depth {}, {}, {} to go on from, {} choices a second",
            progress.depth,
            things(progress.states, "state"),
            count(progress.frontier),
            count(rate as u64),
        ));
        bar.tick();
    };
    let explored = explore(&module, &plan, &changes, &bounds, &tell, &stop);
    bar.finish_and_clear();
    let explored = explored.map_err(failure)?;
    let mut traces = Vec::new();
    if let (Some(way), Some(folder)) = (&explored.counterexample, &arguments.out) {
        traces = write_traces(&explored, way, &module, &arguments.profile, folder)?;
    }
    let found = Found::new(&explored, &arguments.profile, &bounds, &traces);
    if let Some(folder) = &arguments.out {
        let text = serde_json::to_string_pretty(&found).expect("it is plain data") + "\n";
        write(&folder.join("explored.json"), &text)?;
    }
    show(&found, &explored, plan.partner, screen);
    screen.document(&found);
    Ok(match (&explored.counterexample, explored.is_complete) {
        (Some(_), _) => Exit::Failed,
        (None, true) => Exit::Done,
        (None, false) => Exit::Incomplete,
    })
}

fn failure(error: ExploreError) -> Failure {
    match error {
        ExploreError::NoPlan { .. }
        | ExploreError::Setting(_)
        | ExploreError::Kept { .. }
        | ExploreError::Differs => Failure::usage(error),
        ExploreError::Load(_) | ExploreError::Module { .. } | ExploreError::Open { .. } => {
            Failure::plug_in(error)
        }
    }
}

fn bar(screen: &Screen) -> ProgressBar {
    if !screen.shows_progress() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    bar.with_style(ProgressStyle::with_template("{spinner} {msg}").expect("it is sound"))
}

/// What was found, for machines.
#[derive(Serialize)]
struct Found<'a> {
    profile: &'a str,
    faults: u8,
    complete: bool,
    states: u64,
    transitions: u64,
    depth: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    longest_to_rest_micros: Option<i64>,
    unavoidable: &'a std::collections::BTreeMap<String, u64>,
    digest: String,
    settings: &'a [Vec<(String, String)>; 2],
    jobs: [Vec<String>; 2],
    #[serde(skip_serializing_if = "Option::is_none")]
    counterexample: Option<Way<'a>>,
}

/// The way to something that must never be.
#[derive(Serialize)]
struct Way<'a> {
    breach: &'static str,
    text: String,
    choices: Vec<String>,
    traces: &'a [PathBuf],
}

impl<'a> Found<'a> {
    fn new(
        explored: &'a Exploration,
        profile: &'a str,
        bounds: &Bounds,
        traces: &'a [PathBuf],
    ) -> Self {
        let in_hex = |data: &Vec<u8>| data.iter().map(|byte| format!("{byte:02x}")).collect();
        let jobs = [0, 1].map(|end| explored.jobs[end].iter().map(in_hex).collect());
        Self {
            profile,
            faults: bounds.faults,
            complete: explored.is_complete,
            states: explored.states,
            transitions: explored.transitions,
            depth: explored.depth,
            longest_to_rest_micros: explored.longest.map(|time| time.0),
            unavoidable: &explored.unavoidable,
            digest: format!("{:032x}", explored.digest),
            settings: &explored.settings,
            jobs,
            counterexample: explored.counterexample.as_ref().map(|way| Way {
                breach: way.breach.name(),
                text: way.breach.to_string(),
                choices: way.path.iter().map(ToString::to_string).collect(),
                traces,
            }),
        }
    }
}

/// The way as each plug-in on it saw it.
fn write_traces(
    explored: &Exploration,
    way: &Counterexample,
    module: &[u8],
    profile: &str,
    folder: &Path,
) -> Result<Vec<PathBuf>, Failure> {
    let manifest = softplug_host::lint(module).map_err(Failure::plug_in)?.manifest;
    let traces = traces_of_way(explored, way, profile, &manifest);
    let mut files = Vec::with_capacity(traces.len());
    for (end, trace) in traces.iter().enumerate() {
        let file = folder.join(format!("{}-{end}.spt", way.breach.name()));
        write(&file, &trace.format())?;
        files.push(file);
    }
    Ok(files)
}

fn write(file: &Path, text: &str) -> Result<(), Failure> {
    fs::write(file, text).map_err(|error| Failure::usage(format_args!("{}: {error}", file.display())))
}

fn show(found: &Found<'_>, explored: &Exploration, partner: &str, screen: &Screen) {
    let within = format!("within {}", things(u64::from(found.faults), "fault"));
    match &found.counterexample {
        Some(way) => {
            screen.say(format_args!("{BAD}found{BAD:#}: {}, {within}", way.text));
            screen.say(crate::sequence::drawn(explored));
            way.traces
                .iter()
                .for_each(|file| screen.say(format_args!("  trace: {}", file.display())));
        }
        None if found.complete => screen.say(format_args!(
            "{GOOD}complete{GOOD:#}: {within}, nothing that must never be can happen"
        )),
        None => screen.say(format_args!(
            "{WARNING}incomplete{WARNING:#}: a bound was reached; nothing was found so far"
        )),
    }
    let row = |title: &str, text: String| {
        screen.say(format_args!("  {HEADING}{title:<9}{HEADING:#}{text}"));
    };
    row("partner", partner.to_owned());
    row(
        "explored",
        format!(
            "{}, {} choices, {} deep",
            things(found.states, "state"),
            count(found.transitions),
            count(u64::from(found.depth)),
        ),
    );
    if let Some(time) = explored.longest {
        let time = time.0 as f64 / 1e6;
        row("rest", format!("within {time:.3} s when nothing goes wrong any more, from every state"));
    }
    if !found.unavoidable.is_empty() {
        let counted = found.unavoidable.iter().map(|(name, times)| format!("{name} {}", count(*times)));
        row("allowed", format!(
            "what the protocol cannot keep from happening: {}",
            counted.collect::<Vec<_>>().join(", ")
        ));
    }
    row("digest", found.digest.clone());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_read_in_pairs() {
        assert_eq!(hex("4731").unwrap().0, b"G1");
        assert_eq!(hex("").unwrap().0, b"");
        for wrong in ["4", "G1", "47 31", "+1", "ä1"] {
            assert!(hex(wrong).is_err(), "{wrong}");
        }
    }
}
