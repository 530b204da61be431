//! `softplug demo`: to a simulated control and back, in this process.

use std::fmt::Write as _;
use std::io::Cursor;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use serde::Serialize;
use softplug_abi::{LineParameters, Micros};
use softplug_conformance::partners::xon_xoff::{ControlOptions, ControlReport, Received};
use softplug_gateway::station::{Station, StationOptions};
use softplug_gateway::transfer::{
    self, ReceiveOutcome, ReceiveReport, SendOptions, SendOutcome, SendReport,
};
use softplug_gateway::{Port, PortOptions, PortSpec};

use super::machine::Machine;
use super::progress::Bar;
use super::simulate::difference;
use super::transfer_failure;
use crate::commands::demo::Arguments;
use crate::commands::replay;
use crate::commands::simulate::Simulation;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::line::Assignment;
use crate::numbers;
use crate::plugin::Chosen;
use crate::screen::{GOOD, HEADING, Screen};
use crate::stop;

const BAUD: u32 = 921_600;
/// Bytes per second that the control executes: less than the line brings, so
/// that it must hold.
const RATE: u32 = 45_000;
/// A control that was later than this lost bytes by its own fault.
const LATE: Micros = Micros::from_millis(1);
/// Attempts on a busy computer.
const ATTEMPTS: u32 = 3;

#[derive(Default, Serialize)]
struct Document {
    result: &'static str,
    bytes: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    send: Option<Leg>,
    #[serde(skip_serializing_if = "Option::is_none")]
    receive: Option<Leg>,
    #[serde(skip_serializing_if = "Option::is_none")]
    replay: Option<Replayed>,
}

#[derive(Serialize)]
struct Leg {
    seconds: f64,
    held_seconds: f64,
    holds: u64,
    alarms: usize,
    identical: bool,
}

#[derive(Serialize)]
struct Replayed {
    total: usize,
    passed: usize,
    failed: usize,
}

pub(crate) fn demo(arguments: &Arguments, screen: &Screen) -> Result<Exit, Failure> {
    let plugin = arguments.library.load("xon-xoff")?;
    let stop = stop::on_signals()?;
    let program = program(arguments.bytes as usize);
    let mut document = Document { bytes: program.len(), ..Document::default() };
    screen.say(format_args!(
        "{HEADING}1. To the machine{HEADING:#}\n\
         A simulated control with a buffer of 32,768 bytes sits on a pseudo-terminal. It executes\n\
         {} bytes a second; the line, at {} baud, brings twice as much. Whenever its\n\
         buffer is half full it sends XOFF, and the plug-in, {} in the sandbox, has to obey.",
        numbers::count(RATE.into()),
        numbers::count(BAUD.into()),
        plugin.manifest().name,
    ));
    let sent = sent(&plugin, &program, &stop, screen)?;
    let Some((report, seen)) = sent else { return Ok(aborted(document, screen)) };
    let identical = seen.received.matches(&program);
    let leg = Leg {
        seconds: numbers::seconds(report.elapsed),
        held_seconds: numbers::seconds(report.held),
        holds: report.holds,
        alarms: seen.alarms.len(),
        identical,
    };
    let is_sent = report.outcome == SendOutcome::Done && identical && leg.alarms == 0;
    document.send = Some(leg);
    if !is_sent {
        return Ok(failed(document, screen, &sending_went_wrong(&report, &seen, &program)));
    }
    let after = &seen.characters_after_xoff;
    screen.say(format_args!(
        "{GOOD}Identical{GOOD:#}: {} in {}, held {} ({}), no overflow.\n\
         Characters that came after an XOFF: p99 {}, most {}.\n",
        numbers::bytes(report.bytes),
        numbers::span(report.elapsed),
        numbers::things(report.holds, "time"),
        numbers::span(report.held),
        after.percentile(99),
        after.max(),
    ));

    screen.say(format_args!(
        "{HEADING}2. Back again{HEADING:#}\n\
         The control sends the program back, and the plug-in receives it. No end is marked: the\n\
         reception is over when the line has been quiet for a second.",
    ));
    let (report, bytes) = received(&plugin, &program, &stop, screen)?;
    if report.outcome == ReceiveOutcome::Aborted {
        return Ok(aborted(document, screen));
    }
    let identical = bytes == program;
    document.receive = Some(Leg {
        seconds: numbers::seconds(report.elapsed),
        held_seconds: numbers::seconds(report.held),
        holds: 0,
        alarms: 0,
        identical,
    });
    if report.outcome != ReceiveOutcome::Complete || !identical {
        let why = match report.outcome {
            ReceiveOutcome::Failed { failure, .. } => failure.text(),
            ReceiveOutcome::NothingCame => "nothing came",
            _ => "it came back altered",
        };
        let place = difference(&program, &bytes);
        return Ok(failed(document, screen, &format!("the reception failed: {why} ({place})")));
    }
    screen.say(format_args!(
        "{GOOD}Identical{GOOD:#}: {} in {}.\n",
        numbers::bytes(report.bytes),
        numbers::span(report.elapsed)
    ));

    screen.say(format_args!("{HEADING}3. The traces{HEADING:#}"));
    if !arguments.traces.exists() {
        screen.say(format_args!(
            "Left out: there is no folder {}. From a clone of the project, run this in its root.",
            arguments.traces.display()
        ));
    } else if let Some(summary) = replay::quick(&plugin, &arguments.traces)? {
        let replayed =
            Replayed { total: summary.total, passed: summary.passed, failed: summary.failed };
        let is_good = replayed.failed == 0;
        document.replay = Some(replayed);
        if !is_good {
            let text = format!("{} of {} cases failed", summary.failed, summary.total);
            return Ok(failed(document, screen, &text));
        }
        screen.say(format_args!(
            "{GOOD}All passed{GOOD:#}: {} in virtual time, each trace as it is written, with its\n\
             bytes one by one and all at once, twice in one instance, and with the plug-in replaced\n\
             by a fresh instance after every event. `softplug replay` has more such permutations.",
            numbers::things(summary.total as u64, "case"),
        ));
    }
    document.result = "done";
    screen.document(&document);
    Ok(Exit::Done)
}

