//! `softplug explore`: everything that a line and a host may do to a plug-in.

mod show;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use clap::Args;
use data_encoding::HEXLOWER;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use softplug_conformance::{Places, explore_checked, traces_of_way};
use softplug_explore::{
    Bounds, Changes, Counterexample, ExploreError, Kept, Plan, Progress, Setup, Walks, larger,
    plans, walk,
};

use self::show::{All, Explored, Random};
use crate::commands::amount;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers::{count, things};
use crate::plugin::Library;
use crate::screen::Screen;
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
  softplug explore my-plugin.wasm --profile xon-xoff --faults 3 --time 10min --json
  softplug explore my-plugin.wasm --profile xon-xoff --faults 4 --random 100 --seed 7")]
pub(crate) struct Arguments {
    /// The plug-in: a .wasm file, or a name to look up
    plugin: String,
    #[command(flatten)]
    library: Library,
    /// The profile: what stands at the other end, and what must hold
    #[arg(long, value_name = "PROFILE")]
    profile: String,
    /// Only this configuration; without it all of the profile's but `large`
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
    /// Instead of everything, random ways in so many rounds of 20,000 choices each, through the
    /// configuration `large` or the one that is named; they prefer new states and new code
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), conflicts_with_all = ["depth", "states", "resume"])]
    random: Option<u32>,
    /// Seed of the random ways
    #[arg(long, value_name = "S", requires = "random")]
    seed: Option<u64>,
    /// At most so many choices one after the other
    #[arg(long, value_name = "N")]
    depth: Option<u32>,
    /// About so many states at most
    #[arg(long, value_name = "N")]
    states: Option<u64>,
    /// At most so long for each configuration, such as 90s, 10min or 1h
    #[arg(long, value_name = "SPAN", value_parser = amount::time)]
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
    let mut all =
        All { profile: &arguments.profile, faults: arguments.faults, explored: Vec::new() };
    let work = Work { arguments, module: &module, stop: &stop, screen };
    for plan in plans {
        all.explored.push(match arguments.random {
            Some(rounds) => work.walk(plan, rounds)?,
            None => work.explore(plan)?,
        });
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

/// What all configurations have in common.
struct Work<'a> {
    arguments: &'a Arguments,
    module: &'a [u8],
    stop: &'a AtomicBool,
    screen: &'a Screen,
}

impl Work<'_> {
    /// Everything that may happen.
    fn explore(&self, plan: &Plan) -> Result<Explored, Failure> {
        let Self { arguments, module, screen, .. } = self;
        let bounds = arguments.bounds(plan);
        let (bar, begin) = (bar(plan, screen), Instant::now());
        let tell = |progress: Progress| {
            let rate = progress.transitions as f64 / begin.elapsed().as_secs_f64().max(1e-3);
            bar.set_message(format!("{}, {} choices a second", far(progress), count(rate as u64)));
            bar.tick();
        };
        let changes = arguments.changes();
        let explored = explore_checked(module, plan, &changes, &bounds, &tell, self.stop);
        bar.finish_and_clear();
        let explored = explored.map_err(failure)?;
        let found = explored.counterexample.as_ref();
        let traces = self.write_traces(&explored.setup, found, plan)?;
        let shown = Explored::whole(&explored, plan, arguments.is_judged(plan), traces);
        shown.show(found, &explored.setup, screen);
        Ok(shown)
    }

    /// Random ways.
    fn walk(&self, plan: &Plan, rounds: u32) -> Result<Explored, Failure> {
        let Self { arguments, module, screen, .. } = self;
        let walks = arguments.walks(rounds);
        let places = Places::of(module).map_err(Failure::plug_in)?;
        let marked = places.marked(module).map_err(Failure::plug_in)?;
        let bar = bar(plan, screen);
        let tell = |progress: Progress| {
            let (states, made) = (things(progress.states, "state"), count(progress.transitions));
            bar.set_message(format!("{made} choices, {states}"));
            bar.tick();
        };
        let bounds = Bounds { keep: None, ..arguments.bounds(plan) };
        let walked =
            walk(module, &marked, plan, &arguments.changes(), &bounds, walks, &tell, self.stop);
        bar.finish_and_clear();
        let walked = walked.map_err(failure)?;
        let found = walked.counterexample.as_ref();
        let traces = self.write_traces(&walked.setup, found, plan)?;
        let coverage = places.coverage(module, &walked.marks);
        let random = Random { seed: walks.seed, rounds: walked.rounds, coverage };
        let is_judged = arguments.is_judged(plan);
        let shown = Explored::random(&walked, plan, is_judged, walks.rounds, random, traces);
        shown.show(found, &walked.setup, screen);
        Ok(shown)
    }

    /// The way to what was found, as each plug-in on it saw it.
    fn write_traces(
        &self,
        setup: &Setup,
        found: Option<&Counterexample>,
        plan: &Plan,
    ) -> Result<Vec<PathBuf>, Failure> {
        let (Some(found), Some(folder)) = (found, &self.arguments.out) else {
            return Ok(Vec::new());
        };
        let manifest = softplug_host::lint(self.module).map_err(Failure::plug_in)?.manifest;
        let again = self.arguments.again(plan);
        let leads_to = Some((&found.breach, again.as_str()));
        let traces = traces_of_way(setup, &found.way, leads_to, plan, &manifest);
        let mut files = Vec::with_capacity(traces.len());
        for trace in traces {
            let file = folder.join(format!("{}.spt", trace.front.id));
            write(&file, &trace.format())?;
            files.push(file);
        }
        Ok(files)
    }
}

