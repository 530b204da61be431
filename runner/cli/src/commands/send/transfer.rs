//! `softplug send` to a port.

use std::fmt::Write as _;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::Duration;

use data_encoding::HEXLOWER;
use softplug_abi::Failure as Why;
use softplug_live::PortSpec;
use softplug_live::store::Inbox;
use softplug_live::transfer::{self, Progress, SendOptions, SendOutcome, SendReport, Sink};
use softplug_trial::reason;

use super::{Arguments, Document, Prepared, StatusDocument, check_message};
use crate::dump::Dump;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::{Partial, no_folder};
use crate::live::progress::Bar;
use crate::live::{
    kept_documents, note_documents, say_kept, say_notes, station, transfer_failure_at,
};
use crate::numbers;
use crate::plugin::SEND;
use crate::screen::Screen;
use crate::stop;

/// A line that stands still for longer, while bytes wait, is worth a word.
const LONG_GAP: Duration = Duration::from_millis(4);

pub(crate) fn send(
    arguments: &Arguments,
    port: &PortSpec,
    prepared: Prepared,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let Prepared { mut program, plugin, settings, job_kind, fields, check } = prepared;
    let stop = stop::on_signals()?;
    // A job that only sends needs no room: who has something to say meanwhile is refused.
    let only_sends = plugin.manifest().jobs[usize::from(job_kind)].name == SEND;
    let takes = !only_sends || arguments.keep.is_some() || arguments.out.is_some();
    let mut station = station(port, &arguments.link, &plugin, settings, takes, screen)?;
    let mut besides = match &arguments.keep {
        Some(keep) => Some(Inbox::new(keep).map_err(|error| no_folder(keep, &error))?),
        None => None,
    };
    let options = SendOptions { check, size: Some(program.size), job_kind, fields };
    let mut answer = match &arguments.out {
        Some(out) => {
            let partial = Partial::create(out, arguments.force)?;
            partial.say_left(screen);
            Answer::File(partial)
        }
        None => Answer::Shown(Vec::new()),
    };
    let bar = Bar::new(options.size.filter(|size| *size > 0), screen);
    let (source, show) = (&mut program.file, &mut |progress: &Progress<'_>| bar.show(progress));
    let besides = besides.as_mut();
    let sent = transfer::ask(&mut station, source, &mut answer, besides, &options, &stop, show);
    bar.end();
    let report = match sent {
        Ok(report) => report,
        Err(error) => {
            answer.keep(screen);
            let (out, keep) = (arguments.out.as_deref(), arguments.keep.as_deref());
            return Err(transfer_failure_at(error, out, keep));
        }
    };
    say_notes(&report.notes, plugin.manifest(), screen);

    let manifest = plugin.manifest();
    let after = so_far(&report);
    let (exit, result, failure, message) = match report.outcome {
        SendOutcome::Done if report.received > 0 => {
            // The plug-in had room for an answer, and took something else with it.
            let came = numbers::bytes(report.received);
            let message = format!(
                "{came} came meanwhile that are no answer, and are lost; give a folder with --keep"
            );
            (Exit::Failed, "done-with-loss", None, Some(message))
        }
        SendOutcome::Done => (Exit::Done, "done", None, None),
        SendOutcome::Aborted => {
            (Exit::Incomplete, "aborted", None, Some(format!("aborted after {after}")))
        }
        SendOutcome::CheckFailed { failure, status, line, column } => {
            let message = check_message(manifest, &program.name, failure, status, line, column);
            (Exit::Failed, "check-failed", Some(failure), Some(message))
        }
        SendOutcome::Failed { failure, status } => {
            let why = reason(manifest, failure, status);
            let message = format!("the transfer failed after {after}: {why}");
            (exit_of(failure), "failed", Some(failure), Some(message))
        }
    };
    let status = match report.outcome {
        SendOutcome::Failed { status, .. } | SendOutcome::CheckFailed { status, .. } => status,
        SendOutcome::Done | SendOutcome::Aborted => 0,
    };
    let file = match (report.outcome, report.answered, answer) {
        (SendOutcome::Done, 1.., answer) => answer.complete(screen)?,
        (.., answer) => answer.keep(screen),
    };
    let (file, answer) = match file {
        Some(Place::File(file)) => (Some(file), None),
        Some(Place::Shown(text)) => (None, Some(text)),
        None => (None, None),
    };
    screen.document(&Document {
        result,
        bytes: report.bytes,
        sent: report.sent,
        may_have_left: Some(report.left.maybe.max(report.sent)),
        seconds: numbers::seconds(report.elapsed),
        held_seconds: numbers::seconds(report.held),
        holds: report.holds,
        gaps: report.gaps,
        longest_gap_seconds: numbers::seconds(report.longest_gap),
        answered: Some(report.answered).filter(|answered| *answered > 0),
        kept: kept_documents(&report.kept),
        refused: report.refused,
        received: report.received,
        file: file.as_ref().map(|file| file.display().to_string()),
        answer,
        lathe: None,
        failure: failure.map(Why::name),
        status: StatusDocument::new(manifest, status),
        message: message.clone(),
        wire: None,
        exchange: Vec::new(),
        notes: note_documents(&report.notes),
    });
    match message {
        None => screen.say(done(&report, file.as_deref())),
        Some(message) => screen.error(message),
    }
    say_kept(&report.kept, manifest, screen);
    if report.refused > 0 {
        screen.note(format_args!(
            "the machine wanted to send meanwhile, {}, and there was no place for it; --keep DIR \
             takes what comes",
            numbers::things(report.refused, "time")
        ));
    }
    Ok(exit)
}

/// A port that is gone is the port's matter, all else the transfer's.
pub(crate) fn exit_of(failure: Why) -> Exit {
    match failure {
        Why::LinkDown => Exit::Port,
        _ => Exit::Failed,
    }
}

/// Where the answer to a job goes.
enum Answer {
    File(Partial),
    /// Nowhere was given.
    Shown(Vec<u8>),
}

/// Where it went.
enum Place {
    File(PathBuf),
    /// In hex.
    Shown(String),
}

impl Answer {
    fn complete(self, screen: &Screen) -> Result<Option<Place>, Failure> {
        match self {
            Self::File(partial) => Ok(Some(Place::File(partial.complete()?))),
            Self::Shown(bytes) => {
                screen.say(Dump(&bytes));
                Ok(Some(Place::Shown(HEXLOWER.encode(&bytes))))
            }
        }
    }

    /// The job has failed, or has no answer: a part of one stays, if it has a file.
    fn keep(self, screen: &Screen) -> Option<Place> {
        let Self::File(partial) = self else { return None };
        let kept = partial.keep()?;
        screen.report(format_args!("what came is in {}", kept.display()));
        Some(Place::File(kept))
    }
}

impl Write for Answer {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::File(partial) => partial.write(bytes),
            Self::Shown(shown) => shown.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::File(partial) => partial.flush(),
            Self::Shown(_) => Ok(()),
        }
    }
}

