//! `softplug replay`: traces against a plug-in, in virtual time.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use softplug_conformance::certify::matches;
use softplug_conformance::{
    Case, FaultClass, Filter, Judge, LoadError, Permutation, Sandboxed, Summary, Verdict, load,
    run_all,
};
#[cfg(feature = "native")]
use {softplug_conformance::FromFn, softplug_native::NativePlugin};

use super::{bless, calls, step};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::numbers;
use crate::plugin::{Chosen, Library, as_word};
use crate::screen::{BAD, GOOD, Screen};

/// Permutations of a quick run.
const QUICK: [&str; 5] = ["uncut", "cut:1", "cut:whole", "twice", "swap:all"];
/// Failures that are told in full.
const SHOWN: usize = 3;

/// Replays traces against a plug-in and says where it does something else.
///
/// Every trace also runs with its bytes cut differently, twice in one instance, and with the
/// plug-in saved and restored in the middle; all must show the same. Time is virtual: two runs give
/// the same result to the byte.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug replay xon-xoff fixtures/traces/xon-xoff
  softplug replay xon-xoff fixtures/traces --only \"xon-xoff.tx.*\" --no-permutations
  softplug replay my-plugin.wasm case.spt --only my.case/cut:1
  softplug replay xon-xoff case.spt --bless
  softplug replay r3964 r3964.rx.press-line.spt --bless --force
  softplug replay xon-xoff case.spt --calls calls.jsonl
  softplug replay xon-xoff case.spt --step --only my.case/swap:all")]
pub(crate) struct Arguments {
    /// The plug-in: a .wasm file, a name to look up, or native:NAME
    plugin: String,
    #[command(flatten)]
    library: Library,
    /// Trace files, or folders to search for .spt files
    #[arg(required = true, value_name = "TRACE")]
    traces: Vec<PathBuf>,
    /// Only these traces, or cases as ID/PERMUTATION; * and ? stand for anything; may be repeated
    #[arg(long, value_name = "PATTERN")]
    only: Vec<String>,
    /// Run every trace only as it is written
    #[arg(long)]
    no_permutations: bool,
    /// Judge the native code of the plug-in of this name too
    #[arg(long)]
    native: bool,
    /// Rewrite the traces' expectations to what the plug-in does; read the difference well. Where
    /// it no longer sends bytes that stand there as sent, nothing is written
    #[arg(long, conflicts_with = "native")]
    bless: bool,
    /// Bless also where bytes are lost by it
    #[arg(long, short, requires = "bless")]
    force: bool,
    /// Walk through one case in the terminal, event by event, forward and back
    #[arg(long, conflicts_with_all = ["bless", "calls", "native"])]
    step: bool,
    /// Write every call of the traces as they are written, with its result, as JSON lines
    #[arg(long, value_name = "FILE", conflicts_with = "bless")]
    calls: Option<PathBuf>,
}

/// What machines get.
#[derive(Serialize)]
struct Document<'a> {
    #[serde(skip_serializing_if = "Option::is_none")]
    sha256: Option<String>,
    #[serde(flatten)]
    summary: &'a Summary,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let cases = match load(&arguments.traces) {
        Ok(cases) => cases,
        Err(error) => return Err(load_failure(&error, screen)),
    };
    let plugin = arguments.library.load(&arguments.plugin)?;
    let filter = filter(arguments, &cases)?;
    if arguments.bless {
        let judge = judge_of(&plugin);
        let cases = cases.iter().filter(|case| filter.takes_trace(&case.trace.front.id));
        return bless::run(judge.as_ref(), cases, arguments.force, screen);
    }
    if arguments.step {
        let (case, permutation) = one(arguments, &cases, &filter)?;
        return step::run(&plugin, case, &permutation);
    }
    let judges = judges(&plugin, arguments.native)?;
    let judges: Vec<_> = judges.iter().map(AsRef::as_ref).collect();
    let summary = run_all(&judges, &cases, &filter);
    if summary.total == 0 {
        return Err(nothing_selected(arguments));
    }
    let sha256 = match &plugin {
        Chosen::Sandboxed(plugin) => Some(plugin.digest().to_string()),
        #[cfg(feature = "native")]
        Chosen::Native(..) => None,
    };
    if let Some(file) = &arguments.calls {
        let taken = cases.iter().filter(|case| filter.takes_trace(&case.trace.front.id));
        files::write(file, &calls::of(&plugin, taken))?;
    }
    screen.document(&Document { sha256, summary: &summary });
    show(&summary, cases.len(), arguments, screen);
    Ok(exit(&summary))
}

/// All traces of the folder that are for this plug-in, in the permutations that
/// find most; `None` if there is no trace.
pub(crate) fn quick(plugin: &Chosen, folder: &Path) -> Result<Option<Summary>, Failure> {
    let mut cases = match load([folder]) {
        Ok(cases) => cases,
        Err(LoadError::Nothing { .. }) => return Ok(None),
        Err(error) => return Err(Failure::usage(error)),
    };
    let claims: Vec<_> = plugin.manifest().profiles.iter().map(|profile| &profile.name).collect();
    cases.retain(|case| claims.contains(&&case.trace.front.profile));
    if cases.is_empty() {
        return Ok(None);
    }
    let names = cases.iter().flat_map(|case| {
        let id = &case.trace.front.id;
        QUICK.iter().map(move |permutation| format!("{id}/{permutation}"))
    });
    let filter = Filter::only(names);
    let judges = judges(plugin, false)?;
    let judges: Vec<_> = judges.iter().map(AsRef::as_ref).collect();
    Ok(Some(run_all(&judges, &cases, &filter)))
}

