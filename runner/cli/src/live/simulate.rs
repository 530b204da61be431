//! `softplug simulate`.

use serde::Serialize;
use softplug_abi::Micros;
use softplug_conformance::partners::xon_xoff::{AlarmKind, ControlReport, Counts, Received};

use super::machine::Machine;
use crate::commands::simulate::Simulation;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::numbers;
use crate::screen::{BAD, GOOD, Screen};
use crate::stop;

/// The first line for machines.
#[derive(Serialize)]
struct Ready {
    port: String,
}

/// The last line for machines.
#[derive(Serialize)]
pub(super) struct Document {
    result: &'static str,
    received: u64,
    consumed: u64,
    alarms: usize,
    holds: u32,
    held_seconds: f64,
    after_xoff: Distribution,
    starved: u32,
    starved_seconds: f64,
    largest_level: usize,
    /// How late the control itself was at worst: an alarm with a large one proves nothing.
    late_seconds: f64,
    bytes_per_second_while_allowed: f64,
    punched: u64,
    punched_after_xoff: Distribution,
    #[serde(skip_serializing_if = "Option::is_none")]
    as_expected: Option<bool>,
}

#[derive(Serialize)]
struct Distribution {
    p50: u32,
    p99: u32,
    max: u32,
}

impl From<&Counts> for Distribution {
    fn from(counts: &Counts) -> Self {
        Self { p50: counts.percentile(50), p99: counts.percentile(99), max: counts.max() }
    }
}

pub(crate) fn simulate(simulation: &Simulation, screen: &Screen) -> Result<Exit, Failure> {
    let stop = stop::on_signals()?;
    let mut machine = Machine::new(simulation)?;
    let port = machine.path().display().to_string();
    screen.say(&port);
    screen.json_line(&Ready { port });
    let report = machine.run(&stop)?;

    let received = match &report.received {
        Received::Bytes(bytes) => bytes.as_slice(),
        // Only where the options say that no bytes are kept.
        Received::Digest { .. } => &[],
    };
    if let Some(out) = &simulation.out {
        std::fs::write(out, received).map_err(|error| files::unwritable(out, &error))?;
    }
    let as_expected = simulation.expect.as_ref().map(|bytes| report.received.matches(bytes));
    let is_good = report.alarms.is_empty() && as_expected != Some(false);
    screen.say(text(&report));
    if let (Some(false), Some(expected)) = (as_expected, &simulation.expect) {
        screen.say(format_args!("{BAD}not as expected{BAD:#}: {}", difference(expected, received)));
    } else if as_expected == Some(true) {
        screen.say(format_args!("{GOOD}as expected{GOOD:#}"));
    }
    screen.json_line(&document(&report, as_expected, is_good));
    Ok(if is_good { Exit::Done } else { Exit::Failed })
}

pub(super) fn document(
    report: &ControlReport,
    as_expected: Option<bool>,
    is_good: bool,
) -> Document {
    Document {
        result: if is_good { "done" } else { "failed" },
        received: report.received.count(),
        consumed: report.consumed,
        alarms: report.alarms.len(),
        holds: report.holds,
        held_seconds: report.held.as_secs_f64(),
        after_xoff: (&report.characters_after_xoff).into(),
        starved: report.starved,
        starved_seconds: report.starved_for.as_secs_f64(),
        largest_level: report.largest_level,
        late_seconds: report.late.as_secs_f64(),
        bytes_per_second_while_allowed: report.rate_while_allowed(),
        punched: report.punched,
        punched_after_xoff: (&report.punched_after_xoff).into(),
        as_expected,
    }
}

fn text(report: &ControlReport) -> String {
    let mut lines = Vec::new();
    lines.push(format!("received {}", numbers::bytes(report.received.count())));
    if report.holds > 0 {
        let Distribution { p50, p99, max } = (&report.characters_after_xoff).into();
        lines.push(format!(
            "held the line {}, {} in all",
            numbers::things(u64::from(report.holds), "time"),
            seconds(report.held)
        ));
        lines.push(format!("characters after XOFF: p50 {p50}, p99 {p99}, most {max}"));
    }
    if report.starved > 0 {
        lines.push(format!(
            "the buffer ran empty {}, for {} in all",
            numbers::things(u64::from(report.starved), "time"),
            seconds(report.starved_for)
        ));
    }
    if report.punched > 0 {
        lines.push(format!("sent {}", numbers::bytes(report.punched)));
    }
    match report.alarms.first() {
        None => lines.push("no alarm".to_owned()),
        Some(first) => {
            let what = match first.kind {
                AlarmKind::BufferOverflow => "the receive buffer was full",
                AlarmKind::Overrun => "the receive FIFO was full",
            };
            lines.push(format!(
                "{BAD}ALARM{BAD:#}: {} lost; the first is byte {}: {what}",
                numbers::bytes(report.alarms.len() as u64),
                first.position
            ));
            if first.late > Micros::from_millis(1) {
                lines.push(format!(
                    "the simulation itself was {} late: the computer was busy, try again",
                    seconds(first.late)
                ));
            }
        }
    }
    lines.join("\n")
}

fn seconds(span: Micros) -> String {
    format!("{:.3} s", span.as_secs_f64())
}

/// Where two files part.
pub(super) fn difference(expected: &[u8], received: &[u8]) -> String {
    let same = expected.iter().zip(received).take_while(|(one, other)| one == other).count();
    format!(
        "{} expected, {} received, the same up to byte {same}",
        numbers::bytes(expected.len() as u64),
        numbers::bytes(received.len() as u64)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_names_its_place() {
        let text = difference(b"G1X1", b"G1Y");
        assert_eq!(text, "4 bytes expected, 3 bytes received, the same up to byte 2");
    }
}
