//! `softplug simulate`.

mod fanuc;
mod kermit;
mod pulse_lathe;
mod r3964;
mod script;
mod xmodem;
mod xon_xoff;

#[cfg(target_os = "linux")]
pub(in crate::commands) use fanuc::Fanuc;
#[cfg(target_os = "linux")]
pub(in crate::commands) use r3964::R3964;
#[cfg(target_os = "linux")]
pub(in crate::commands) use xon_xoff::XonXoff;

use serde::Serialize;
use softplug_abi::Micros;
use softplug_machines::kept::Counts;

use crate::commands::simulate::{RunOptions, Simulation};
use crate::exit::Exit;
use crate::failure::Failure;
use crate::files;
use crate::live::machine::{Machine, Simulated};
use crate::numbers;
use crate::screen::{BAD, GOOD, Screen};
use crate::stop;

pub(crate) fn simulate(simulation: &Simulation, screen: &Screen) -> Result<Exit, Failure> {
    match simulation {
        Simulation::XonXoff(simulation) => xon_xoff::run(simulation, screen),
        Simulation::R3964(simulation) => r3964::run(simulation, screen),
        Simulation::Fanuc(simulation) => fanuc::run(simulation, screen),
        Simulation::PulseLathe(simulation) => pulse_lathe::run(simulation, screen),
        Simulation::Kermit(simulation) => kermit::run(simulation, screen),
        Simulation::Xmodem(simulation) => xmodem::run(simulation, screen),
        Simulation::Script(simulation) => script::run(simulation, screen),
    }
}

/// The first line for machines.
#[derive(Serialize)]
struct Ready {
    port: String,
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

/// Says where the machine is to be found, and lets it work to its end.
fn run_machine<P: Simulated>(
    partner: P,
    options: &RunOptions,
    screen: &Screen,
) -> Result<Machine<P>, Failure> {
    let stop = stop::on_signals()?;
    let mut machine = match options.listen {
        Some(address) => Machine::listen(address, partner, options.quiet_time)?,
        None => Machine::new(partner, options.quiet_time)?,
    };
    let port = machine.port().to_string();
    screen.say(&port);
    screen.json_line(&Ready { port });
    machine.run(&stop)?;
    Ok(machine)
}

/// Writes what was received where it is wanted; whether it is what was expected.
fn put_away(received: &[u8], options: &RunOptions) -> Result<Option<bool>, Failure> {
    if let Some(out) = &options.out {
        std::fs::write(out, received).map_err(|error| files::unwritable(out, &error))?;
    }
    Ok(options.expect.as_ref().map(|expected| expected == received))
}

fn say_expected(received: &[u8], options: &RunOptions, screen: &Screen) {
    match &options.expect {
        None => {}
        Some(expected) if expected == received => {
            screen.say(format_args!("{GOOD}as expected{GOOD:#}"));
        }
        Some(expected) => screen
            .say(format_args!("{BAD}not as expected{BAD:#}: {}", difference(expected, received))),
    }
}

fn seconds(span: Micros) -> String {
    format!("{:.3} s", span.as_secs_f64())
}

/// Where two files part.
pub(crate) fn difference(expected: &[u8], received: &[u8]) -> String {
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
