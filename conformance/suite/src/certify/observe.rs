//! What a plug-in was seen to do in single runs, as traces.

use super::engines::Loaded;
use super::options::CertifyOptions;
use crate::corpus::{Corpus, Source};
use crate::given::case::Case;
use crate::judge::run::Judge;
use crate::random::SessionGroup;
use crate::run::permute::Permutation;
use crate::run::subject::Sandboxed;
use crate::run::transcript;
use crate::script::Script;
use softplug_abi::Micros;
use softplug_trace::Line;

/// The observed timeline of one run.
///
/// The example of [`observe`] shows one.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ObservedRun {
    /// The run: `xon-xoff.tx.hold/cut:1`.
    pub run: String,
    /// A trace whose expectations are what was observed. What cannot stand in one is a comment.
    pub text: String,
}

/// Runs single runs again, as a report's failures name them, and writes down what the plug-in does.
/// Runs that do not exist, and a module that cannot be judged, give nothing.
///
/// ```
/// use softplug_conformance::Corpus;
/// use softplug_conformance::certify::{CertifyOptions, Loaded, observe};
///
/// # let module = wat::parse_file("../../fixtures/abi/echo.wat")?;
/// // A plug-in that sends back what it receives: here XOFF and XON.
/// let runs = ["xon-xoff.rx.break-idle/uncut", "xon-xoff.none/uncut"];
/// let loaded = Loaded::new(&module)?;
/// let observed = observe(&loaded, &Corpus::embedded(), runs, &CertifyOptions::new("abi"));
/// assert_eq!(observed.len(), 1, "there is no other such run");
/// assert_eq!(observed[0].run, runs[0]);
/// assert!(observed[0].text.contains("# observed in the run uncut"));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn observe<'a>(
    loaded: &Loaded<'_>,
    corpus: &Corpus,
    runs: impl IntoIterator<Item = &'a str>,
    options: &CertifyOptions,
) -> Vec<ObservedRun> {
    let Some(subjects) = loaded.subjects() else { return Vec::new() };
    let list = corpus.list();
    let observed = runs.into_iter().filter_map(|run| {
        let (id, name) = run.rsplit_once('/')?;
        let listed = list.iter().find(|listed| listed.id == id)?;
        let (subject, name) = match name {
            name if name == subjects.second_run => (&subjects.second, "uncut"),
            name => (&subjects.first, name),
        };
        let text = match listed.source {
            Source::Trace(case) => of_trace(subject, case, &name.parse().ok()?, options.cut_seed),
            Source::Script(script) => of_script(subject, script),
            Source::Sessions(group) => {
                of_session(subject, group, options.sessions.seed, name.parse().ok()?)?
            }
        };
        Some(ObservedRun { run: run.to_owned(), text })
    });
    observed.collect()
}

/// A script has no trace: its log, line by line.
fn of_script(subject: &Sandboxed, script: &Script) -> String {
    let run = Judge::run_script(subject, script);
    let mut text = format!("# {}: {}\n", script.id, script.title);
    for line in &run.log {
        text.push_str(line);
        text.push('\n');
    }
    if let Some(failure) = &run.failure {
        for line in failure.to_string().lines() {
            text.push_str("# ");
            text.push_str(line);
            text.push('\n');
        }
    }
    text
}

fn of_session(subject: &Sandboxed, group: &SessionGroup, seed: u64, number: u64) -> Option<String> {
    let run = group.session(subject, seed, number)?;
    Some(group.failed(subject, run, number).trace.format())
}

fn of_trace(subject: &Sandboxed, case: &Case, permutation: &Permutation, cut_seed: u64) -> String {
    let outcome = Judge::run(subject, case, permutation, cut_seed);
    let mut trace = transcript::observed(case, Judge::manifest(subject), &outcome.seen);
    let mut comment = |text: String| {
        // A comment ends with its line.
        let text = text.chars().map(|c| if c.is_control() { ' ' } else { c }).collect();
        trace.body.push(Line::Comment(text));
    };
    comment(format!(" observed in the run {permutation}"));
    if let Some(fault) = &outcome.fault {
        let (at, class) = (Micros(fault.at_us), fault.class.text());
        comment(format!(" {at}: the plug-in {class}: {}", fault.message));
    }
    trace.format()
}