impl Sink for Answer {
    fn complete(&mut self) -> io::Result<()> {
        match self {
            Self::File(partial) => Sink::complete(partial),
            Self::Shown(_) => Ok(()),
        }
    }
}

fn done(report: &SendReport, file: Option<&Path>) -> String {
    let mut text = match (report.bytes, report.answered) {
        (0, 0) => format!("done in {}", numbers::span(report.elapsed)),
        (0, answered) => {
            format!("received {} in {}", numbers::bytes(answered), numbers::span(report.elapsed))
        }
        (bytes, _) if report.sent < bytes => format!(
            "sent {} of the file's {} in {}",
            numbers::bytes(report.sent),
            numbers::bytes(bytes),
            numbers::span(report.elapsed)
        ),
        (bytes, _) => {
            format!("sent {} in {}", numbers::bytes(bytes), numbers::span(report.elapsed))
        }
    };
    if let Some(file) = file {
        let _ = write!(text, " into {}", file.display());
    }
    let seconds = report.elapsed.as_secs_f64();
    if report.bytes > 0 && seconds > 0.0 {
        let _ =
            write!(text, ", {} bytes/s", numbers::count((report.bytes as f64 / seconds) as u64));
    }
    if report.holds > 0 {
        let times = numbers::things(report.holds, "time");
        let _ = write!(text, "; held {times}, {} in all", numbers::span(report.held));
    }
    if report.longest_gap > LONG_GAP {
        let times = numbers::things(report.gaps, "time");
        let _ = write!(
            text,
            "; the line stood still {times} while bytes waited, {} at most: this computer was late, \
             --depth says how much waits in the port",
            numbers::short_span(report.longest_gap)
        );
    }
    text
}

/// What left of a job that is not done, and what cannot be called back.
fn so_far(report: &SendReport) -> String {
    let sent = numbers::bytes(report.sent);
    match report.left.maybe.saturating_sub(report.sent) {
        0 => sent,
        more => {
            let more = numbers::things(more, "more character");
            format!("{sent} (up to {more} may have left, or may leave yet)")
        }
    }
}