/// Sends the program; `None` if it was aborted. A control that was late itself
/// proves nothing, so that the sending is repeated.
fn sent(
    plugin: &Chosen,
    program: &[u8],
    stop: &AtomicBool,
    screen: &Screen,
) -> Result<Option<(SendReport, ControlReport)>, Failure> {
    let mut attempt = 1;
    loop {
        let (report, seen) = send_once(plugin, program, stop, screen)?;
        if report.outcome == SendOutcome::Aborted {
            return Ok(None);
        }
        let is_inconclusive = !seen.alarms.is_empty() && seen.late > LATE;
        if !is_inconclusive || attempt == ATTEMPTS {
            return Ok(Some((report, seen)));
        }
        screen.note("the computer was too busy to simulate the control in time; once more");
        attempt += 1;
    }
}

fn send_once(
    plugin: &Chosen,
    program: &[u8],
    stop: &AtomicBool,
    screen: &Screen,
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
    let machine = Machine::new(&simulation(control, None))?;
    let mut station = station(plugin, &machine, &[])?;
    let worker = Worker::start(machine);
    let options =
        SendOptions { check: true, size: Some(program.len() as u64), job_kind: job_kind(plugin)? };
    let bar = Bar::new(options.size, screen);
    let mut source = Cursor::new(program);
    let sent = transfer::send(&mut station, &mut source, &options, stop, &mut |progress| {
        bar.show(progress);
    });
    bar.end();
    let is_done = sent.as_ref().is_ok_and(|report| report.outcome == SendOutcome::Done);
    let seen = worker.end(!is_done)?;
    Ok((sent.map_err(transfer_failure)?, seen))
}

fn received(
    plugin: &Chosen,
    program: &[u8],
    stop: &AtomicBool,
    screen: &Screen,
) -> Result<(ReceiveReport, Vec<u8>), Failure> {
    let control = ControlOptions { line: LineParameters::new(BAUD), ..ControlOptions::default() };
    let machine = Machine::new(&simulation(control, Some(program.to_vec())))?;
    let quiet = Assignment { name: "quiet_time".to_owned(), value: "1000".to_owned() };
    let mut station = station(plugin, &machine, &[quiet])?;
    let worker = Worker::start(machine);
    let mut bytes = Vec::with_capacity(program.len());
    let bar = Bar::new(None, screen);
    let wait = Some(Duration::from_secs(10));
    let received = transfer::receive(&mut station, &mut bytes, wait, stop, &mut |progress| {
        bar.show(progress);
    });
    bar.end();
    worker.end(true)?;
    Ok((received.map_err(transfer_failure)?, bytes))
}

