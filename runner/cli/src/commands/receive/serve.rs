//! `softplug receive --dir`: all that comes into a folder, and out of another
//! what machines ask for.

use std::io;
use std::path::PathBuf;
use std::time::Duration;

use serde::Serialize;
use softplug_abi::Failure as Why;
use softplug_abi::manifest::{Kind, Manifest};
use softplug_catalogue::{HEAD_BYTES, Notations, is_same_program};
use softplug_live::store::{Inbox, Mark, Shelf, copy_at_one_moment};
use softplug_live::transfer::{
    self, Delivered, JobReport, News, Program, Reply, Request, SendOutcome, ServeEnd, ServeHandler,
    ServeOptions, ServeReport,
};
use softplug_trial::reason;

use super::transfer::{AWAITED, nothing_came};
use super::{Arguments, Folders, Prepared};
use crate::commands::send::{StatusDocument, check_message};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::live::progress::Bar;
use crate::live::{say_notes, station, transfer_failure_at};
use crate::numbers;
use crate::screen::Screen;
use crate::stop;

/// The request by which a machine asks for a program.
const PROGRAM: &str = "program";
/// The field of it with the program's name.
const NAME: &str = "name";

/// A line for machines.
#[derive(Serialize)]
#[serde(tag = "event", rename_all = "kebab-case")]
enum Line<'a> {
    Delivery {
        result: &'static str,
        bytes: u64,
        seconds: f64,
        file: Option<String>,
        name: Option<&'a str>,
        failure: Option<&'a str>,
        #[serde(skip_serializing_if = "Option::is_none")]
        status: Option<StatusDocument>,
        message: Option<String>,
    },
    Request {
        kind: &'a str,
        fields: serde_json::Map<String, serde_json::Value>,
        refused: Option<&'a str>,
    },
    Job {
        program: &'a str,
        result: &'static str,
        sent: u64,
        seconds: f64,
        #[serde(skip_serializing_if = "Option::is_none")]
        status: Option<StatusDocument>,
        message: Option<String>,
    },
    Note {
        level: &'static str,
        code: u16,
        text: &'a str,
    },
    End {
        result: &'static str,
        complete: u64,
        failed: u64,
        sent: u64,
        not_sent: u64,
        refused: u64,
        /// Bytes that came, whatever they were.
        heard: u64,
    },
}

pub(crate) fn serve(
    arguments: &Arguments,
    folders: Folders,
    prepared: Prepared,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let Prepared { plugin, settings } = prepared;
    let stop = stop::on_signals()?;
    let mut station = station(&arguments.port, &arguments.link, &plugin, settings, true, screen)?;
    let Folders { inbox, shelf, notations } = folders;
    screen.note(AWAITED);
    let bar = Bar::new(None, screen);
    let mut counter = Counter {
        inbox,
        shelf,
        notations,
        head: Vec::new(),
        unwritten: None,
        manifest: plugin.manifest(),
        bar: &bar,
        screen,
    };
    let options = ServeOptions {
        give_up_after: arguments.wait.map(|seconds| Duration::from_secs(u64::from(seconds))),
        deliveries: arguments.count,
    };
    let served = transfer::serve(&mut station, &mut counter, &options, &stop, &mut |progress| {
        bar.show(progress);
    });
    bar.end();
    let dir = arguments.dir.as_deref();
    let report = served.map_err(|error| transfer_failure_at(error, dir, dir))?;
    let (exit, result, message) = verdict(&report, arguments.count, plugin.manifest());
    let ServeReport { complete, failed, sent, not_sent, refused, heard, .. } = report;
    screen.json_line(&Line::End { result, complete, failed, sent, not_sent, refused, heard });
    if let Some(message) = message {
        screen.error(message);
    }
    screen.say(summary(&report));
    Ok(exit)
}

/// Ctrl-C is how this usually ends: what counts is what became of what came, and whether that is
/// as much as was asked for.
fn verdict(
    report: &ServeReport,
    count: Option<u64>,
    manifest: &Manifest,
) -> (Exit, &'static str, Option<String>) {
    let has_failures = report.failed + report.not_sent > report.aborted;
    let came = report.complete + report.failed;
    match (report.end, count) {
        (ServeEnd::Gone, _) => (Exit::Port, "gone", Some("the port is gone".to_owned())),
        (ServeEnd::Idle, _) if came + report.sent == 0 => {
            (Exit::Incomplete, "nothing-came", Some(nothing_came(report.heard, manifest)))
        }
        _ if has_failures => (Exit::Failed, "failed", None),
        (_, Some(count)) if came < count => {
            let (came, all) = (numbers::count(came), numbers::count(count));
            let message = format!("only {came} of the {all} that were asked for came");
            (Exit::Incomplete, "incomplete", Some(message))
        }
        _ if report.aborted > 0 => (Exit::Incomplete, "aborted", None),
        _ => (Exit::Done, "done", None),
    }
}

