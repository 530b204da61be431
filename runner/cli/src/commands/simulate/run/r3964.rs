//! `softplug simulate r3964` and `r3964-simplified`.

use std::collections::VecDeque;

use serde::Serialize;
use softplug_abi::{LineErrorKind, Micros};
use softplug_machines::r3964::rk512::{self, Computer};
use softplug_machines::r3964::{Noisy, Report, Station};
use softplug_machines::{Partner, Signal};

use super::{put_away, run_machine, say_expected, seconds};
use crate::commands::simulate::R3964Simulation;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::live::machine::Simulated;
use crate::numbers;
use crate::screen::{BAD, Screen};

/// The last line for machines.
#[derive(Serialize)]
struct Document {
    result: &'static str,
    blocks_received: usize,
    bytes_received: usize,
    blocks_sent: usize,
    blocks_failed: usize,
    /// Whole blocks of its own that were sent again.
    repetitions: u32,
    stx: u32,
    naks: u32,
    naks_received: u32,
    conflicts: u32,
    errors: Vec<ErrorDocument>,
    faults: usize,
    disturbances: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    commands: Option<usize>,
    #[serde(skip_serializing_if = "Option::is_none")]
    commands_refused: Option<usize>,
    late_seconds: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    as_expected: Option<bool>,
}

#[derive(Serialize)]
struct ErrorDocument {
    seconds: f64,
    status: u16,
    text: String,
}

/// A machine that speaks the procedure, whatever is above it.
pub(crate) trait Procedure: Partner {
    fn station(&self) -> &Station;
    fn send(&mut self, now: Micros, block: Vec<u8>);
}

impl Procedure for Station {
    fn station(&self) -> &Station {
        self
    }

    fn send(&mut self, now: Micros, block: Vec<u8>) {
        self.send(now, block);
    }
}

/// What it sends are answers only: the command line gives it no blocks.
impl Procedure for Computer {
    fn station(&self) -> &Station {
        self.station()
    }

    fn send(&mut self, _now: Micros, _block: Vec<u8>) {}
}

/// A station behind a line, with what it is to send.
#[derive(Debug)]
pub(crate) struct R3964<P> {
    pub(crate) noisy: Noisy<P>,
    blocks: VecDeque<Vec<u8>>,
    next_at: Micros,
    every: Micros,
}

impl<P: Procedure> R3964<P> {
    pub(crate) fn new(simulation: &R3964Simulation, far: P) -> Self {
        let R3964Simulation { options, noise, blocks, send_after, every, .. } = simulation;
        Self {
            noisy: Noisy::new(far, options.line, *noise),
            blocks: blocks.iter().cloned().collect(),
            next_at: *send_after,
            every: *every,
        }
    }

    pub(crate) fn report(&self) -> &Report {
        self.noisy.inner.station().report()
    }
}

impl<P: Procedure> Partner for R3964<P> {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.noisy.receive(now, byte);
    }

    fn receive_damaged(&mut self, now: Micros, kind: LineErrorKind, byte: Option<u8>) {
        self.noisy.receive_damaged(now, kind, byte);
    }

    fn next_event(&self) -> Option<Micros> {
        let block = self.blocks.front().map(|_| self.next_at);
        [self.noisy.next_event(), block].into_iter().flatten().min()
    }

    fn advance(&mut self, now: Micros) {
        self.tend(now);
        self.noisy.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.noisy.poll_transmit(now)
    }

    fn poll_signal(&mut self, now: Micros) -> Option<Signal> {
        self.noisy.poll_signal(now)
    }
}

impl<P: Procedure> Simulated for R3964<P> {
    fn tend(&mut self, now: Micros) {
        while self.next_at <= now
            && let Some(block) = self.blocks.pop_front()
        {
            self.noisy.inner.send(now, block);
            self.next_at = self.next_at + self.every;
        }
    }

    fn is_busy(&self) -> bool {
        !self.blocks.is_empty() || !self.noisy.inner.station().is_idle()
    }
}

