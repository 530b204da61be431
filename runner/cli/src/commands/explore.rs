//! `softplug explore`: everything that a line and a host may do to a plug-in.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use softplug_conformance::{Sandboxed, differs_from_explored, traces_of_way};
use softplug_explore::{
    Bounds, Changes, Counterexample, Exploration, ExploreError, Kept, Plan, Progress, explore,
    plans,
};
use softplug_host::{Host, HostOptions};

use crate::commands::certify::random;
use crate::dump;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers::{count, things};
use crate::plugin::Library;
use crate::screen::{BAD, GOOD, HEADING, Screen, WARNING};
use crate::sequence;
use crate::stop;

/// Tries everything that a line, a partner and a host may do to a plug-in, up to so many faults.
///
/// Characters are lost, doubled, altered, damaged, late or put in; jobs, pauses and deliveries are
/// aborted; the port is gone and back; the plug-in is saved and restored. It is the module as it is
/// shipped that is explored, state by state: what is not found within the bounds cannot happen
/// within them. A profile is explored in several small configurations, one after the other.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug explore r3964 --profile r3964
  softplug explore r3964 --profile r3964 --only both-send --faults 2
  softplug explore my-plugin.wasm --profile r3964 --faults 2 --out explored
  softplug explore my-plugin.wasm --profile r3964 --faults 2 --out explored --resume
  softplug explore r3964 --profile r3964 --only one-block --set qvz=100 --data 4731
  softplug explore my-plugin.wasm --profile xon-xoff --faults 3 --time 10min --json")]
pub(crate) struct Arguments {
    /// The plug-in: a .wasm file, or a name to look up
    plugin: String,
    #[command(flatten)]
    library: Library,
    /// The profile: what stands at the other end, and what must hold
    #[arg(long, value_name = "PROFILE")]
    profile: String,
    /// Only this configuration; without it all of the profile's
    #[arg(long, value_name = "NAME")]
    only: Option<String>,
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
    /// At most so long for each configuration, such as 90s, 10min or 1h
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
    let plans = chosen(arguments)?;
    let stop = stop::on_signals()?;
    if let Some(folder) = &arguments.out {
        fs::create_dir_all(folder)
            .map_err(|error| Failure::usage(format_args!("{}: {error}", folder.display())))?;
    }
    let changes = arguments.changes();
    let host = Host::new(HostOptions::default()).map_err(Failure::internal)?;
    let subject = Sandboxed::new(host.load_bytes(&module).map_err(Failure::plug_in)?);
    let mut all =
        All { profile: &arguments.profile, faults: arguments.faults, explored: Vec::new() };
    for plan in plans {
        let bounds = arguments.bounds(plan);
        let (bar, begin) = (bar(plan, screen), Instant::now());
        let tell = |progress: Progress| {
            let rate = progress.transitions as f64 / begin.elapsed().as_secs_f64().max(1e-3);
            bar.set_message(format!(
                "{}, depth {}, {} to go on from, {} choices a second",
                things(progress.states, "state"),
                progress.depth,
                count(progress.frontier),
                count(rate as u64),
            ));
            bar.tick();
        };
        let explored = explore(&module, plan, &changes, &bounds, &tell, &stop);
        bar.finish_and_clear();
        let explored = explored.map_err(failure)?;
        if differs_from_explored(&subject, &explored, plan).is_some() {
            return Err(Failure::plug_in(
                "the plug-in cannot be explored: run by itself it does something else, because it \
                 keeps something in its stack or mailbox from one event to the next",
            ));
        }
        let traces = match (&explored.counterexample, &arguments.out) {
            (Some(found), Some(folder)) => write_traces(&explored, found, &module, plan, folder)?,
            _ => Vec::new(),
        };
        show(&explored, plan, &traces, screen);
        all.explored.push(Explored::new(&explored, plan, traces));
    }
    if let Some(folder) = &arguments.out {
        let text = serde_json::to_string_pretty(&all).expect("it is plain data") + "\n";
        write(&folder.join("explored.json"), &text)?;
    }
    screen.document(&all);
    let mut explored = all.explored.iter();
    Ok(if explored.clone().any(|explored| explored.counterexample.is_some()) {
        Exit::Failed
    } else if explored.all(|explored| explored.complete) {
        Exit::Done
    } else {
        Exit::Incomplete
    })
}

/// The configurations that are asked for.
fn chosen(arguments: &Arguments) -> Result<Vec<&'static Plan>, Failure> {
    let plans = plans(&arguments.profile).map_err(failure)?;
    let Some(only) = &arguments.only else { return Ok(plans) };
    let names: Vec<_> = plans.iter().map(|plan| plan.name).collect();
    let chosen: Vec<_> = plans.into_iter().filter(|plan| plan.name == only).collect();
    if chosen.is_empty() {
        return Err(Failure::usage(format_args!(
            "profile \"{}\" has no configuration \"{only}\"; it has {}",
            arguments.profile,
            names.join(", ")
        )));
    }
    Ok(chosen)
}

impl Arguments {
    fn changes(&self) -> Changes {
        let mut peer_settings = self.settings.clone();
        peer_settings.extend_from_slice(&self.peer_settings);
        let jobs = |data: &[Hex]| {
            let jobs: Vec<_> = data.iter().map(|Hex(data)| data.clone()).collect();
            (!jobs.is_empty()).then_some(jobs)
        };
        Changes {
            settings: [self.settings.clone(), peer_settings],
            jobs: [jobs(&self.data), jobs(&self.peer_data)],
            without_model: self.without_model,
        }
    }