fn summary(report: &ServeReport) -> String {
    let mut parts = vec![format!("{} received", numbers::count(report.complete))];
    let more = [
        (report.failed, "failed"),
        (report.sent, "sent"),
        (report.not_sent, "not sent"),
        (report.refused, "refused"),
    ];
    let more = more.into_iter().filter(|(count, _)| *count > 0);
    parts.extend(more.map(|(count, what)| format!("{} {what}", numbers::count(count))));
    parts.join(", ")
}

/// Takes and hands out.
struct Counter<'a> {
    inbox: Inbox,
    shelf: Option<Shelf>,
    /// How programs say their names.
    notations: Notations,
    /// The beginning of what comes.
    head: Vec<u8>,
    /// Why the delivery under way is not written.
    unwritten: Option<String>,
    manifest: &'a Manifest,
    bar: &'a Bar<'a>,
    screen: &'a Screen,
}

impl Counter<'_> {
    fn kind(&self, request: &Request) -> Option<&Kind> {
        self.manifest.requests.get(usize::from(request.kind))
    }

    /// The program that is asked for, or why it cannot be had.
    fn program(&self, request: &Request) -> Result<Program, Why> {
        let kind = self.kind(request).filter(|kind| kind.name == PROGRAM);
        let (kind, shelf) = kind.zip(self.shelf.as_ref()).ok_or(Why::NotSupported)?;
        let fields = kind.assignments(&request.fields);
        let name = fields.iter().find(|(field, _)| field == NAME).map(|(_, name)| name.as_str());
        let name = name.ok_or(Why::NotFound)?;
        let path = match shelf.find(name).map_err(|error| refusal(&error))? {
            Some(path) => path,
            None => self.find_by_text(shelf, name)?,
        };
        // As it is now: the machine must not get half of what somebody is about to save.
        let mut file = tempfile::tempfile().map_err(|error| refusal(&error))?;
        let copied = copy_at_one_moment(&path, &mut file).map_err(|error| refusal(&error))?;
        let size = copied.ok_or_else(|| {
            self.error(format_args!("{} is being written: it is not sent", path.display()));
            Why::Busy
        })?;
        let job_kind = self.manifest.job_kind("send").ok_or(Why::NotSupported)?;
        let mut program = Program::new(path.display().to_string(), job_kind, Box::new(file));
        program.size = Some(size);
        program.check = self.manifest.needs.check_pass;
        Ok(program)
    }

    /// The program that says in its text that it is called so; none if two do.
    fn find_by_text(&self, shelf: &Shelf, name: &str) -> Result<PathBuf, Why> {
        let mut is_it = |head: &[u8]| {
            self.notations.name_in(head).is_some_and(|said| is_same_program(&said, name))
        };
        let found = shelf.find_by_text(HEAD_BYTES, &mut is_it);
        let mut found = found.map_err(|error| refusal(&error))?;
        if let [one, other, ..] = &found[..] {
            self.error(format_args!(
                "more than one program is called {} in its text: {} and {}; rename the file of the \
                 right one so, or take the others away",
                name.escape_debug(),
                one.display(),
                other.display()
            ));
            return Err(Why::NotFound);
        }
        found.pop().ok_or(Why::NotFound)
    }

    /// Remembers why something was not written.
    fn written(&mut self, written: io::Result<()>) -> io::Result<()> {
        if let Err(error) = &written {
            self.unwritten.get_or_insert_with(|| error.to_string());
        }
        written
    }

    fn say(&self, text: impl std::fmt::Display) {
        self.bar.aside(|| self.screen.say(text));
    }

    fn error(&self, text: impl std::fmt::Display) {
        self.bar.aside(|| self.screen.error(text));
    }

    fn answered(&self, request: &Request, refused: Option<Why>) {
        let Some(kind) = self.kind(request) else { return };
        let fields = kind.assignments(&request.fields);
        let shown: Vec<_> =
            fields.iter().map(|(name, value)| format!("{name}={}", value.escape_debug())).collect();
        let what = format!("the machine asks: {} {}", kind.name, shown.join(" "));
        match refused {
            None => self.say(&what),
            Some(failure) => self.error(format_args!("{what}; refused: {}", failure.text())),
        }
        let fields = fields.into_iter().map(|(name, value)| (name, value.into())).collect();
        let refused = refused.map(Why::name);
        self.screen.json_line(&Line::Request { kind: &kind.name, fields, refused });
    }

    fn job_ended(&self, report: &JobReport<'_>) {
        let name = report.name;
        let (result, message) = match (report.unreadable, report.outcome) {
            (Some(error), _) => ("aborted", Some(format!("{name} cannot be read: {error}"))),
            (None, SendOutcome::Done) => ("done", None),
            (None, SendOutcome::Aborted) if report.is_superseded => ("superseded", None),
            (None, SendOutcome::Aborted) => ("aborted", Some(format!("{name}: aborted"))),
            (None, SendOutcome::Failed { failure, status }) => {
                let why = reason(self.manifest, failure, status);
                ("failed", Some(format!("sending {name} failed: {why}")))
            }
            (None, SendOutcome::CheckFailed { failure, status, line, column }) => {
                let why = check_message(self.manifest, name, failure, status, line, column);
                ("check-failed", Some(why))
            }
        };
        let sent = report.sent;
        match &message {
            Some(message) => self.error(message),
            None if result == "done" => self.say(format_args!(
                "sent {name}, {} on the line, in {}",
                numbers::bytes(sent),
                numbers::span(report.elapsed)
            )),
            None => self.say(format_args!("{name}: another program was asked for instead")),
        }
        let seconds = numbers::seconds(report.elapsed);
        let status = match report.outcome {
            SendOutcome::Failed { status, .. } | SendOutcome::CheckFailed { status, .. } => status,
            SendOutcome::Done | SendOutcome::Aborted => 0,
        };
        let status = StatusDocument::new(self.manifest, status);
        self.screen.json_line(&Line::Job { program: name, result, sent, seconds, status, message });
    }
}

