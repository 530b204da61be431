//! `softplug trace new`: begins a case.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use serde::Serialize;
use softplug_conformance::ledger::{Clause, Ledger};
use softplug_conformance::{Corpus, Source as CaseSource};
use softplug_report::Level;
use softplug_trace::{Entry, Line, Trace, What, is_slug};

use crate::commands::cases::no_profile;
use crate::corpus::{REQUIREMENTS, Source};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::Partial;
use crate::guess::nearest;
use crate::screen::Screen;

/// Begins a case: a trace with all that stands before its events, in its place.
///
/// Profile, clauses, level, line and revision come from the ledger and the other cases of the
/// profile. Write then what the host asks for (?) and what comes from the line (<), and let the
/// plug-in write the rest with `softplug replay PLUGIN FILE --bless`.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug trace new my-machine.tx.late-nak --clause my-machine.tx.repeat --title \"NAK comes late\"
  softplug trace new r3964.rx.twice --like r3964.rx.press-line --out twice.spt")]
pub(super) struct Arguments {
    /// The id of the case: the profile, a dot and more
    #[arg(value_name = "ID")]
    id: String,
    /// One sentence that says what the case shows
    #[arg(long, default_value = "What this case shows")]
    title: String,
    /// A clause that it shows; may be repeated [default: the clause of the same name, or those of
    /// the case that it is like]
    #[arg(long = "clause", value_name = "CLAUSE")]
    clauses: Vec<String>,
    /// Begin with the events of this case
    #[arg(long, value_name = "CASE")]
    like: Option<String>,
    /// The trace to write [default: traces/PROFILE/ID.spt in the project, else ID.spt]
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    corpus: Source,
}

#[derive(Serialize)]
struct Document {
    file: String,
    clauses: Vec<String>,
}

/// What is written where there are no events yet.
const EMPTY: &str = "# ? is what the host asks for, < what comes from the line. The plug-in writes the \
                     rest:\n#   softplug replay PLUGIN FILE --bless\n. 1.000000\n";

pub(super) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let id = &arguments.id;
    let profile = id.split('.').next().unwrap_or_default();
    if !is_slug(id) || !id.contains('.') {
        return Err(Failure::usage(format_args!("\"{}\" is no id of a case", id.escape_debug()))
            .hint("it is the profile, a dot and more, in lower-case letters, digits and hyphens"));
    }
    let corpus = arguments.corpus.load_begun_for(profile, screen)?;
    let ledger = corpus.ledger(profile).ok_or_else(|| no_profile(&corpus, profile))?;
    if corpus.list().iter().any(|case| case.id == id) {
        return Err(Failure::usage(format_args!("there is a case {id} already"))
            .hint(format_args!("`softplug explain {id}` shows it; choose another id")));
    }
    let like = arguments.like.as_deref().map(|like| find(&corpus, like)).transpose()?;
    let clauses = clauses(arguments, ledger, like)?;
    let text = text(arguments, ledger, &clauses, like, &corpus);
    let trace = Trace::parse(&text).map_err(|error| {
        // What was given stands in it; all else is right.
        Failure::usage(format_args!("this makes no trace: {error}"))
    })?;
    let out = match (&arguments.out, arguments.corpus.own_folder()) {
        (Some(out), _) => out.clone(),
        (None, Some(folder)) if has(folder, profile) => {
            let traces = folder.join("traces").join(profile);
            std::fs::create_dir_all(&traces).map_err(|error| {
                Failure::usage(format_args!("cannot make {}: {error}", traces.display()))
            })?;
            traces.join(format!("{id}.spt"))
        }
        (None, _) => PathBuf::from(format!("{id}.spt")),
    };
    let file = Partial::create(&out, false)?.write(trace.format().as_bytes())?;
    screen.say(file.display());
    screen.note("write what is given into it, then: softplug replay PLUGIN FILE --bless");
    let clauses = clauses.iter().map(|clause| clause.id.clone()).collect();
    screen.document(&Document { file: file.display().to_string(), clauses });
    Ok(Exit::Done)
}

/// Whether a folder has the profile: its ledger, or traces of it.
fn has(folder: &Path, profile: &str) -> bool {
    folder.join(REQUIREMENTS).join(format!("{profile}.toml")).is_file()
        || folder.join("traces").join(profile).is_dir()
}

