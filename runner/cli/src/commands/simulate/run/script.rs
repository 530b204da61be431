//! `softplug simulate script`.

use serde::Serialize;
use softplug_abi::Micros;
use softplug_machines::Partner as _;
use softplug_machines::script::{Report, Script};

use super::{put_away, run_machine, say_expected};
use crate::commands::simulate::ScriptSimulation;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::live::machine::Simulated;
use crate::numbers;
use crate::screen::{BAD, GOOD, Screen};

/// The last line for machines.
#[derive(Serialize)]
struct Document {
    result: &'static str,
    came: usize,
    expected: usize,
    said: usize,
    lines: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    as_expected: Option<bool>,
    #[serde(skip_serializing_if = "Option::is_none")]
    message: Option<String>,
}

impl Simulated for Script {
    fn connected(&mut self, now: Micros) {
        self.begin(now);
    }

    fn tend(&mut self, _now: Micros) {}

    fn is_busy(&self) -> bool {
        let report = self.report();
        report.differs.is_none() && !report.is_over && self.next_event().is_some()
    }
}

pub(super) fn run(simulation: &ScriptSimulation, screen: &Screen) -> Result<Exit, Failure> {
    let bytes = simulation.expected.iter().map(|(byte, _)| *byte).collect();
    let script = Script::new(bytes, simulation.lines.clone());
    let machine = run_machine(script, &simulation.run, screen)?;
    let report = machine.partner().report();
    let mut received: Vec<u8> =
        simulation.expected[..report.came].iter().map(|(byte, _)| *byte).collect();
    received.extend(report.other);
    let as_expected = put_away(&received, &simulation.run)?;
    let is_unsaid = report.is_over && machine.has_unwritten();
    let message = match difference(simulation, report) {
        None if is_unsaid => Some("not all was said: the other side does not take it".to_owned()),
        message => message,
    };
    let (came, expected) = (report.came, simulation.expected.len());
    screen.say(format_args!(
        "{} of {} came, {} of {} said",
        numbers::count(came as u64),
        numbers::things(expected as u64, "byte"),
        report.said,
        numbers::things(simulation.lines.len() as u64, "line")
    ));
    match &message {
        None => screen.say(format_args!("{GOOD}as in the trace{GOOD:#}")),
        Some(message) => screen.say(format_args!("{BAD}not as in the trace{BAD:#}: {message}")),
    }
    say_expected(&received, &simulation.run, screen);
    let is_good = message.is_none() && as_expected != Some(false);
    screen.json_line(&Document {
        result: if is_good { "done" } else { "failed" },
        came,
        expected,
        said: report.said,
        lines: simulation.lines.len(),
        as_expected,
        message,
    });
    Ok(if is_good { Exit::Done } else { Exit::Failed })
}

/// What is not as it was to be.
fn difference(simulation: &ScriptSimulation, report: &Report) -> Option<String> {
    if report.is_over {
        return None;
    }
    let next = simulation.expected.get(report.came);
    Some(match (report.other, next) {
        (Some(other), Some((expected, line))) => {
            format!("line {line}: {expected:02X} is expected, {other:02X} came")
        }
        (Some(other), None) => format!("{other:02X} came behind the end"),
        (None, Some((expected, line))) => {
            format!("line {line}: {expected:02X} is expected, and nothing came")
        }
        (None, None) => "not all was said".to_owned(),
    })
}
