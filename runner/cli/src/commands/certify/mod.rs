//! `softplug certify`: a verdict on a plug-in that others can reproduce.

pub(super) mod explored;
pub(super) mod files;
pub(super) mod score;
mod show;

#[cfg(target_os = "linux")]
pub(crate) use show::place_text;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use softplug_conformance::certify::{
    Baseline, CertifyError, CertifyOptions, Loaded, Progress, certify, observe,
};
use softplug_conformance::score::ScoreOptions;
use softplug_conformance::{Corpus, Sessions};
use softplug_explore::Bounds;
use softplug_report::attest::{self, PrivateKey};
use softplug_report::{Report, VerdictKind, annotations};

use self::files::Folder;
use self::score::Sample;
use super::amount::Amount;
use crate::corpus;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files as disk;
use crate::plugin::Library;
use crate::screen::Screen;
use crate::stop;

/// Failed cases whose observed course is written down.
const OBSERVED: usize = 100;

/// Runs all cases of a profile against a plug-in and writes the verdict with its grounds.
///
/// Every case also runs with its bytes cut differently, behind other cases, at later times, in
/// other rooms, saved and restored in the middle, and under a second engine; random sessions are
/// held to the profile's model. Two runs give the same reports to the byte.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  softplug certify my-plugin.wasm --profile xon-xoff --out report
  softplug certify r3964 --profile rk512 --strict --annotations --out report
  softplug certify my-plugin.wasm --profile r3964 --case \"r3964.tx.*\" --out report
  softplug certify my-plugin.wasm --profile r3964 --random 1h --seed 7 --out report
  softplug certify my-plugin.wasm --profile r3964 --explore 2 --out report
  softplug certify my-plugin.wasm --profile r3964 --score 1000 --out report
  softplug certify my-plugin.wasm --profile abi --key key.pem --out report")]
pub(crate) struct Arguments {
    /// The plug-in: a .wasm file, or a name to look up
    plugin: String,
    #[command(flatten)]
    library: Library,
    /// The profile to judge it by; `softplug cases` shows which there are
    #[arg(long, value_name = "PROFILE")]
    profile: String,
    /// Folder for the reports, made if it is missing; without it the verdict is only printed
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// A failed SHOULD counts as a failed MUST, and places that nothing executed make the verdict partial
    #[arg(long)]
    strict: bool,
    /// Failures that are expected, each with its reason (TOML)
    #[arg(long, value_name = "FILE")]
    baseline: Option<PathBuf>,
    /// Only cases whose id matches; * and ? stand for anything; the verdict is then partial at best
    #[arg(long = "case", value_name = "GLOB")]
    cases: Vec<String>,
    /// Score the cases up to this revision of the profile; later ones run unscored
    #[arg(long, value_name = "N")]
    revision: Option<u32>,
    /// Random sessions against the profile's model, or for about how long (such as 1h); fewer than
    /// the profile needs make the verdict partial
    #[arg(long, value_name = "N|SPAN")]
    random: Option<Amount>,
    /// Seed of the random sessions
    #[arg(long, value_name = "S")]
    seed: Option<u64>,
    /// Change the module one instruction at a time, so many of them or `all`, and count the changes that are
    /// noticed: how much the profiles that it claims hold of it
    #[arg(long, value_name = "N|all", num_args = 0..=1, default_missing_value = "300")]
    score: Option<Sample>,
    /// Try everything that may happen with at most so many faults, as `softplug explore` does, and
    /// hold it against the verdict
    #[arg(long, value_name = "K", num_args = 0..=1, default_missing_value = "1", value_parser = clap::value_parser!(u8).range(0..=8))]
    explore: Option<u8>,
    /// Sign the result with this Ed25519 private key (PEM)
    #[arg(long, value_name = "FILE", requires = "out")]
    key: Option<PathBuf>,
    /// Print failures as annotations for GitHub
    #[arg(long)]
    annotations: bool,
    /// Threads to run on
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    threads: Option<u16>,
    #[command(flatten)]
    corpus: corpus::Source,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    // All that can be wrong is found before the work begins.
    let module = arguments.library.read(&arguments.plugin)?;
    let corpus = arguments.corpus.load_for(&arguments.profile, screen)?;
    let baseline = arguments.baseline.as_deref().map(read_baseline).transpose()?;
    let key = arguments.key.as_deref().map(read_key).transpose()?;
    if arguments.explore.is_some() {
        explored::can_be_explored(&arguments.profile)?;
    }
    // Before anything is made: whoever sees the folder can end the run cleanly.
    let stop = stop::on_signals()?;
    let folder = arguments.out.as_deref().map(Folder::make).transpose()?;
    let loaded = Loaded::new(&module).map_err(certify_failure)?;
    let profile = CertifyOptions::new(&arguments.profile);
    let threads = arguments.threads.map_or(profile.threads, usize::from);
    let count = match arguments.random {
        None => profile.sessions.count,
        Some(Amount::Count(count)) => count,
        Some(Amount::For(time)) => loaded
            .sessions_within(&corpus, &arguments.profile, time, threads)
            .map_err(|error| Failure::new(Exit::PlugIn, error))?,
    };
    let options = CertifyOptions {
        sessions: Sessions { count, seed: arguments.seed.unwrap_or(profile.sessions.seed) },
        revision: arguments.revision,
        strict: arguments.strict,
        cases: arguments.cases.clone(),
        baseline,
        threads,
        ..profile
    };
    if let Some(folder) = &folder {
        folder.clear()?;
    }
    let mut report = certified(&loaded, &corpus, &options, &stop, screen)?;
    let mut is_whole = true;
    if let Some(faults) = arguments.explore {
        let bounds = Bounds { faults, threads, ..Bounds::default() };
        is_whole = explored::explored(&mut report, &module, &bounds, &stop, screen)?;
    }
    if let Some(sample) = arguments.score {
        let asked = ScoreOptions {
            sample: sample.count(),
            seed: options.sessions.seed,
            threads,
            ..ScoreOptions::default()
        };
        report.score = score::scored(&report, &module, &corpus, &asked, &stop, screen)?;
        is_whole &= report.score.is_some() || !stop.load(Ordering::Relaxed);
    }
    if let Some(folder) = &folder {
        let attestation = key.as_ref().map(|key| sign(&report, key)).transpose()?;
        let runs = report.cases.iter().filter_map(|case| case.failures.first());
        let runs: Vec<_> = runs.take(OBSERVED).map(|failure| failure.run.as_str()).collect();
        let observed = observe(&loaded, &corpus, runs, &options);
        folder.write(&report, &observed, attestation.as_deref())?;
    }