/// The clauses that were named, else the one of the case's name, else those of the case that it is
/// like.
fn clauses<'a>(
    arguments: &Arguments,
    ledger: &'a Ledger,
    like: Option<&Trace>,
) -> Result<Vec<&'a Clause>, Failure> {
    let ids = || ledger.clauses.iter().map(|clause| clause.id.as_str());
    if arguments.clauses.is_empty() {
        if let Some(clause) = ledger.clause(&arguments.id) {
            return Ok(vec![clause]);
        }
        let of_like = like.into_iter().flat_map(|like| &like.front.clauses);
        let of_like: Vec<_> = of_like.filter_map(|id| ledger.clause(id)).collect();
        if !of_like.is_empty() {
            return Ok(of_like);
        }
        let group = arguments.id.rsplit_once('.').map_or("", |(group, _)| group);
        let near: Vec<_> = ids().filter(|id| id.starts_with(&format!("{group}."))).collect();
        let near = if near.is_empty() { ids().collect() } else { near };
        return Err(Failure::usage("which clause does it show? Name it with --clause")
            .hint(format_args!("there are {}", near.join(", "))));
    }
    let named = arguments.clauses.iter().map(|id| {
        ledger.clause(id).ok_or_else(|| {
            let failure = Failure::usage(format_args!(
                "the profile {} has no clause \"{id}\"",
                ledger.profile
            ));
            match nearest(id, ids()) {
                Some(guess) => failure.hint(format_args!("did you mean \"{guess}\"?")),
                None => {
                    failure.hint(format_args!("it has {}", ids().collect::<Vec<_>>().join(", ")))
                }
            }
        })
    });
    named.collect()
}

fn find<'a>(corpus: &'a Corpus, id: &str) -> Result<&'a Trace, Failure> {
    let cases = corpus.list();
    let found = cases.iter().find(|case| case.id == id).map(|case| case.source);
    match found {
        Some(CaseSource::Trace(case)) => Ok(&case.trace),
        Some(_) => Err(Failure::usage(format_args!("{id} is no trace: its events stand in code"))),
        None => Err(Failure::usage(format_args!("there is no case \"{id}\""))
            .hint("`softplug cases` lists them")),
    }
}

fn text(
    arguments: &Arguments,
    ledger: &Ledger,
    clauses: &[&Clause],
    like: Option<&Trace>,
    corpus: &Corpus,
) -> String {
    let level = clauses.iter().map(|clause| clause.level).min().unwrap_or(Level::Must);
    let names: Vec<_> = clauses.iter().map(|clause| clause.id.as_str()).collect();
    let mut text = format!(
        "id: {}\ntitle: {}\nprofile: {}\nclauses: {}\nlevel: {}\n",
        arguments.id,
        arguments.title,
        ledger.profile,
        names.join(" "),
        level.keyword().to_lowercase()
    );
    let (line, config) = match like.or_else(|| usual(corpus, &ledger.profile)) {
        Some(trace) => front_lines(trace),
        None => ("line: 9600 8N1\n".to_owned(), String::new()),
    };
    text += &line;
    if like.is_some() {
        text += &config;
    }
    let _ = write!(text, "since: {}\norigin: hand-written\n---\n", ledger.revision);
    text += &like.map_or_else(|| EMPTY.to_owned(), given);
    text
}

/// The case of the profile whose line most cases have.
fn usual<'a>(corpus: &'a Corpus, profile: &str) -> Option<&'a Trace> {
    let mut by_line: BTreeMap<String, (usize, &Trace)> = BTreeMap::new();
    for case in corpus.list() {
        if let CaseSource::Trace(case) = case.source
            && case.trace.front.profile == profile
        {
            let (line, _) = front_lines(&case.trace);
            by_line.entry(line).or_insert((0, &case.trace)).0 += 1;
        }
    }
    by_line.into_values().max_by_key(|(count, _)| *count).map(|(_, trace)| trace)
}

/// Its line and its settings, as they stand in the file.
fn front_lines(trace: &Trace) -> (String, String) {
    let text = trace.format();
    let of = |key: &str| {
        text.lines()
            .find(|line| line.starts_with(key))
            .map_or_else(String::new, |line| format!("{line}\n"))
    };
    (of("line: "), of("config: "))
}

/// What another case gives to the plug-in; what is demanded there is left out.
fn given(trace: &Trace) -> String {
    let is_given = |entry: &Entry| entry.what.is_input() || matches!(entry.what, What::Quiet);
    let body = trace.body.iter().filter(|line| match line {
        Line::Entry(entry) => is_given(entry),
        _ => false,
    });
    let given = Trace { front: trace.front.clone(), body: body.cloned().collect() };
    let text = given.format();
    text.split_once("\n---\n").map_or_else(String::new, |(_, body)| body.to_owned())
}
