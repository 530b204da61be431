//! `softplug receive` from a port.

use std::path::Path;
use std::time::Duration;

use softplug_abi::Failure as Why;
use softplug_gateway::transfer::{self, ReceiveOutcome};

use super::progress::Bar;
use super::send::exit_of;
use super::{note_documents, say_notes, station, transfer_failure};
use crate::commands::receive::{Arguments, Document, Prepared};
use crate::commands::send::reason;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files::Partial;
use crate::numbers;
use crate::screen::Screen;
use crate::stop;

pub(crate) fn receive(
    arguments: &Arguments,
    out: &Path,
    prepared: Prepared,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let Prepared { plugin, settings } = prepared;
    let stop = stop::on_signals()?;
    let mut station = station(&arguments.port, &arguments.link, &plugin, settings, screen)?;
    let mut partial = Partial::create(out, arguments.force)?;
    let wait = arguments.wait.map(|seconds| Duration::from_secs(u64::from(seconds)));
    let bar = Bar::new(None, screen);
    let received =
        transfer::receive(&mut station, &mut partial.file, wait, &stop, &mut |progress| {
            bar.show(progress);
        });
    bar.end();
    let report = match received {
        Ok(report) => report,
        Err(error) => {
            let failure = transfer_failure(error);
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
            let message = "nothing came in the time given";
            (Exit::Incomplete, "nothing-came", None, Some(message.to_owned()))
        }
        ReceiveOutcome::Failed { failure, status } => {
            let why = reason(plugin.manifest(), failure, status);
            let message = format!("the reception failed after {came}: {why}");
            (exit_of(failure), "failed", Some(failure), Some(message))
        }
    };
    let file = if exit == Exit::Done { Some(partial.complete()?) } else { partial.keep() };
    screen.document(&Document {
        result,
        bytes: report.bytes,
        seconds: numbers::seconds(report.elapsed),
        held_seconds: numbers::seconds(report.held),
        file: file.as_ref().map(|file| file.display().to_string()),
        name: report.name.clone(),
        failure: failure.map(Why::name),
        message: message.clone(),
        notes: note_documents(&report.notes),
    });
    if let Some(message) = message {
        screen.error(message);
        if let Some(file) = file {
            screen.report(format_args!("what came is in {}", file.display()));
        }
        return Ok(exit);
    }
    let name = report.name.map(|name| format!(", called {}", name.escape_debug()));
    screen.say(format_args!(
        "received {came} in {} into {}{}",
        numbers::span(report.elapsed),
        out.display(),
        name.unwrap_or_default()
    ));
    Ok(exit)
}