    fn bounds(&self, plan: &Plan) -> Bounds {
        let all = || std::thread::available_parallelism().map_or(1, usize::from);
        let file = |folder: &PathBuf| folder.join(format!("{}.states", plan.name));
        Bounds {
            faults: self.faults,
            depth: self.depth,
            states: self.states,
            time: self.time,
            threads: self.threads.map_or_else(all, usize::from),
            keep: self.out.as_ref().map(|folder| Kept { file: file(folder), goes_on: self.resume }),
        }
    }
}

fn failure(error: ExploreError) -> Failure {
    match error {
        ExploreError::NoPlan { .. }
        | ExploreError::Setting(_)
        | ExploreError::NoPeer { .. }
        | ExploreError::Kept { .. }
        | ExploreError::Differs => Failure::usage(error),
        ExploreError::Load(_)
        | ExploreError::Module { .. }
        | ExploreError::NoJob
        | ExploreError::Open { .. } => Failure::plug_in(error),
    }
}

fn bar(plan: &Plan, screen: &Screen) -> ProgressBar {
    if !screen.shows_progress() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    let style = ProgressStyle::with_template("{spinner} {prefix}: {msg}").expect("it is sound");
    bar.with_style(style).with_prefix(plan.name)
}

/// What was found, for machines.
#[derive(Serialize)]
struct All<'a> {
    profile: &'a str,
    faults: u8,
    explored: Vec<Explored>,
}

/// One configuration.
#[derive(Serialize)]
struct Explored {
    name: &'static str,
    partner: &'static str,
    settings: [Vec<(String, String)>; 2],
    jobs: [Vec<String>; 2],
    held_to_model: bool,
    complete: bool,
    states: u64,
    transitions: u64,
    depth: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    longest_to_rest_micros: Option<i64>,
    unavoidable: BTreeMap<String, u64>,
    digest: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    counterexample: Option<Found>,
}

/// The way to something that must never be.
#[derive(Serialize)]
struct Found {
    breach: &'static str,
    text: String,
    choices: Vec<String>,
    traces: Vec<PathBuf>,
}

impl Explored {
    fn new(explored: &Exploration, plan: &Plan, traces: Vec<PathBuf>) -> Self {
        Self {
            name: plan.name,
            partner: plan.partner,
            settings: explored.settings.clone(),
            jobs: [0, 1].map(|end| explored.jobs[end].iter().map(|data| dump::hex(data)).collect()),
            held_to_model: explored.has_model,
            complete: explored.is_complete,
            states: explored.states,
            transitions: explored.transitions,
            depth: explored.depth,
            longest_to_rest_micros: explored.longest.map(|time| time.0),
            unavoidable: explored.unavoidable.clone(),
            digest: digest(explored),
            counterexample: explored.counterexample.as_ref().map(|found| Found {
                breach: found.breach.name(),
                text: found.breach.to_string(),
                choices: found.way.path.iter().map(ToString::to_string).collect(),
                traces,
            }),
        }
    }
}

fn digest(explored: &Exploration) -> String {
    format!("{:032x}", explored.digest)
}

/// The way as each plug-in on it saw it.
fn write_traces(
    explored: &Exploration,
    found: &Counterexample,
    module: &[u8],
    plan: &Plan,
    folder: &Path,
) -> Result<Vec<PathBuf>, Failure> {
    let manifest = softplug_host::lint(module).map_err(Failure::plug_in)?.manifest;
    let traces = traces_of_way(explored, &found.way, Some(&found.breach), plan, &manifest);
    let mut files = Vec::with_capacity(traces.len());
    for trace in traces {
        let file = folder.join(format!("{}.spt", trace.front.id));
        write(&file, &trace.format())?;
        files.push(file);
    }
    Ok(files)
}

fn write(file: &Path, text: &str) -> Result<(), Failure> {
    fs::write(file, text)
        .map_err(|error| Failure::usage(format_args!("{}: {error}", file.display())))
}

fn show(explored: &Exploration, plan: &Plan, traces: &[PathBuf], screen: &Screen) {
    let name = plan.name;
    match &explored.counterexample {
        Some(found) => {
            screen.say(format_args!("{BAD}found{BAD:#} in {name}: {}", found.breach));
            screen.say(sequence::drawn(explored, &found.way));
            for file in traces {
                screen.say(format_args!("  trace: {}", file.display()));
            }
        }
        None if explored.is_complete => screen.say(format_args!(
            "{GOOD}complete{GOOD:#}: {name}, nothing that must never be can happen"
        )),
        None => screen.say(format_args!(
            "{WARNING}incomplete{WARNING:#}: {name}, it ended before all was seen; nothing was found so far"
        )),
    }
    let row = |title: &str, text: String| {
        screen.say(format_args!("  {HEADING}{title:<9}{HEADING:#}{text}"));
    };
    row("partner", plan.partner.to_owned());
    let held =
        if explored.has_model { "the promises and the profile's model" } else { "the promises" };
    row("held to", held.to_owned());
    let (states, choices) = (things(explored.states, "state"), count(explored.transitions));
    row("explored", format!("{states}, {choices} choices, {} deep", explored.depth));
    if let Some(time) = explored.longest {
        let time = time.0 as f64 / 1e6;
        row("rest", format!("at most {time:.3} s after the last fault, from every state"));
    }
    if !explored.unavoidable.is_empty() {
        let counted = explored.unavoidable.iter();
        let counted = counted.map(|(name, times)| format!("{name} {}", count(*times)));
        let counted = counted.collect::<Vec<_>>().join(", ");
        row("allowed", format!("what the protocol cannot keep from happening: {counted}"));
    }
    row("digest", digest(explored));
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
