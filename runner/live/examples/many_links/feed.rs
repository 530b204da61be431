//! A control that is drip-fed at 19,200 baud, beside lines that are full.

use std::time::Duration;

use softplug_live::pty::PtyPair;
use softplug_machines::fanuc::eight_none_two;

use super::control::{self, Machine};
use super::subject::{Subject, Wanted};
use super::{Outcome, saturate};

const BAUD: u32 = 19_200;
/// The control starts to cut late, and holds now and then.
const LONGER: u64 = 15;

pub fn run(
    subject: &mut Subject,
    machines: &[PtyPair],
    plugin: &str,
    depth: u32,
    seconds: u64,
) -> Outcome<serde_json::Value> {
    let line = eight_none_two(BAUD);
    let program = control::program(line, u32::try_from(seconds)?);
    let machine = Machine::start(line, &program)?;
    let mut wanted = Wanted::new(machine.path(), plugin, BAUD, depth)?;
    wanted.0["stop_half_bits"] = line.stop_half_bits.into();
    wanted.0["settings"] = serde_json::json!({"parity": "software"});
    wanted.0["program"] = program.as_str().into();
    subject.add(&[wanted])?;
    subject.begin()?;
    let mut result = saturate::both_ways(subject, machines, Duration::from_secs(seconds + LONGER))?;
    result["control"] = control::account(&machine.end()?, &program);
    result["job"] = subject.answer()?.into();
    Ok(result)
}
