//! `softplug simulate fanuc-rs232`.

use serde::Serialize;
use softplug_abi::{LineErrorKind, Micros};
use softplug_machines::fanuc::{AlarmKind, Control, Report};
use softplug_machines::kept::Received;
use softplug_machines::{Partner, Signal};

use super::{Distribution, put_away, run_machine, say_expected, seconds};
use crate::commands::simulate::FanucSimulation;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::live::machine::Simulated;
use crate::numbers;
use crate::screen::{BAD, Screen};

/// Longer than a press takes to show.
const A_MOMENT: Micros = Micros::from_millis(500);

/// The last line for machines.
#[derive(Serialize)]
struct Document {
    result: &'static str,
    received: u64,
    programs: u32,
    blocks: u64,
    alarms: Vec<AlarmDocument>,
    holds: u32,
    held_seconds: f64,
    after_dc3: Distribution,
    ignored: u64,
    before_dc1: u64,
    starved: u32,
    starved_seconds: f64,
    largest_level: usize,
    punches: u32,
    punched: u64,
    punched_after_dc3: Distribution,
    #[serde(skip_serializing_if = "Option::is_none")]
    remote: Option<RemoteDocument>,
    /// How late the control itself was at worst: an alarm with a large one proves nothing.
    late_seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    as_expected: Option<bool>,
}

#[derive(Serialize)]
struct AlarmDocument {
    number: u16,
    seconds: f64,
    position: u64,
}

#[derive(Serialize)]
struct RemoteDocument {
    sent: u32,
    received: u32,
    data: u32,
    waits: u32,
    retries_asked: u32,
    retries_heard: u32,
    silences: u32,
    faults: Vec<String>,
}

/// A control whose operator does what was asked for.
#[derive(Debug)]
pub(crate) struct Fanuc {
    pub(crate) control: Control,
    last_press: Micros,
    now: Micros,
}

impl Fanuc {
    pub(crate) fn new(simulation: &FanucSimulation) -> Result<Self, Failure> {
        let control = Control::new(simulation.options.clone()).map_err(Failure::usage)?;
        Ok(Self { control, last_press: simulation.last_press, now: Micros::ZERO })
    }
}

impl Partner for Fanuc {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.control.receive(now, byte);
    }

    fn receive_damaged(&mut self, now: Micros, _kind: LineErrorKind, _byte: Option<u8>) {
        self.control.receive_damaged(now);
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

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        self.control.poll_signal(now)
    }
}

impl Simulated for Fanuc {
    fn tend(&mut self, now: Micros) {
        self.now = now;
    }

    /// What the operator does last needs a moment to show.
    fn is_busy(&self) -> bool {
        self.now <= self.last_press + A_MOMENT || !self.control.is_idle()
    }
}

pub(super) fn run(simulation: &FanucSimulation, screen: &Screen) -> Result<Exit, Failure> {
    let machine = run_machine(Fanuc::new(simulation)?, &simulation.run, screen)?;
    let report = machine.partner().control.report();
    let received = match &report.received {
        Received::Bytes(bytes) => bytes.as_slice(),
        // Only where the options say that no bytes are kept.
        Received::Digest { .. } => &[],
    };
    let as_expected = put_away(received, &simulation.run)?;
    let has_faults = !report.remote.faults.is_empty();
    let is_good = report.alarms.is_empty() && !has_faults && as_expected != Some(false);
    screen.say(text(&report));
    say_expected(received, &simulation.run, screen);
    screen.json_line(&document(&report, as_expected, is_good));
    Ok(if is_good { Exit::Done } else { Exit::Failed })
}

fn document(report: &Report, as_expected: Option<bool>, is_good: bool) -> Document {
    let alarms = report.alarms.iter().map(|alarm| AlarmDocument {
        number: alarm.kind.number(),
        seconds: alarm.at.as_secs_f64(),
        position: alarm.position,
    });
    let remote = &report.remote;
    let remote = (remote.sent > 0).then(|| RemoteDocument {
        sent: remote.sent,
        received: remote.received,
        data: remote.data,
        waits: remote.waits,
        retries_asked: remote.retries_asked,
        retries_heard: remote.retries_heard,
        silences: remote.silences,
        faults: remote.faults.clone(),
    });
    Document {
        result: if is_good { "done" } else { "failed" },
        received: report.received.count(),
        programs: report.programs,
        blocks: report.blocks,
        alarms: alarms.collect(),
        holds: report.holds,
        held_seconds: report.held.as_secs_f64(),
        after_dc3: (&report.characters_after_dc3).into(),
        ignored: report.ignored,
        before_dc1: report.before_dc1,
        starved: report.starved,
        starved_seconds: report.starved_for.as_secs_f64(),
        largest_level: report.largest_level,
        punches: report.punches,
        punched: report.punched,
        punched_after_dc3: (&report.punched_after_dc3).into(),
        remote,
        late_seconds: report.late.as_secs_f64(),
        as_expected,
    }
}

fn text(report: &Report) -> String {
    let mut lines = vec![format!(
        "read {}, {}, {}",
        numbers::things(report.programs.into(), "program"),
        numbers::things(report.blocks, "block"),
        numbers::things(report.received.count(), "character")
    )];
    if report.holds > 0 {
        let Distribution { p50, p99, max } = (&report.characters_after_dc3).into();
        lines.push(format!(
            "held the line {}, {} in all",
            numbers::things(report.holds.into(), "time"),
            seconds(report.held)
        ));
        lines.push(format!("characters after DC3: p50 {p50}, p99 {p99}, most {max}"));
    }
    if report.starved > 0 {
        lines.push(format!(
            "execution waited {} for a block, {} in all",
            numbers::things(report.starved.into(), "time"),
            seconds(report.starved_for)
        ));
    }
    if report.before_dc1 > 0 {
        let lost = numbers::things(report.before_dc1, "character");
        lines.push(format!("{lost} came before DC1 and were lost"));
    }
    if report.punches > 0 {
        lines.push(format!(
            "punched {}, {}",
            numbers::things(report.punches.into(), "program"),
            numbers::things(report.punched, "character")
        ));
    }
    if report.remote.sent > 0 {
        lines.push(format!(
            "remote buffer: {} sent, {} received, {} with data",
            numbers::things(report.remote.sent.into(), "message"),
            numbers::count(report.remote.received.into()),
            numbers::count(report.remote.data.into())
        ));
        lines
            .extend(report.remote.faults.iter().map(|fault| format!("{BAD}FAULT{BAD:#}: {fault}")));
    }
    if report.alarms.is_empty() {
        lines.push("no alarm".to_owned());
    }
    for alarm in report.alarms.iter().take(10) {
        lines.push(format!(
            "{BAD}ALARM {:03}{BAD:#} at {}, character {}: {}",
            alarm.kind.number(),
            seconds(alarm.at),
            numbers::count(alarm.position),
            meaning(alarm.kind)
        ));
        if alarm.late > Micros::from_millis(1) {
            lines.push(format!(
                "the simulation itself was {} late: the computer was busy, try again",
                seconds(alarm.late)
            ));
        }
    }
    lines.join("\n")
}

fn meaning(kind: AlarmKind) -> &'static str {
    match kind {
        AlarmKind::Th => "parity (TH), or a character that the control does not know",
        AlarmKind::Tv => "a block with an odd number of characters (TV)",
        AlarmKind::LineError => "overrun, parity or framing",
        AlarmKind::NotReady => "the host's ready line went off",
        AlarmKind::BufferOverflow => "more characters after DC3 than are tolerated",
    }
}