/// The configurations that are asked for.
fn chosen(arguments: &Arguments) -> Result<Vec<&'static Plan>, Failure> {
    let plans = plans(&arguments.profile).map_err(failure)?;
    let larger = larger(&arguments.profile).map_err(failure)?;
    let Some(only) = &arguments.only else {
        return Ok(if arguments.random.is_some() { vec![larger] } else { plans });
    };
    let all = plans.into_iter().chain([larger]);
    let names: Vec<_> = all.clone().map(|plan| plan.name).collect();
    let chosen: Vec<_> = all.filter(|plan| plan.name == only).collect();
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
    /// Whether the partner knows the settings.
    fn is_judged(&self, plan: &Plan) -> bool {
        !plan.has_machine() || self.settings.is_empty()
    }

    /// The command that finds the same in this configuration.
    fn again(&self, plan: &Plan) -> String {
        let mut words = vec![format!(
            "softplug explore PLUGIN --profile {} --only {} --faults {}",
            self.profile, plan.name, self.faults
        )];
        let mut add = |name: &str, value: String| words.push(format!("--{name} {value}"));
        self.data.iter().for_each(|Hex(data)| add("data", HEXLOWER.encode(data)));
        self.peer_data.iter().for_each(|Hex(data)| add("peer-data", HEXLOWER.encode(data)));
        let setting = |(name, value): &(String, String)| format!("{name}={}", value.escape_debug());
        self.settings.iter().for_each(|one| add("set", setting(one)));
        self.peer_settings.iter().for_each(|one| add("peer-set", setting(one)));
        if let Some(rounds) = self.random {
            add("random", rounds.to_string());
            add("seed", self.walks(rounds).seed.to_string());
        }
        if self.without_model {
            words.push("--without-model".to_owned());
        }
        words.join(" ")
    }

    fn walks(&self, rounds: u32) -> Walks {
        Walks { rounds, seed: self.seed.unwrap_or(Walks::default().seed) }
    }

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
            held: Bounds::default().held,
            keep: self.out.as_ref().map(|folder| Kept { file: file(folder), goes_on: self.resume }),
        }
    }
}

pub(super) fn failure(error: ExploreError) -> Failure {
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

/// How far an exploration is.
pub(super) fn far(progress: Progress) -> String {
    format!(
        "{}, depth {}, {} to go on from",
        things(progress.states, "state"),
        progress.depth,
        count(progress.frontier)
    )
}

fn write(file: &Path, text: &str) -> Result<(), Failure> {
    fs::write(file, text)
        .map_err(|error| Failure::usage(format_args!("{}: {error}", file.display())))
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
