//! `softplug send` to a port.

use std::fmt::Write as _;

use softplug_abi::Failure as Why;
use softplug_gateway::PortSpec;
use softplug_gateway::station::{Station, StationOptions};
use softplug_gateway::transfer::{self, SendOptions, SendOutcome, SendReport};

use super::progress::Bar;
use super::{note_documents, open, say_notes, transfer_failure};
use crate::commands::send::{Arguments, Document, Prepared, check_message, reason};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::numbers;
use crate::screen::Screen;
use crate::stop;

pub(crate) fn send(
    arguments: &Arguments,
    port: &PortSpec,
    prepared: Prepared,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let Prepared { mut program, plugin, settings, job_kind, check } = prepared;
    let stop = stop::on_signals()?;
    let instance = plugin.instantiate()?;
    let port = open(port, &arguments.link, screen)?;
    let options =
        StationOptions { settings, depth: arguments.link.depth, ..StationOptions::default() };
    let mut station = Station::new(port, instance, options)?;
    let options = SendOptions { check, size: Some(program.size), job_kind };
    let bar = Bar::new(options.size, screen);
    let sent = transfer::send(&mut station, &mut program.file, &options, &stop, &mut |progress| {
        bar.show(progress);
    });
    bar.end();
    let report = sent.map_err(transfer_failure)?;
    say_notes(&report.notes, screen);

    let manifest = plugin.manifest();
    let after = numbers::bytes(report.sent);
    let (exit, result, failure, message) = match report.outcome {
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
    screen.document(&Document {
        result,
        bytes: report.bytes,
        sent: report.sent,
        seconds: numbers::seconds(report.elapsed),
        held_seconds: numbers::seconds(report.held),
        holds: report.holds,
        received: report.received,
        failure: failure.map(Why::name),
        message: message.clone(),
        wire: None,
        notes: note_documents(&report.notes),
    });
    match message {
        None => screen.say(done(&report)),
        Some(message) => screen.error(message),
    }
    Ok(exit)
}

/// A port that is gone is the port's matter, all else the transfer's.
pub(super) fn exit_of(failure: Why) -> Exit {
    match failure {
        Why::LinkDown => Exit::Port,
        _ => Exit::Failed,
    }
}

fn done(report: &SendReport) -> String {
    let mut text =
        format!("sent {} in {}", numbers::bytes(report.bytes), numbers::span(report.elapsed));
    let seconds = report.elapsed.as_secs_f64();
    if seconds > 0.0 {
        let _ =
            write!(text, ", {} bytes/s", numbers::count((report.bytes as f64 / seconds) as u64));
    }
    if report.holds > 0 {
        let times = numbers::things(report.holds, "time");
        let _ = write!(text, "; held {times}, {} in all", numbers::span(report.held));
    }
    if report.received > 0 {
        let came = numbers::bytes(report.received);
        let _ = write!(text, "; {came} came meanwhile and were dropped");
    }
    text
}
