//! `softplug dev`.

mod further;
mod line;
mod watch;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use serde::Serialize;
use softplug_conformance::Summary;

use self::line::Line;
use self::watch::Changes;
use softplug_live::store::Inbox;

use crate::commands::build::{Built, Project, build};
use crate::commands::dev::Arguments;
use crate::commands::link;
use crate::commands::replay;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::{self, no_folder};
use crate::numbers;
use crate::plugin::{Chosen, as_word};
use crate::screen::{BAD, GOOD, Screen};
use crate::stop;

/// How often Ctrl-C is looked for.
const TICK: Duration = Duration::from_millis(50);

/// What came of a save, for machines.
#[derive(Default, Serialize)]
struct Round {
    result: &'static str,
    /// From the save until all was done.
    seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    sha256: Option<String>,
    passed: usize,
    failed: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
}

/// A plug-in for the link in this process, and since when it is waited for.
struct Ready {
    plugin: Chosen,
    round: Round,
    since: Instant,
}

pub(crate) fn run(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let project = Project::find(&arguments.project)?;
    let changes = Changes::watch(&project)?;
    let data = arguments.send.as_deref().map(files::read).transpose()?;
    let inbox = arguments
        .keep
        .as_ref()
        .map(|keep| Inbox::new(keep).map_err(|error| no_folder(keep, &error)));
    let inbox = inbox.transpose()?;
    let stop = stop::on_signals()?;
    let (to, ready) = channel();
    let broken_off = changes.news();
    thread::scope(|scope| {
        let session = Session { arguments, project: &project, screen, stop: &stop, to };
        scope.spawn(move || session.run(&changes));
        match &arguments.port {
            Some(port) => Line::new(port, arguments, data, inbox, screen).run(&ready, &stop),
            None => wait(&stop),
        }
        broken_off.store(true, Ordering::Relaxed);
    });
    Ok(Exit::Done)
}

fn wait(stop: &AtomicBool) {
    while !stop.load(Ordering::Relaxed) {
        thread::sleep(TICK);
    }
}

/// What is waited for with one eye on Ctrl-C; none at the end.
fn next<T>(from: &Receiver<T>, stop: &AtomicBool) -> Option<T> {
    while !stop.load(Ordering::Relaxed) {
        match from.recv_timeout(TICK) {
            Ok(thing) => return Some(thing),
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return None,
        }
    }
    None
}

/// Builds and replays, on a thread of its own: a link on a port does not wait.
struct Session<'a> {
    arguments: &'a Arguments,
    project: &'a Project,
    screen: &'a Screen,
    stop: &'a AtomicBool,
    to: Sender<Ready>,
}

impl Session<'_> {
    /// Once at the start, then after each save.
    fn run(&self, changes: &Changes) {
        let mut since = Instant::now();
        let news = changes.news();
        loop {
            let (mut round, built) = self.round(since);
            if let Some(round) = &mut round {
                round.seconds = since.elapsed().as_secs_f64();
                self.screen.json_line(round);
            }
            if let Some(built) = built {
                further::look(&built, self.project.root(), &news, self.screen);
            }
            match changes.next(self.stop) {
                Some(at) => since = at,
                None => return,
            }
        }
    }

    /// Builds, replays and swaps; no round where the link in this process tells the rest. What was
    /// built, if it does what its traces demand.
    fn round(&self, since: Instant) -> (Option<Round>, Option<Built>) {
        let failed = |result, failure: Failure| {
            self.screen.report_failure(&failure);
            let message = Some(failure.message);
            (Some(Round { result, message, ..Round::default() }), None)
        };
        let built = match build(self.project, None) {
            Ok(built) => built,
            Err(failure) => return failed("not-built", failure),
        };
        let sha256 = Some(built.plugin.digest().to_string());
        let plugin = Chosen::Sandboxed(built.plugin.clone());
        let replayed = replay::quick(&plugin, &self.project.root().join("traces"));
        let summary = match replayed {
            Ok(summary) => summary,
            Err(failure) => return failed("no-traces", failure),
        };
        let mut round = Round { result: "passed", sha256, ..Round::default() };
        match &summary {
            Some(summary) => {
                (round.passed, round.failed) = (summary.passed, summary.failed);
                self.show(summary, &built, since);
            }
            None => self.screen.note("there are no traces for a profile that the manifest claims"),
        }
        if round.failed > 0 {
            round.result = "diverged";
            if !self.arguments.anyway {
                return (Some(round), None);
            }
        }
        if self.arguments.port.is_some() {
            // It ends only with this sender.
            let is_good = round.failed == 0;
            let _ = self.to.send(Ready { plugin, round, since });
            return (None, is_good.then_some(built));
        }
        if let Some(link) = &self.arguments.link {
            match self.swap_into(link, &built) {
                Ok(text) => {
                    let took = numbers::span(since.elapsed());
                    self.screen
                        .say(format_args!("{GOOD}swapped{GOOD:#}: {text}, {took} after the save"));
                    round.result = "swapped";
                }
                Err(failure) => {
                    self.screen.report_failure(&failure);
                    round.result = "not-swapped";
                    round.message = Some(failure.message);
                }
            }
        }
        let is_good = round.failed == 0;
        (Some(round), is_good.then_some(built))
    }

    /// The first divergence, and how many there are.
    fn show(&self, summary: &Summary, built: &Built, since: Instant) {
        if let Some(first) = summary.cases.iter().find(|verdict| !verdict.is_passed()) {
            let plugin = as_word(&built.file.display().to_string());
            let text = first.to_string().replace("replay PLUGIN", &format!("replay {plugin}"));
            self.screen.say(text);
        }
        let (style, word) = if summary.failed == 0 { (GOOD, "passed") } else { (BAD, "FAILED") };
        self.screen.say(format_args!(
            "{style}{word}{style:#}: {} of {} passed, {} after the save",
            numbers::count(summary.passed as u64),
            numbers::things(summary.total as u64, "case"),
            numbers::span(since.elapsed())
        ));
    }

    fn swap_into(&self, link: &str, built: &Built) -> Result<String, Failure> {
        let digest = built.plugin.digest();
        let plugin = format!("{}@sha256:{digest}", built.plugin.manifest().name);
        let Arguments { remote, settings, .. } = self.arguments;
        link::swap_in(remote, link, &plugin, &built.module, settings)
    }
}
