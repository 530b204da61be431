//! Drip-feeds a program to a simulated FANUC control over a pty in real time,
//! and prints as JSON how often it starved, what it complained of, and how many
//! characters came after each DC3.
//!
//! `feed_fanuc PLUGIN.wasm [BAUD [SECONDS]]`: 38,400 baud for 30 seconds, ISO
//! whose parity the plug-in makes. The control executes at four fifths of the
//! line's rate out of a buffer of 2 KB, with feed holds of a second.

#[path = "common/control.rs"]
mod control;

use std::error::Error;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use control::Machine;
use softplug_abi::LineParameters;
use softplug_host::{Host, HostOptions};
use softplug_live::station::{Station, StationOptions};
use softplug_live::transfer::{SendOptions, SendOutcome, SendReport, send};
use softplug_live::{Port, PortOptions, PortSpec};
use softplug_machines::fanuc::{Report, eight_none_two};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, otherwise: u32| {
        arguments.get(at).map_or(Ok(otherwise), |text| text.parse::<u32>())
    };
    let plugin = PathBuf::from(arguments.first().ok_or("name the plug-in's file")?);
    let line = eight_none_two(number(1, 38_400)?);
    let program = control::program(line, number(2, 30)?);
    // A complaint while the control itself was late says nothing: try again.
    for attempt in 1.. {
        let (control, sent) = run(&plugin, line, &program)?;
        let mut account = control::account(&control, &program);
        account["done"] = (sent.outcome == SendOutcome::Done).into();
        account["seconds"] = sent.elapsed.as_secs_f64().into();
        account["attempt"] = attempt.into();
        if account["inconclusive"] == true && attempt < 5 {
            eprintln!("{account}");
            continue;
        }
        println!("{account}");
        return Ok(());
    }
    Ok(())
}

fn run(
    plugin: &Path,
    line: LineParameters,
    program: &str,
) -> Result<(Report, SendReport), Box<dyn Error>> {
    let machine = Machine::start(line, program)?;
    let host = Host::new(HostOptions::default())?;
    let plugin = host.load(plugin)?;
    let settings = plugin.manifest().resolve_settings([("parity", "software")])?;
    let spec = PortSpec::Device(machine.path().to_owned());
    let port = Port::open(&spec, &PortOptions::new(line))?;
    let options = StationOptions { settings, ..StationOptions::default() };
    let mut station = Station::new(port, plugin.instantiate()?, options)?;
    let request = SendOptions {
        check: plugin.manifest().needs.check_pass,
        size: Some(program.len() as u64),
        ..SendOptions::default()
    };
    let stop = AtomicBool::new(false);
    let sent = send(&mut station, &mut Cursor::new(program), &request, &stop, &mut |_| {});
    Ok((machine.end()?, sent?))
}