    if arguments.annotations {
        Screen::raw(annotations::write(&report).as_bytes());
    }
    let corpus = arguments.corpus.named();
    let named = show::Named { plugin: &arguments.plugin, corpus: corpus.as_deref() };
    show::report(&report, &named, folder.as_ref(), screen);
    screen.document(&report);
    Ok(match exit(report.verdict) {
        Exit::Done if !is_whole => Exit::Incomplete,
        exit => exit,
    })
}

/// Runs the certification with a progress bar. `stop` ends it, and the report says so.
pub(super) fn certified(
    loaded: &Loaded<'_>,
    corpus: &Corpus,
    options: &CertifyOptions,
    stop: &AtomicBool,
    screen: &Screen,
) -> Result<Report, Failure> {
    let bar = bar("cases", screen);
    let progress = |progress: Progress| {
        bar.set_length(progress.cases as u64);
        bar.set_position(progress.done as u64);
        if progress.failed > 0 {
            bar.set_message(format!("{} failed", progress.failed));
        }
    };
    let certified = certify(loaded, corpus, options, &progress, stop);
    bar.finish_and_clear();
    certified.map_err(certify_failure)
}

fn bar(things: &str, screen: &Screen) -> ProgressBar {
    if !screen.shows_progress() {
        return ProgressBar::hidden();
    }
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    let template = format!("[{{bar:24}}] {{pos}} of {{len}} {things}  {{msg}}");
    let style = ProgressStyle::with_template(&template);
    bar.with_style(style.expect("the template is sound").progress_chars("=> "))
}

pub(super) fn read_baseline(path: &Path) -> Result<Baseline, Failure> {
    Baseline::read(path).map_err(Failure::usage)
}

fn read_key(path: &Path) -> Result<PrivateKey, Failure> {
    PrivateKey::read(path, &disk::read_text(path)?).map_err(Failure::usage)
}

fn sign(report: &Report, key: &PrivateKey) -> Result<String, Failure> {
    attest::sign(report, key).map_err(Failure::internal)
}

pub(super) fn certify_failure(error: CertifyError) -> Failure {
    match &error {
        CertifyError::UnknownProfile { .. } => {
            Failure::usage(error).hint("`softplug cases` shows which cases each has")
        }
        CertifyError::UnknownRevision { .. } | CertifyError::UnknownClause { .. } => {
            Failure::usage(error)
        }
        CertifyError::NothingSelected { .. } => Failure::new(Exit::NothingSelected, error),
        _ => Failure::internal(error),
    }
}

/// Of a verdict.
pub(super) const fn exit(verdict: VerdictKind) -> Exit {
    match verdict {
        VerdictKind::Conformant | VerdictKind::ConformantWithWarnings => Exit::Done,
        VerdictKind::NotConformant => Exit::Failed,
        VerdictKind::NotJudged => Exit::PlugIn,
        VerdictKind::Partial => Exit::Incomplete,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_of_the_suite_is_nobody_elses() {
        let (profile, case) = ("3964".to_owned(), "3964.tx.hold".to_owned());
        let (first, second) = ("wasmtime".to_owned(), "wasmi".to_owned());
        let errors = [
            (CertifyError::EnginesDiffer { case, first, second }, Exit::Internal),
            (CertifyError::Internal("no memory".to_owned()), Exit::Internal),
            (CertifyError::NothingSelected { profile: profile.clone() }, Exit::NothingSelected),
            (CertifyError::UnknownRevision { profile, revision: 2, newest: 1 }, Exit::Usage),
        ];
        for (error, expected) in errors {
            assert_eq!(certify_failure(error).exit, expected);
        }
    }

    #[test]
    fn every_verdict_has_its_code() {
        let codes = [
            (VerdictKind::Conformant, 0),
            (VerdictKind::ConformantWithWarnings, 0),
            (VerdictKind::NotConformant, 1),
            (VerdictKind::NotJudged, 3),
            (VerdictKind::Partial, 5),
        ];
        for (verdict, code) in codes {
            assert_eq!(exit(verdict).code(), code, "{verdict:?}");
        }
    }
}