/// What a machine is told of a program that is there and cannot be had.
fn refusal(error: &io::Error) -> Why {
    tracing::warn!(%error, "a program that was asked for cannot be read");
    match error.kind() {
        io::ErrorKind::PermissionDenied => Why::Denied,
        _ => Why::NotFound,
    }
}

impl ServeHandler for Counter<'_> {
    fn begin(&mut self) -> io::Result<()> {
        self.head.clear();
        let begun = self.inbox.begin();
        self.written(begun)
    }

    fn deliver(&mut self, bytes: &[u8]) -> io::Result<()> {
        let written = self.inbox.write(bytes);
        self.written(written)?;
        let room = HEAD_BYTES - self.head.len();
        self.head.extend_from_slice(&bytes[..bytes.len().min(room)]);
        Ok(())
    }

    fn end(&mut self, delivered: &Delivered) -> io::Result<()> {
        // The plug-in is not to blame for a disk that is full.
        let unwritten = self.unwritten.take();
        let failure = delivered.failure.filter(|_| unwritten.is_none());
        let mark = if delivered.failure.is_none() { Mark::Complete } else { Mark::Failed };
        let said = delivered.name.clone().or_else(|| self.notations.name_in(&self.head));
        let name = said.as_deref();
        let kept = self.inbox.end(name, mark)?;
        let came = numbers::bytes(kept.bytes);
        let file = kept.path.map(|path| path.display().to_string());
        let place = file.as_ref().map(|file| format!(" in {file}")).unwrap_or_default();
        let why = match (unwritten, failure) {
            (Some(error), _) => Some(format!("it cannot be written: {error}")),
            (None, Some((failure, status))) => Some(reason(self.manifest, failure, status)),
            (None, None) => None,
        };
        let message = why.map(|why| format!("a reception failed after {came}: {why}"));
        match &message {
            None => {
                let called = name.map(|name| format!(", called {}", name.escape_debug()));
                let took = numbers::span(delivered.elapsed);
                self.say(format_args!(
                    "received {came} in {took}{}{}",
                    place.replacen(" in ", " into ", 1),
                    called.unwrap_or_default()
                ));
            }
            Some(message) if place.is_empty() => self.error(message),
            Some(message) => self.error(format_args!("{message}; what came is{place}")),
        }
        self.screen.json_line(&Line::Delivery {
            result: if message.is_none() { "complete" } else { "failed" },
            bytes: kept.bytes,
            seconds: numbers::seconds(delivered.elapsed),
            file,
            name,
            failure: failure.map(|(failure, _)| failure.name()),
            status: failure.and_then(|(_, status)| StatusDocument::new(self.manifest, status)),
            message,
        });
        Ok(())
    }

    fn asked(&mut self, request: &Request) -> Reply {
        match self.program(request) {
            Ok(program) => Reply::Program(program),
            Err(failure) => Reply::Refused(failure),
        }
    }

    fn tell(&mut self, news: &News<'_>) {
        match news {
            News::Answered { request, refused } => self.answered(request, *refused),
            News::JobBegins { name, size } => {
                let size = size.map(|size| format!(", {}", numbers::bytes(size)));
                self.say(format_args!("sending {name}{}", size.unwrap_or_default()));
            }
            News::JobEnds(report) => self.job_ended(report),
            News::Note(note) => {
                self.bar
                    .aside(|| say_notes(std::slice::from_ref(note), self.manifest, self.screen));
                let (level, code) = (note.level.name(), note.code);
                self.screen.json_line(&Line::Note { level, code, text: &note.text });
            }
        }
    }
}
