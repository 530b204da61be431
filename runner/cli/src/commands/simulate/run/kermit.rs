//! `softplug simulate kermit`.

use serde::Serialize;
use softplug_abi::Micros;
use softplug_machines::kermit::{Machine, Options, Report};

use super::{put_away, run_machine, say_expected};
use crate::commands::simulate::KermitSimulation;
use crate::exit::Exit;
use crate::failure::Failure;
use crate::live::machine::Simulated;
use crate::numbers;
use crate::screen::{BAD, Screen};

/// Behind a transfer it begins anew after so long.
const REST: Micros = Micros::from_secs(3);

/// The last line for machines.
#[derive(Serialize)]
struct Document {
    result: &'static str,
    done: u32,
    failed: u32,
    packets: u32,
    received: usize,
    name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    as_expected: Option<bool>,
}

impl Simulated for Machine {
    fn tend(&mut self, _now: Micros) {}

    fn is_busy(&self) -> bool {
        let report = self.report();
        self.is_under_way() || report.done + report.failed == 0
    }

    /// What it begins by itself, for ever, is none.
    fn is_data(&self, _byte: u8) -> bool {
        self.is_under_way() || self.report().is_over
    }
}

pub(super) fn run(simulation: &KermitSimulation, screen: &Screen) -> Result<Exit, Failure> {
    // Only one transfer is asked for, or one behind the other.
    let rest = simulation.run.quiet_time.is_none().then_some(REST);
    let options = Options { rest, ..simulation.options.clone() };
    let machine = run_machine(Machine::new(options), &simulation.run, screen)?;
    let machine = machine.partner();
    let Report { name, came, done, failed, packets, error, .. } = machine.report();
    // One that was broken off has failed.
    let failed = failed + u32::from(machine.is_under_way());
    let as_expected = put_away(came, &simulation.run)?;
    let is_good = *done > 0 && failed == 0 && as_expected != Some(false);
    screen.say(format_args!(
        "{} done, {} in all",
        numbers::things(u64::from(*done), "transfer"),
        numbers::things(u64::from(*packets), "packet")
    ));
    if !name.is_empty() {
        let came = numbers::bytes(came.len() as u64);
        screen.say(format_args!("came: {came}, called {}", name.escape_debug()));
    }
    if failed > 0 {
        let failed = numbers::things(u64::from(failed), "transfer");
        let why =
            if error.is_empty() { String::new() } else { format!(": {}", error.escape_debug()) };
        screen.say(format_args!("{BAD}{failed} failed{BAD:#}{why}"));
    }
    say_expected(came, &simulation.run, screen);
    screen.json_line(&Document {
        result: if is_good { "done" } else { "failed" },
        done: *done,
        failed,
        packets: *packets,
        received: came.len(),
        name: name.clone(),
        as_expected,
    });
    Ok(if is_good { Exit::Done } else { Exit::Failed })
}
