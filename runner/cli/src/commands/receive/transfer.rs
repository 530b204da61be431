//! `softplug receive` from a port.

use std::path::Path;
use std::time::Duration;

use softplug_abi::Failure as Why;
use softplug_abi::manifest::Manifest;
use softplug_live::store::Inbox;
use softplug_live::transfer::{self, ReceiveOutcome};
use softplug_trial::reason;

use super::{Arguments, Document, Prepared};
use crate::commands::send::StatusDocument;
use crate::commands::send::exit_of;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::Partial;
use crate::live::progress::Bar;
use crate::live::{
    kept_documents, note_documents, say_kept, say_notes, station, transfer_failure_at,
};
use crate::numbers;
use crate::screen::Screen;
use crate::stop;

/// What happens next is up to the operator.
pub(super) const AWAITED: &str = "waiting for the machine to send: start its output there (PUNCH, \
                                  SEND or the like); Ctrl-C ends it";

pub(crate) fn receive(
    arguments: &Arguments,
    out: &Path,
    prepared: Prepared,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let Prepared { plugin, settings } = prepared;
    let stop = stop::on_signals()?;
    let mut station = station(&arguments.port, &arguments.link, &plugin, settings, true, screen)?;
    let mut partial = Partial::create(out, arguments.force)?;
    partial.say_left(screen);
    let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty());
    let folder = folder.unwrap_or(Path::new("."));
    let mut besides = Inbox::new(folder).map_err(|error| {
        Failure::usage(format_args!("no folder for {}: {error}", out.display()))
    })?;
    let wait = arguments.wait.map(|seconds| Duration::from_secs(u64::from(seconds)));
    screen.note(AWAITED);
    let bar = Bar::new(None, screen);
    let received = transfer::receive(
        &mut station,
        &mut partial,
        Some(&mut besides),
        wait,
        &stop,
        &mut |progress| bar.show(progress),
    );
    bar.end();
    let report = match received {
        Ok(report) => report,
        Err(error) => {
            let failure = transfer_failure_at(error, Some(out), Some(folder));
            return Err(match partial.keep() {
                Some(kept) => failure.hint(format_args!("what came is in {}", kept.display())),
                None => failure,
            });
        }
    };
    say_notes(&report.notes, plugin.manifest(), screen);

    let came = numbers::bytes(report.bytes);
    let (exit, result, failure, message) = match report.outcome {
        ReceiveOutcome::Complete => (Exit::Done, "complete", None, None),
        ReceiveOutcome::Aborted => {
            (Exit::Incomplete, "aborted", None, Some(format!("aborted after {came}")))
        }
        ReceiveOutcome::NothingCame => {
            let message = nothing_came(report.heard, plugin.manifest());
            (Exit::Incomplete, "nothing-came", None, Some(message))
        }
        ReceiveOutcome::Failed { failure, status } => {
            let why = reason(plugin.manifest(), failure, status);
            let message = format!("the reception failed after {came}: {why}");
            (exit_of(failure), "failed", Some(failure), Some(message))
        }
    };
    let status = match report.outcome {
        ReceiveOutcome::Failed { status, .. } => status,
        _ => 0,
    };
    let file = if exit == Exit::Done { Some(partial.complete()?) } else { partial.keep() };
    screen.document(&Document {
        result,
        bytes: report.bytes,
        seconds: numbers::seconds(report.elapsed),
        held_seconds: numbers::seconds(report.held),
        file: file.as_ref().map(|file| file.display().to_string()),
        name: report.name.clone(),
        heard: report.heard,
        kept: kept_documents(&report.kept),
        failure: failure.map(Why::name),
        status: StatusDocument::new(plugin.manifest(), status),
        message: message.clone(),
        notes: note_documents(&report.notes),
    });
    if let Some(message) = message {
        screen.error(message);
        if let Some(file) = file {
            screen.report(format_args!("what came is in {}", file.display()));
        }
        say_kept(&report.kept, plugin.manifest(), screen);
        return Ok(exit);
    }
    let name = report.name.map(|name| format!(", called {}", name.escape_debug()));
    screen.say(format_args!(
        "received {came} in {} into {}{}",
        numbers::span(report.elapsed),
        out.display(),
        name.unwrap_or_default()
    ));
    say_kept(&report.kept, plugin.manifest(), screen);
    Ok(exit)
}

/// Nothing was delivered; characters may have come all the same, of which no program begins.
pub(super) fn nothing_came(heard: u64, manifest: &Manifest) -> String {
    if heard == 0 {
        return "nothing came in the time given".to_owned();
    }
    format!(
        "{} came in the time given, but nothing that begins a program of {}: see in its page and \
         `softplug inspect {}` what does, and with `softplug doctor PORT --listen 5` whether the \
         line is set as the machine's",
        numbers::bytes(heard),
        manifest.protocol,
        manifest.name
    )
}
