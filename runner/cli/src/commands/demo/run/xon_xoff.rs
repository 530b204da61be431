//! The first part: a control that holds the line with XOFF.

use std::time::Duration;

use serde_json::json;
use softplug_abi::{LineParameters, Micros};
use softplug_live::transfer::{self, ReceiveOutcome, ReceiveReport, SendOutcome, SendReport};
use softplug_machines::xon_xoff::{ControlOptions, ControlReport};

use super::context::{DemoContext, Shown, Worker, program, station, why};
use crate::commands::simulate::{RunOptions, XonXoffSimulation};
use crate::commands::simulate::{XonXoff, difference};
use crate::failure::Failure;
use crate::live::machine::Machine;
use crate::live::progress::Bar;
use crate::live::transfer_failure;
use crate::numbers;
use crate::plugin::Chosen;
use crate::screen::{GOOD, HEADING};

const BAUD: u32 = 921_600;
/// Bytes per second that the control executes: less than the line brings, so
/// that it must hold.
const RATE: u32 = 45_000;

pub(super) fn show(context: &DemoContext<'_>, plugin: &Chosen) -> Result<Shown, Failure> {
    let screen = context.screen;
    let program = program(context.arguments.bytes as usize);
    screen.say(format_args!(
        "{HEADING}1. XON/XOFF: to the machine, and back{HEADING:#}\n\
         A simulated control with a buffer of 32,768 bytes sits on a pseudo-terminal. It executes\n\
         {} bytes a second; the line, at {} baud, brings twice as much. Whenever its\n\
         buffer is half full it sends XOFF, and the plug-in, in the sandbox, has to obey.",
        numbers::count(RATE.into()),
        numbers::count(BAUD.into()),
    ));
    let (report, seen) = sent(context, plugin, &program)?;
    if report.outcome == SendOutcome::Aborted {
        return Ok(Shown::Aborted);
    }
    let identical = seen.received.matches(&program);
    if report.outcome != SendOutcome::Done || !identical || !seen.alarms.is_empty() {
        let lost = numbers::bytes(seen.alarms.len() as u64);
        let why = why(plugin, report.outcome);
        return Ok(Shown::Failed(format!("{why}; {lost} lost")));
    }
    let after = &seen.characters_after_xoff;
    screen.say(format_args!(
        "{GOOD}Identical{GOOD:#}: {} in {}, held {} ({}), no overflow.\n\
         Characters that came after an XOFF: p99 {}, most {}.",
        numbers::bytes(report.bytes),
        numbers::span(report.elapsed),
        numbers::things(report.holds, "time"),
        numbers::span(report.held),
        after.percentile(99),
        after.max(),
    ));
    let (back, bytes) = received(context, plugin, &program)?;
    match back.outcome {
        ReceiveOutcome::Complete if bytes == program => {}
        ReceiveOutcome::Aborted => return Ok(Shown::Aborted),
        ReceiveOutcome::Failed { failure, .. } => {
            return Ok(Shown::Failed(format!("the reception failed: {}", failure.text())));
        }
        _ => {
            let place = difference(&program, &bytes);
            return Ok(Shown::Failed(format!("it came back altered: {place}")));
        }
    }
    screen.say(format_args!(
        "{GOOD}Identical{GOOD:#} when the control sends it back: {} in {}.\n",
        numbers::bytes(back.bytes),
        numbers::span(back.elapsed)
    ));
    Ok(Shown::Good(json!({
        "bytes": report.bytes,
        "seconds": numbers::seconds(report.elapsed),
        "held_seconds": numbers::seconds(report.held),
        "holds": report.holds,
        "received_seconds": numbers::seconds(back.elapsed),
    })))
}

fn sent(
    context: &DemoContext<'_>,
    plugin: &Chosen,
    program: &[u8],
) -> Result<(SendReport, ControlReport), Failure> {
    let control = ControlOptions {
        line: LineParameters::new(BAUD),
        buffer: 32_768,
        // More room than a pty holds: a computer that is busy elsewhere makes
        // the control late, but does not make it lose anything.
        low: 16_384,
        high: 16_896,
        rate: RATE,
        ..ControlOptions::default()
    };
    let machine = machine(control, None)?;
    let mut station = station(plugin, &machine, LineParameters::new(BAUD), &[])?;
    let worker = Worker::start(machine);
    let sent = context.send(plugin, &mut station, program);
    let is_done = sent.as_ref().is_ok_and(|report| report.outcome == SendOutcome::Done);
    let seen = worker.end(!is_done)?.partner().control.report();
    context.pulse.saw(seen.late);
    Ok((sent?, seen))
}

fn received(
    context: &DemoContext<'_>,
    plugin: &Chosen,
    program: &[u8],
) -> Result<(ReceiveReport, Vec<u8>), Failure> {
    let control = ControlOptions { line: LineParameters::new(BAUD), ..ControlOptions::default() };
    let machine = machine(control, Some(program.to_vec()))?;
    let quiet = [("quiet_time", "1000")];
    let mut station = station(plugin, &machine, LineParameters::new(BAUD), &quiet)?;
    let worker = Worker::start(machine);
    let mut bytes = Vec::with_capacity(program.len());
    let bar = Bar::new(None, context.screen);
    let wait = Some(Duration::from_secs(10));
    let received =
        transfer::receive(&mut station, &mut bytes, None, wait, context.stop, &mut |progress| {
            bar.show(progress);
        });
    bar.end();
    worker.end(true)?;
    Ok((received.map_err(transfer_failure)?, bytes))
}

fn machine(control: ControlOptions, punch: Option<Vec<u8>>) -> Result<Machine<XonXoff>, Failure> {
    // A control that goes away when it has sent all would be a lost port.
    let quiet_time = punch.is_none().then_some(Micros::from_millis(500));
    let punch_after = Micros::from_millis(200);
    let simulation = XonXoffSimulation { control, punch, punch_after, run: RunOptions::default() };
    Ok(Machine::new(XonXoff::new(&simulation)?, quiet_time)?)
}