fn judges(plugin: &Chosen, with_native: bool) -> Result<Vec<Box<dyn Judge>>, Failure> {
    let mut judges = vec![judge_of(plugin)];
    if with_native && matches!(plugin, Chosen::Sandboxed(_)) {
        match crate::plugin::native(&plugin.manifest().name)? {
            #[cfg(feature = "native")]
            Chosen::Native(plugin, manifest) => judges.push(native(plugin, &manifest)),
            Chosen::Sandboxed(_) => {}
        }
    }
    Ok(judges)
}

/// The plug-in as one that is judged.
pub(crate) fn judge_of(plugin: &Chosen) -> Box<dyn Judge> {
    match plugin {
        Chosen::Sandboxed(plugin) => Box::new(Sandboxed::new(plugin.clone())),
        #[cfg(feature = "native")]
        Chosen::Native(plugin, manifest) => native(*plugin, manifest),
    }
}

#[cfg(feature = "native")]
fn native(plugin: NativePlugin, manifest: &softplug_abi::manifest::Manifest) -> Box<dyn Judge> {
    Box::new(FromFn::new(manifest.clone(), move || plugin.instantiate()))
}

fn load_failure(error: &LoadError, screen: &Screen) -> Failure {
    match error {
        LoadError::Nothing { .. } => Failure::new(Exit::NothingSelected, error),
        LoadError::Parse { .. } if !screen.is_json() => {
            screen.report(error.report());
            Failure::usage("a trace cannot be read; nothing was replayed")
        }
        error => Failure::usage(error),
    }
}

fn nothing_selected(arguments: &Arguments) -> Failure {
    let patterns = arguments.only.join(", ");
    Failure::new(Exit::NothingSelected, format_args!("no case is called {patterns}"))
        .hint("a trace's id stands in its first line; leave --only out to run all")
}

/// The one case to walk through, as it is written or in the permutation that --only names.
fn one<'a>(
    arguments: &Arguments,
    cases: &'a [Case],
    filter: &Filter,
) -> Result<(&'a Case, Permutation), Failure> {
    let taken: Vec<_> =
        cases.iter().filter(|case| filter.takes_trace(&case.trace.front.id)).collect();
    let [case] = taken[..] else {
        return Err(Failure::usage(format_args!(
            "--step walks through one case, and here are {}",
            taken.len()
        ))
        .hint("name the case with --only ID or --only ID/PERMUTATION"));
    };
    let asked = arguments.only.iter().find_map(|pattern| Some(pattern.split_once('/')?.1));
    let permutation = asked.map_or(Ok(Permutation::Uncut), str::parse);
    Ok((case, permutation.map_err(Failure::usage)?))
}

/// Names with `*` and `?` are looked for among the ids.
fn filter(arguments: &Arguments, cases: &[Case]) -> Result<Filter, Failure> {
    let ids = || cases.iter().map(|case| case.trace.front.id.as_str());
    let way = if arguments.no_permutations { Some("uncut") } else { None };
    if arguments.only.is_empty() && way.is_none() {
        return Ok(Filter::default());
    }
    let all = ["*".to_owned()];
    let patterns = if arguments.only.is_empty() { &all[..] } else { &arguments.only };
    let mut names = Vec::new();
    for pattern in patterns {
        let (pattern, asked) = match pattern.split_once('/') {
            Some((id, way)) => (id, Some(way)),
            None => (pattern.as_str(), None),
        };
        for id in ids().filter(|id| matches(pattern, id)) {
            names.push(match asked.or(way) {
                Some(way) => format!("{id}/{way}"),
                None => id.to_owned(),
            });
        }
    }
    // An empty filter would take all.
    if names.is_empty() { Err(nothing_selected(arguments)) } else { Ok(Filter::only(names)) }
}

fn show(summary: &Summary, traces: usize, arguments: &Arguments, screen: &Screen) {
    let failed: Vec<_> = summary.cases.iter().filter(|verdict| !verdict.is_passed()).collect();
    for verdict in failed.iter().take(SHOWN) {
        let text = verdict.to_string().replace("replay PLUGIN", &again(arguments));
        screen.say(format_args!("{text}\n"));
    }
    if failed.len() > SHOWN {
        let names = failed[SHOWN..].iter().map(|verdict| &verdict.case);
        screen.say("failed too:");
        names.for_each(|name| screen.say(format_args!("  {name}")));
    }
    let (style, word) = if summary.failed == 0 { (GOOD, "passed") } else { (BAD, "FAILED") };
    screen.say(format_args!(
        "{style}{word}{style:#}: {} of {} passed, from {}",
        numbers::count(summary.passed as u64),
        numbers::things(summary.total as u64, "case"),
        numbers::things(traces as u64, "trace")
    ));
}

/// The beginning of the command that runs a case again.
fn again(arguments: &Arguments) -> String {
    format!("replay {}", as_word(&arguments.plugin))
}

fn exit(summary: &Summary) -> Exit {
    let is_unstarted = |verdict: &Verdict| {
        let fault = verdict.failure.as_ref().and_then(|failure| failure.fault.as_ref());
        fault.is_some_and(|fault| fault.class == FaultClass::NotStarted)
    };
    match summary {
        Summary { failed: 0, .. } => Exit::Done,
        Summary { cases, .. } if cases.iter().all(is_unstarted) => Exit::PlugIn,
        _ => Exit::Failed,
    }
}
