//! `softplug simulate xmodem`.

use serde::Serialize;
use softplug_abi::Micros;
use softplug_machines::xmodem::{Control, Options, Report};

use super::{put_away, run_machine, say_expected};
use crate::commands::simulate::XmodemSimulation;
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
    blocks: u32,
    received: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    as_expected: Option<bool>,
}

impl Simulated for Control {
    fn tend(&mut self, _now: Micros) {}

    fn is_busy(&self) -> bool {
        let report = self.report();
        self.is_under_way() || report.done + report.failed == 0
    }

    /// Calls are none: they come for ever.
    fn is_data(&self, _byte: u8) -> bool {
        self.is_under_way() || self.report().is_over
    }
}

pub(super) fn run(simulation: &XmodemSimulation, screen: &Screen) -> Result<Exit, Failure> {
    let options = Options { rest: Some(REST), ..simulation.options.clone() };
    let machine = run_machine(Control::new(options), &simulation.run, screen)?;
    let control = machine.partner();
    let Report { came, done, failed, blocks, .. } = control.report();
    // One that was broken off has failed.
    let failed = failed + u32::from(control.is_under_way());
    let as_expected = put_away(came, &simulation.run)?;
    let is_good = *done > 0 && failed == 0 && as_expected != Some(false);
    let transfers = numbers::things(u64::from(*done), "transfer");
    screen.say(format_args!(
        "{transfers} done, {} in all",
        numbers::things(u64::from(*blocks), "block")
    ));
    if failed > 0 {
        screen.say(format_args!(
            "{BAD}{} failed{BAD:#}",
            numbers::things(u64::from(failed), "transfer")
        ));
    }
    say_expected(came, &simulation.run, screen);
    screen.json_line(&Document {
        result: if is_good { "done" } else { "failed" },
        done: *done,
        failed,
        blocks: *blocks,
        received: came.len(),
        as_expected,
    });
    Ok(if is_good { Exit::Done } else { Exit::Failed })
}
