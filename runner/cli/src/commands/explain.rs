//! `softplug explain`: a case with its clauses, its trace and a picture.

use clap::Args;
use serde::Serialize;
use softplug_conformance::ledger::Clause;
use softplug_conformance::{Corpus, Source as CaseSource};
use softplug_report::Level;

use super::cases::Entry;
use crate::corpus::Source;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::guess::nearest;
use crate::picture::{Glyphs, picture};
use crate::screen::{HEADING, Screen};

/// Keys of the front matter without which a trace is not understood.
const TOLD: [&str; 4] = ["line: ", "config: ", "room: ", "modem: "];

/// Shows what a case demands and why: its clauses, a picture of it, and its trace.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug explain r3964.tx.late-dle
  softplug explain xon-xoff.tx.hold --json")]
pub(crate) struct Arguments {
    /// The case, by its id; a permutation behind a slash is left out
    case: String,
    /// Draw with plain ASCII characters
    #[arg(long)]
    ascii: bool,
    #[command(flatten)]
    corpus: Source,
}

#[derive(Serialize)]
struct Document<'a> {
    #[serde(flatten)]
    case: Entry<'a>,
    wording: Vec<Wording<'a>>,
    /// The whole file; of a script there is none.
    trace: Option<String>,
}

#[derive(Serialize)]
struct Wording<'a> {
    clause: &'a str,
    level: Level,
    sentence: &'a str,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let id = arguments.case.split('/').next().unwrap_or_default();
    let profile = id.split('.').next().unwrap_or_default();
    let corpus = arguments.corpus.load_for(profile, screen)?;
    let cases = corpus.list();
    let Some(case) = cases.iter().find(|case| case.id == id) else {
        let failure = Failure::usage(format_args!("there is no case \"{id}\""));
        return Err(match nearest(id, cases.iter().map(|case| case.id)) {
            Some(guess) => failure.hint(format_args!("did you mean \"{guess}\"?")),
            None => failure.hint("`softplug cases` lists them"),
        });
    };
    let trace = match case.source {
        CaseSource::Trace(case) => Some(case.trace.format()),
        _ => None,
    };
    let clauses: Vec<_> = case.clauses.iter().filter_map(|id| clause(&corpus, id)).collect();

    let (level, kind) = (case.level.keyword(), case.kind.name());
    screen.say(format_args!("{HEADING}{id}{HEADING:#}  {level}, {kind}\n{}\n", case.title));
    for clause in &clauses {
        screen.say(format_args!(
            "  {} ({}): {}",
            clause.id,
            clause.level.keyword(),
            clause.sentence
        ));
    }
    match trace.as_deref().and_then(|text| text.split_once("\n---\n")) {
        Some((front, body)) => {
            screen.say("");
            let told = front.lines().filter(|line| TOLD.iter().any(|key| line.starts_with(key)));
            told.for_each(|line| screen.say(format_args!("  {line}")));
            let glyphs = if arguments.ascii { Glyphs::ASCII } else { Glyphs::of_locale() };
            screen.say(format_args!("\n{}", picture(body.lines(), glyphs)));
            screen.say(format_args!("{HEADING}trace{HEADING:#}\n{}", body.trim_end()));
        }
        None => screen.say("\nA partner that reacts to the plug-in: there is no fixed course."),
    }
    let wording = clauses.iter().map(|clause| Wording {
        clause: &clause.id,
        level: clause.level,
        sentence: &clause.sentence,
    });
    let wording = wording.collect();
    screen.document(&Document { case: case.into(), wording, trace });
    Ok(Exit::Done)
}

fn clause<'a>(corpus: &'a Corpus, id: &str) -> Option<&'a Clause> {
    corpus.ledgers.iter().find_map(|ledger| ledger.clause(id))
}