pub(super) fn run(simulation: &R3964Simulation, screen: &Screen) -> Result<Exit, Failure> {
    let Some(memory) = &simulation.memory else {
        let station = Station::new(simulation.options.clone()).map_err(Failure::usage)?;
        let machine = run_machine(R3964::new(simulation, station), &simulation.run, screen)?;
        return conclude(machine.partner(), None, simulation, screen);
    };
    let options = rk512::Options { procedure: simulation.options.clone(), ..Default::default() };
    let mut computer = Computer::new(options).map_err(Failure::usage)?;
    for (area, bytes) in memory {
        computer.memory.set(*area, bytes.clone());
    }
    let machine = run_machine(R3964::new(simulation, computer), &simulation.run, screen)?;
    let served = machine.partner().noisy.inner.served.clone();
    conclude(machine.partner(), Some(&served), simulation, screen)
}

fn conclude<P: Procedure>(
    machine: &R3964<P>,
    served: Option<&[rk512::Served]>,
    simulation: &R3964Simulation,
    screen: &Screen,
) -> Result<Exit, Failure> {
    let report = machine.report();
    let received: Vec<u8> =
        report.received.iter().flat_map(|block| block.data.iter().copied()).collect();
    let as_expected = put_away(&received, &simulation.run)?;
    let failed = report.sent.iter().filter(|block| block.result.is_err()).count();
    let is_good = failed == 0 && as_expected != Some(false);
    let repetitions: u32 = report.sent.iter().map(|block| block.blocks.saturating_sub(1)).sum();
    let errors = report.errors.iter().map(|(at, error)| ErrorDocument {
        seconds: at.as_secs_f64(),
        status: error.status(),
        text: error.to_string(),
    });
    let document = Document {
        result: if is_good { "done" } else { "failed" },
        blocks_received: report.received.len(),
        bytes_received: received.len(),
        blocks_sent: report.sent.len() - failed,
        blocks_failed: failed,
        repetitions,
        stx: report.stx,
        naks: report.naks,
        naks_received: report.naks_received,
        conflicts: report.conflicts,
        errors: errors.collect(),
        faults: report.faults.len(),
        disturbances: machine.noisy.disturbances.len(),
        commands: served.map(<[_]>::len),
        commands_refused: served
            .map(|served| served.iter().filter(|served| served.error != 0).count()),
        late_seconds: report.late.as_secs_f64(),
        as_expected,
    };
    screen.say(text(&document));
    say_expected(&received, &simulation.run, screen);
    screen.json_line(&document);
    Ok(if is_good { Exit::Done } else { Exit::Failed })
}

fn text(document: &Document) -> String {
    let mut lines = vec![format!(
        "received {}, {}",
        numbers::things(document.blocks_received as u64, "block"),
        numbers::bytes(document.bytes_received as u64)
    )];
    if document.blocks_sent + document.blocks_failed > 0 {
        lines.push(format!(
            "sent {}, {}",
            numbers::things(document.blocks_sent as u64, "block"),
            numbers::things(document.repetitions.into(), "repetition")
        ));
    }
    if let (Some(commands), Some(refused)) = (document.commands, document.commands_refused) {
        let commands = numbers::things(commands as u64, "command");
        lines.push(format!("served {commands}, refused {}", numbers::count(refused as u64)));
    }
    let counts = [
        (u64::from(document.naks), "NAK", "sent"),
        (u64::from(document.naks_received), "NAK", "received"),
        (u64::from(document.conflicts), "conflict", "met"),
        (document.faults as u64, "fault", "made on purpose"),
        (document.disturbances as u64, "character", "disturbed on the line"),
    ];
    for (count, thing, what) in counts.into_iter().filter(|(count, ..)| *count > 0) {
        lines.push(format!("{} {what}", numbers::things(count, thing)));
    }
    for error in document.errors.iter().take(10) {
        let at = seconds(Micros((error.seconds * 1e6) as i64));
        lines.push(format!("at {at}: {} (status {:04X})", error.text, error.status));
    }
    if document.errors.len() > 10 {
        lines.push(format!(
            "and {} more",
            numbers::things(document.errors.len() as u64 - 10, "error")
        ));
    }
    if document.blocks_failed > 0 {
        let failed = numbers::things(document.blocks_failed as u64, "block");
        lines.push(format!("{BAD}NOT ACKNOWLEDGED{BAD:#}: {failed}"));
    }
    lines.join("\n")
}
