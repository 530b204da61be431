//! `softplug verify`: runs a certification again and compares.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use serde::Serialize;
use softplug_conformance::Sessions;
use softplug_conformance::certify::{CertifyOptions, Loaded};
use softplug_conformance::score::ScoreOptions;
use softplug_explore::Bounds;
use softplug_report::attest::{self, PublicKey, Source, VerifyError};
use softplug_report::{Difference, Report, compare, fuel_is_comparable, json};

use super::certify::explored::explored;
use super::certify::score::scored;
use super::certify::{certified, certify_failure, files::ATTESTATION, read_baseline};
use crate::corpus;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::plugin::Library;
use crate::screen::{BAD, GOOD, Screen};
use crate::stop;

/// Runs the certification that a report tells of again, and compares.
///
/// With a key, the attestation beside the report must be signed with it, and say what the report
/// says.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug verify report/conformance.json my-plugin.wasm
  softplug verify report/conformance.json my-plugin.wasm --key public.pem")]
pub(crate) struct Arguments {
    /// The report: the conformance.json that `softplug certify` wrote
    report: PathBuf,
    /// The plug-in: a .wasm file, or a name to look up
    plugin: String,
    #[command(flatten)]
    library: Library,
    /// The public key (PEM) that the attestation must be signed with
    #[arg(long, value_name = "FILE")]
    key: Option<PathBuf>,
    /// The attestation, if it is not the attestation.json beside the report
    #[arg(long, value_name = "FILE", requires = "key")]
    attestation: Option<PathBuf>,
    /// The baseline that the report was made with, if it names one
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
    /// Take the report as reproduced although it names another engine, under which fuel counts
    /// otherwise
    #[arg(long)]
    without_fuel: bool,
    #[command(flatten)]
    corpus: corpus::Source,
}

#[derive(Serialize)]
struct Document<'a> {
    reproduced: bool,
    fuel_compared: bool,
    verdict: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    signed: Option<String>,
    differences: Vec<Told<'a>>,
}

#[derive(Serialize)]
struct Told<'a> {
    field: &'a str,
    sentence: &'a str,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let text = files::read_text(&arguments.report)?;
    let report = json::read(&arguments.report, &text).map_err(Failure::usage)?;
    let signed = arguments.key.as_deref().map(|key| signed(arguments, key, &text)).transpose()?;
    let module = arguments.library.read(&arguments.plugin)?;
    let corpus = arguments.corpus.load_for(&report.profile.name, screen)?;
    let baseline = arguments.baseline.as_deref().map(read_baseline).transpose()?;
    if report.selection.baseline.is_some() && baseline.is_none() {
        return Err(Failure::usage("the report was made with a baseline, and none is given")
            .hint("give the same file with --baseline"));
    }
    let options = CertifyOptions {
        revision: Some(report.profile.revision),
        strict: report.selection.strict,
        cases: report.selection.cases.clone(),
        baseline,
        sessions: Sessions { count: report.selection.sessions, seed: report.selection.seed },
        ..CertifyOptions::new(&report.profile.name)
    };
    let stop = stop::on_signals()?;
    let loaded = Loaded::new(&module).map_err(certify_failure)?;
    let mut again = certified(&loaded, &corpus, &options, &stop, screen)?;
    ended(&stop)?;
    if let Some(before) = &report.explored {
        let threads = options.threads;
        let bounds = Bounds { faults: before.faults, threads, ..Bounds::default() };
        explored(&mut again, &module, &bounds, &stop, screen)?;
        ended(&stop)?;
    }
    if let Some(score) = &report.score {
        let sample = (score.tried < score.changes).then_some(score.tried);
        let asked = ScoreOptions {
            sample,
            seed: score.seed,
            sessions: score.sessions,
            ..ScoreOptions::default()
        };
        again.score = scored(&again, &module, &corpus, &asked, &stop, screen)?;
        ended(&stop)?;
    }
    let differences = compare(&report, &again);
    show(&report, &again, signed.as_deref(), &differences, screen);
    // A report can name any engine: that must not be a way around the figures.
    let all_compared = fuel_is_comparable(&report, &again) || arguments.without_fuel;
    Ok(match (differences.is_empty(), all_compared) {
        (true, true) => Exit::Done,
        (true, false) => Exit::Incomplete,
        (false, _) => Exit::Failed,
    })
}

/// What was ended says nothing of the report.
fn ended(stop: &AtomicBool) -> Result<(), Failure> {
    if stop.load(Ordering::Relaxed) {
        let why = "ended before all was run again: whether the report is right is not known";
        return Err(Failure::new(Exit::Incomplete, why));
    }
    Ok(())
}

/// The id of the key that has signed the report.
fn signed(arguments: &Arguments, key: &Path, report: &str) -> Result<String, Failure> {
    let key = PublicKey::read(key, &files::read_text(key)?).map_err(Failure::usage)?;
    let beside = || arguments.report.with_file_name(ATTESTATION);
    let file = arguments.attestation.clone().unwrap_or_else(beside);
    let text = files::read_text(&file)?;
    let envelope = Source { file: &file, text: &text };
    let report = Source { file: &arguments.report, text: report };
    attest::verify(envelope, report, &key).map_err(|error| match error {
        VerifyError::TooLarge { .. } | VerifyError::Malformed { .. } | VerifyError::Report(_) => {
            Failure::usage(error)
        }
        error => Failure::new(Exit::Failed, error),
    })?;
    Ok(key.id())
}

fn show(
    report: &Report,
    again: &Report,
    signed: Option<&str>,
    differences: &[Difference],
    screen: &Screen,
) {
    for difference in differences {
        screen.say(format_args!("  {difference}"));
    }
    if differences.is_empty() {
        let verdict = report.verdict.text();
        let part = if fuel_is_comparable(report, again) { "" } else { " but for its fuel" };
        screen.say(format_args!("{GOOD}reproduced{GOOD:#}{part}: {verdict}; {}", report.reason));
    } else {
        screen.say(format_args!("{BAD}NOT REPRODUCED{BAD:#}: the report says something else"));
    }
    if let Some(key) = signed {
        screen.say(format_args!("signed with the key {key}"));
    }
    if !fuel_is_comparable(report, again) {
        screen.note(format_args!(
            "fuel is not compared: {} measured it, so the report says, and here it is {}; verify \
             with the command that made it, or say --without-fuel",
            report.suite.engine.escape_debug(),
            again.suite.engine
        ));
    }
    let told =
        differences.iter().map(|Difference { field, sentence }| Told { field, sentence }).collect();
    screen.document(&Document {
        reproduced: differences.is_empty(),
        fuel_compared: fuel_is_comparable(report, again),
        verdict: report.verdict.text(),
        signed: signed.map(str::to_owned),
        differences: told,
    });
}
