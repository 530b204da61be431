//! `softplug cases`: lists the cases of the corpus, or checks its ledgers.

use std::fs;
use std::path::Path;

use clap::Args;
use serde::Serialize;
use softplug_conformance::certify::matches;
use softplug_conformance::{Corpus, Listed, ledger, lint};
use softplug_report::{CaseKind, Level};

use crate::corpus::{REQUIREMENTS, Source};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::guess::nearest;
use crate::numbers;
use crate::screen::{BAD, GOOD, Screen};
use crate::table::Table;

/// Lists the cases that plug-ins are certified by.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug cases --profile r3964
  softplug cases \"*.late-*\" --json
  softplug cases --lint --corpus fixtures
  softplug cases --lint --fix")]
pub(crate) struct Arguments {
    /// Only cases whose id matches one of these; * and ? stand for anything
    #[arg(value_name = "GLOB")]
    globs: Vec<String>,
    /// Only cases of this profile
    #[arg(long, value_name = "PROFILE")]
    profile: Option<String>,
    /// Check the ledgers against the cases instead: clauses without a case, cases without a clause.
    /// In a project's folder, those of the project
    #[arg(long, conflicts_with_all = ["globs", "profile"])]
    lint: bool,
    /// Write the hash of each sentence that has none or another one into its ledger, before
    /// checking; look at the cases of those that it names
    #[arg(long, requires = "lint")]
    fix: bool,
    #[command(flatten)]
    corpus: Source,
}

/// A case as machines get it.
#[derive(Serialize)]
pub(super) struct Entry<'a> {
    id: &'a str,
    title: &'a str,
    profile: &'a str,
    level: Level,
    kind: CaseKind,
    since: u32,
    clauses: &'a [String],
}

impl<'a> From<&Listed<'a>> for Entry<'a> {
    fn from(case: &Listed<'a>) -> Self {
        let Listed { id, title, profile, level, kind, since, clauses, .. } = *case;
        Self { id, title, profile, level, kind, since, clauses }
    }
}

#[derive(Serialize)]
struct Listing<'a> {
    corpus: &'a str,
    cases: Vec<Entry<'a>>,
}

#[derive(Serialize)]
struct Linted<'a> {
    corpus: &'a str,
    /// Clauses whose hash was written.
    fixed: &'a [String],
    findings: Vec<String>,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    if arguments.lint {
        return lint(arguments, screen);
    }
    let corpus = match &arguments.profile {
        Some(profile) => arguments.corpus.load_begun_for(profile, screen)?,
        None => arguments.corpus.load_begun()?,
    };
    if let Some(profile) = &arguments.profile
        && corpus.ledger(profile).is_none()
    {
        return Err(no_profile(&corpus, profile));
    }
    let is_asked = |case: &Listed<'_>| {
        let of_profile = arguments.profile.as_ref().is_none_or(|profile| case.profile == profile);
        let globs = &arguments.globs;
        of_profile && (globs.is_empty() || globs.iter().any(|glob| matches(glob, case.id)))
    };
    let cases: Vec<_> = corpus.list().into_iter().filter(is_asked).collect();
    if cases.is_empty() {
        let what = format!("no case is called {}", arguments.globs.join(", "));
        return Err(Failure::new(Exit::NothingSelected, what)
            .hint("`softplug cases` without a pattern lists all"));
    }
    let mut table = Table::new(["case", "level", "kind", "since", "title"]);
    for case in &cases {
        let (level, kind) = (case.level.keyword(), case.kind.name());
        let [level, kind, title] = [level, kind, case.title].map(str::to_owned);
        table.row([case.id.to_owned(), level, kind, case.since.to_string(), title]);
    }
    screen.say(table);
    screen.note(numbers::things(cases.len() as u64, "case"));
    let cases = cases.iter().map(Entry::from).collect();
    screen.document(&Listing { corpus: &corpus.digest, cases });
    Ok(Exit::Done)
}

/// The profile is not in the corpus.
pub(super) fn no_profile(corpus: &Corpus, profile: &str) -> Failure {
    let names: Vec<_> = corpus.ledgers.iter().map(|ledger| &*ledger.profile).collect();
    let failure = Failure::usage(format_args!("there is no profile \"{profile}\""));
    match nearest(profile, names.iter().copied()) {
        Some(guess) => failure.hint(format_args!("did you mean \"{guess}\"?")),
        None => failure.hint(format_args!("there are {}", names.join(", "))),
    }
}

fn lint(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let folder = arguments.corpus.own_folder();
    let fixed = match folder {
        Some(folder) if arguments.fix => fix(folder, screen)?,
        None if arguments.fix => {
            return Err(Failure::usage("the ledgers in this command cannot be changed")
                .hint("give the folder that has yours: --corpus DIR"));
        }
        Some(_) | None => Vec::new(),
    };
    let corpus = match folder {
        Some(folder) => Corpus::begun(folder).map_err(Failure::usage)?,
        None => Corpus::embedded(),
    };
    let findings = lint::lint(&corpus.ledgers, &corpus);
    let findings: Vec<_> = findings.iter().map(ToString::to_string).collect();
    for finding in &findings {
        screen.say(finding);
    }
    let clauses: usize = corpus.ledgers.iter().map(|ledger| ledger.clauses.len()).sum();
    let (style, word) = if findings.is_empty() { (GOOD, "sound") } else { (BAD, "NOT SOUND") };
    screen.say(format_args!(
        "{style}{word}{style:#}: {}, {}, {}, {}",
        numbers::things(corpus.ledgers.len() as u64, "profile"),
        numbers::things(clauses as u64, "clause"),
        numbers::things(corpus.list().len() as u64, "case"),
        numbers::things(findings.len() as u64, "finding"),
    ));
    let exit = if findings.is_empty() { Exit::Done } else { Exit::Failed };
    screen.document(&Linted { corpus: &corpus.digest, fixed: &fixed, findings });
    Ok(exit)
}

/// Writes the hashes into the ledgers of a folder; the clauses that have another one now.
fn fix(folder: &Path, screen: &Screen) -> Result<Vec<String>, Failure> {
    let ledgers = folder.join(REQUIREMENTS);
    let unreadable =
        |error| Failure::usage(format_args!("{} cannot be read: {error}", ledgers.display()));
    let mut paths = Vec::new();
    for entry in fs::read_dir(&ledgers).map_err(unreadable)? {
        paths.push(entry.map_err(unreadable)?.path());
    }
    paths.retain(|path| path.extension().is_some_and(|end| end == "toml"));
    paths.sort();
    let mut fixed = Vec::new();
    for path in paths {
        let text = files::read_text(&path)?;
        let hashed = ledger::hashed(&path, &text).map_err(Failure::usage)?;
        if hashed.clauses.is_empty() {
            continue;
        }
        if path.is_symlink() {
            let path = path.display();
            return Err(Failure::usage(format_args!(
                "{path} is a link, and is not written through"
            )));
        }
        files::replace(&path, hashed.text.as_bytes())?;
        for clause in &hashed.clauses {
            screen.say(format_args!("{}: hash of {clause} written", path.display()));
        }
        fixed.extend(hashed.clauses);
    }
    Ok(fixed)
}
