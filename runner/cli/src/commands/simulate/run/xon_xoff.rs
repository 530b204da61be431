//! `softplug simulate xon-xoff`.

use serde::Serialize;
use softplug_abi::Micros;
use softplug_machines::Partner;
use softplug_machines::kept::Received;
use softplug_machines::xon_xoff::{AlarmKind, Control, ControlReport};

use super::{Distribution, put_away, run_machine, say_expected, seconds};
use crate::commands::simulate::XonXoffSimulation;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::live::machine::Simulated;
use crate::numbers;
use crate::screen::{BAD, Screen};

/// The last line for machines.
#[derive(Serialize)]
struct Document {
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

/// A control with what it is to send.
#[derive(Debug)]
pub(crate) struct XonXoff {
    pub(crate) control: Control,
    /// XON and XOFF: they are no data.
    control_bytes: [u8; 2],
    /// What it is to send, until it does.
    punch: Option<Vec<u8>>,
    punch_after: Micros,
    /// The other side has sent an XON.
    was_let_go: bool,
}

impl XonXoff {
    pub(crate) fn new(simulation: &XonXoffSimulation) -> Result<Self, Failure> {
        let XonXoffSimulation { control, punch, punch_after, .. } = simulation;
        Ok(Self {
            control: Control::new(control.clone()).map_err(Failure::usage)?,
            control_bytes: [control.xon, control.xoff],
            punch: punch.clone(),
            punch_after: *punch_after,
            was_let_go: false,
        })
    }
}

impl Partner for XonXoff {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.was_let_go |= byte == self.control_bytes[0];
        self.control.receive(now, byte);
    }

    fn next_event(&self) -> Option<Micros> {
        self.control.next_event()
    }

    fn advance(&mut self, now: Micros) {
        self.control.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.control.poll_transmit(now)
    }
}

impl Simulated for XonXoff {
    fn tend(&mut self, now: Micros) {
        if (self.was_let_go || now >= self.punch_after)
            && let Some(program) = self.punch.take()
        {
            self.control.punch(now, program);
        }
    }

    /// The report is a copy of all that came: asked only when it is quiet.
    fn is_busy(&self) -> bool {
        let report = self.control.report();
        self.punch.is_some()
            || report.punch_waiting > 0
            || report.consumed < report.received.count()
            || self.control.holds_line()
    }

    fn is_data(&self, byte: u8) -> bool {
        !self.control_bytes.contains(&byte)
    }
}

pub(super) fn run(simulation: &XonXoffSimulation, screen: &Screen) -> Result<Exit, Failure> {
    let machine = run_machine(XonXoff::new(simulation)?, &simulation.run, screen)?;
    let report = machine.partner().control.report();
    let received = match &report.received {
        Received::Bytes(bytes) => bytes.as_slice(),
        // Only where the options say that no bytes are kept.
        Received::Digest { .. } => &[],
    };
    let as_expected = put_away(received, &simulation.run)?;
    let is_good = report.alarms.is_empty() && as_expected != Some(false);
    screen.say(text(&report));
    say_expected(received, &simulation.run, screen);
    screen.json_line(&document(&report, as_expected, is_good));
    Ok(if is_good { Exit::Done } else { Exit::Failed })
}

fn document(report: &ControlReport, as_expected: Option<bool>, is_good: bool) -> Document {
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
