//! `softplug simulate pulse-lathe`.

use serde::Serialize;
use softplug_abi::Micros;
use softplug_machines::pulse_lathe::{Lathe, LatheReport, PERIOD};
use softplug_machines::{Clocked, Partner};

use super::{put_away, run_machine, say_expected, seconds};
use crate::commands::simulate::PulseLatheSimulation;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::live::machine::Simulated;
use crate::numbers;
use crate::screen::{BAD, Screen};

/// The last line for machines.
#[derive(Serialize)]
struct Document {
    result: &'static str,
    bytes: u64,
    x_pulses: u64,
    z_pulses: u64,
    x_millimetres: f64,
    z_millimetres: f64,
    gaps: u64,
    missing_periods: u64,
    longest_gap_seconds: f64,
    lost_pulses: u64,
    holds: u32,
    stops: u32,
    programs: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    as_expected: Option<bool>,
}

/// A lathe behind its port, with all that it got.
#[derive(Debug)]
struct PulseLathe {
    port: Clocked<Lathe>,
    received: Vec<u8>,
}

impl Partner for PulseLathe {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.received.push(byte);
        self.port.receive(now, byte);
    }

    fn next_event(&self) -> Option<Micros> {
        self.port.next_event()
    }

    fn advance(&mut self, now: Micros) {
        self.port.advance(now);
    }

    fn poll_transmit(&mut self, now: Micros) -> Option<u8> {
        self.port.poll_transmit(now)
    }
}

impl Simulated for PulseLathe {
    fn tend(&mut self, _now: Micros) {}

    fn is_busy(&self) -> bool {
        let lathe = self.port.machine();
        let report = lathe.report();
        self.port.waiting() > 0 || lathe.is_busy() || report.programs == 0 && report.stops == 0
    }

    /// The spindle's characters are not what a transfer consists of.
    fn is_data(&self, byte: u8) -> bool {
        byte >= 0x80
    }
}

pub(super) fn run(simulation: &PulseLatheSimulation, screen: &Screen) -> Result<Exit, Failure> {
    let lathe = Lathe::new(simulation.options.clone()).map_err(Failure::usage)?;
    let partner = PulseLathe { port: Clocked::new(lathe, PERIOD), received: Vec::new() };
    let machine = run_machine(partner, &simulation.run, screen)?;
    let PulseLathe { port, received } = machine.partner();
    let lathe = port.machine();
    if let Some(picture) = &simulation.picture {
        files::write_picture(picture, &lathe.picture(), "--picture")?;
    }
    let report = lathe.report();
    let as_expected = put_away(received, &simulation.run)?;
    say(report, screen);
    say_expected(received, &simulation.run, screen);
    let is_good = report.gaps == 0 && report.lost_pulses == 0 && as_expected != Some(false);
    screen.json_line(&Document {
        result: if is_good { "good" } else { "bad" },
        bytes: report.bytes,
        x_pulses: report.x_pulses,
        z_pulses: report.z_pulses,
        x_millimetres: report.x_millimetres(),
        z_millimetres: report.z_millimetres(),
        gaps: report.gaps,
        missing_periods: report.missing_periods,
        longest_gap_seconds: report.longest_gap.as_secs_f64(),
        lost_pulses: report.lost_pulses,
        holds: report.holds,
        stops: report.stops,
        programs: report.programs,
        as_expected,
    });
    Ok(if is_good { Exit::Done } else { Exit::Failed })
}

fn say(report: &LatheReport, screen: &Screen) {
    screen.say(format_args!(
        "{} received: {} pulses of x, {} of z",
        numbers::bytes(report.bytes),
        report.x_pulses,
        report.z_pulses
    ));
    screen.say(format_args!(
        "x stands {:.3} mm from where it began, z {:.2} mm",
        report.x_millimetres(),
        report.z_millimetres()
    ));
    if report.gaps == 0 {
        screen.say("no gap inside a cut");
    } else {
        screen.say(format_args!(
            "{BAD}{} gaps inside cuts{BAD:#}: {} periods missing, the longest {}",
            report.gaps,
            report.missing_periods,
            seconds(report.longest_gap)
        ));
    }
    if report.lost_pulses > 0 {
        screen
            .say(format_args!("{BAD}{} pulses lost at a limit switch{BAD:#}", report.lost_pulses));
    }
}