fn simulation(control: ControlOptions, punch: Option<Vec<u8>>) -> Simulation {
    // A control that goes away when it has sent all would be a lost port.
    let quiet_time = punch.is_none().then_some(Micros::from_millis(500));
    let punch_after = Micros::from_millis(200);
    Simulation { control, punch, punch_after, expect: None, out: None, quiet_time }
}

fn station(
    plugin: &Chosen,
    machine: &Machine,
    settings: &[Assignment],
) -> Result<Station<crate::plugin::AnyInstance>, Failure> {
    let settings = plugin.settings(settings)?;
    let spec = PortSpec::Device(machine.path().to_owned());
    let port = Port::open(&spec, &PortOptions::new(LineParameters::new(BAUD)))?;
    let options = StationOptions { settings, ..StationOptions::default() };
    Ok(Station::new(port, plugin.instantiate()?, options)?)
}

fn job_kind(plugin: &Chosen) -> Result<u16, Failure> {
    let kind = plugin.manifest().job_kind("send");
    kind.ok_or_else(|| Failure::usage("this plug-in xon-xoff has no job \"send\""))
}

/// A machine on its own thread.
struct Worker {
    stop: Arc<AtomicBool>,
    thread: thread::JoinHandle<Result<ControlReport, softplug_gateway::PortError>>,
}

impl Worker {
    fn start(mut machine: Machine) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        let seen = Arc::clone(&stop);
        Self { stop, thread: thread::spawn(move || machine.run(&seen)) }
    }

    /// Waits for the machine's own end, or ends it now.
    fn end(self, now: bool) -> Result<ControlReport, Failure> {
        if now {
            self.stop.store(true, Ordering::Relaxed);
        }
        match self.thread.join() {
            Ok(report) => Ok(report?),
            Err(_) => Err(Failure::internal("the simulated control has met a wrong state")),
        }
    }
}

fn aborted(document: Document, screen: &Screen) -> Exit {
    screen.document(&Document { result: "aborted", ..document });
    screen.error("aborted");
    Exit::Incomplete
}

fn failed(document: Document, screen: &Screen, why: &str) -> Exit {
    screen.document(&Document { result: "failed", ..document });
    screen.error(why);
    Exit::Failed
}

fn sending_went_wrong(report: &SendReport, seen: &ControlReport, program: &[u8]) -> String {
    match (&report.outcome, &seen.received) {
        (SendOutcome::Done, Received::Bytes(bytes)) => {
            let late = if seen.late > LATE {
                "; this computer was too busy to simulate the control in time, try again"
            } else {
                ""
            };
            format!(
                "the control did not get the program: {}, {} lost{late}",
                difference(program, bytes),
                numbers::bytes(seen.alarms.len() as u64)
            )
        }
        (outcome, _) => format!("the transfer failed: {outcome:?}"),
    }
}

/// A surface milled line by line, of `length` bytes or a block more, from `%`
/// to `%`.
fn program(length: usize) -> Vec<u8> {
    let mut text = String::with_capacity(length + 64);
    text.push_str("%\nO0001 (SURFACE)\nG90 G54 G17\nS12000 M3\n");
    let (mut number, mut x, mut y) = (10_u32, 0_i64, 0_i64);
    while text.len() < length {
        // A shallow bowl, in thousandths.
        let z = (x - 50_000).pow(2) / 500_000 + (y - 50_000).pow(2) / 500_000 - 10_000;
        let _ = writeln!(
            text,
            "N{number} G1 X{}.{:03} Y{}.{:03} Z{}{}.{:03}",
            x / 1_000,
            x % 1_000,
            y / 1_000,
            y % 1_000,
            if z < 0 { "-" } else { "" },
            z.abs() / 1_000,
            z.abs() % 1_000
        );
        number = if number >= 99_990 { 10 } else { number + 10 };
        x += 137;
        if x > 100_000 {
            (x, y) = (0, (y + 250) % 100_000);
        }
    }
    text.push_str("M5\nM30\n%\n");
    text.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_program_is_one_and_long_enough() {
        let program = program(100_000);
        assert!((100_000..100_100).contains(&program.len()), "{}", program.len());
        let text = String::from_utf8(program).unwrap();
        assert!(text.starts_with("%\nO0001") && text.ends_with("M30\n%\n"));
        assert!(text.lines().all(|line| line.len() < 80 && line.is_ascii()));
    }
}
