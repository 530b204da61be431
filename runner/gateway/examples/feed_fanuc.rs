//! Drip-feeds a program to a simulated FANUC control over a pty in real time,
//! and prints as JSON how often it starved, what it complained of, and how many
//! characters came after each DC3.
//!
//! `feed_fanuc PLUGIN.wasm [BAUD [SECONDS]]`: 38,400 baud for 30 seconds, ISO
//! whose parity the plug-in makes. The control executes at four fifths of the
//! line's rate out of a buffer of 2 KB, with feed holds of a second.

use std::error::Error;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use softplug_abi::{LineParameters, Micros};
use softplug_conformance::partners::fanuc::{
    Control, FeedHold, Feeding, Options, Parity, Press, Report, eight_none_two,
};
use softplug_gateway::simulator::Simulator;
use softplug_gateway::station::{Station, StationOptions};
use softplug_gateway::transfer::{SendOptions, SendOutcome, SendReport, send};
use softplug_gateway::{Port, PortOptions, PortSpec};
use softplug_host::{Host, HostOptions};

/// The control's own lateness past which a complaint says nothing.
const INCONCLUSIVE: Micros = Micros::from_millis(1);
/// Characters that a control must take after DC3.
const TOLERATED: u32 = 10;
/// The first line, which a control skips.
const LABEL: &str = "%\n";

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, otherwise: u32| {
        arguments.get(at).map_or(Ok(otherwise), |text| text.parse::<u32>())
    };
    let plugin = PathBuf::from(arguments.first().ok_or("name the plug-in's file")?);
    let line = eight_none_two(number(1, 38_400)?);
    let seconds = number(2, 30)?;
    let per_second = 2 * line.baud / line.half_bits();
    let program = program((per_second * 4 / 5 * seconds) as usize);
    // A complaint while the control itself was late says nothing: try again.
    for attempt in 1.. {
        let (control, sent) = run(&plugin, line, &program)?;
        let is_inconclusive = !is_clean(&control) && control.late > INCONCLUSIVE;
        let account = account(&control, &sent, &program, attempt, is_inconclusive);
        if is_inconclusive && attempt < 5 {
            eprintln!("{account}");
            continue;
        }
        println!("{account}");
        return Ok(());
    }
    Ok(())
}

/// Blocks of 14 to 40 characters, 25 on the average.
fn program(characters: usize) -> String {
    let block = |n: usize| {
        let (x, y, z) = (n % 1_000, n / 7 % 1_000, n * n % 9_973);
        match n % 3 {
            0 => format!("N{} G1 X{x:03}.{y:03} Y-{y:03}.{x:03} Z{z:04}.\n", n % 100_000),
            1 => format!("X{x:03}.{y:03} Z-{z:04}.\n"),
            _ => format!("Y-{y:03}.{x:03} F{}\n", 100 + n % 900),
        }
    };
    let mut program = LABEL.to_owned();
    for n in 0.. {
        program += &block(n);
        if program.len() >= characters {
            break;
        }
    }
    program + "M30\n%"
}

fn run(
    plugin: &Path,
    line: LineParameters,
    program: &str,
) -> Result<(Report, SendReport), Box<dyn Error>> {
    let blocks = program.matches('\n').count() as i64;
    let block_time = Micros(line.characters(program.len() as u64).0 * 5 / 4 / blocks);
    let hold =
        |share: i64| FeedHold { after: (blocks * share / 100) as u64, span: Micros::from_secs(1) };
    let options = Options {
        line,
        parity: Parity::Software,
        buffer: 2_048,
        reserve: 64,
        resume: 512,
        block_time,
        feeding: Feeding::Drip { cycle_start: 1_024, feed_holds: vec![hold(30), hold(60)] },
        panel: vec![(Micros::from_millis(300), Press::Read)],
        ..Options::default()
    };
    let mut simulator = Simulator::new(Control::new(options)?)?;
    let path = simulator.path().to_owned();
    let done = Arc::new(AtomicBool::new(false));
    let ended = Arc::clone(&done);
    let machine = thread::spawn(move || {
        while !ended.load(Ordering::Relaxed) {
            simulator.turn(simulator.now() + Micros::from_millis(20))?;
        }
        // What is still on the pty is read.
        let end = simulator.now() + Micros::from_millis(200);
        while simulator.now() < end {
            simulator.turn(end)?;
        }
        Ok::<_, softplug_gateway::PortError>(simulator.partner.report())
    });
    let host = Host::new(HostOptions::default())?;
    let plugin = host.load(plugin)?;
    let settings = plugin.manifest().resolve_settings([("parity", "software")])?;
    let port = Port::open(&PortSpec::Device(path), &PortOptions::new(line))?;
    let options = StationOptions { settings, ..StationOptions::default() };
    let mut station = Station::new(port, plugin.instantiate()?, options)?;
    let request = SendOptions {
        check: plugin.manifest().needs.check_pass,
        size: Some(program.len() as u64),
        ..SendOptions::default()
    };
    let stop = AtomicBool::new(false);
    let sent = send(&mut station, &mut Cursor::new(program), &request, &stop, &mut |_| {});
    done.store(true, Ordering::Relaxed);
    let report = machine.join().map_err(|_| "the simulated control panicked")??;
    Ok((report, sent?))
}

fn is_clean(control: &Report) -> bool {
    control.alarms.is_empty()
        && control.starved == 0
        && control.characters_after_dc3.max() <= TOLERATED
}

fn account(
    control: &Report,
    sent: &SendReport,
    program: &str,
    attempt: u32,
    is_inconclusive: bool,
) -> serde_json::Value {
    let alarms: Vec<u16> = control.alarms.iter().map(|alarm| alarm.kind.number()).collect();
    serde_json::json!({
            "identical": control.received.matches(&program.as_bytes()[LABEL.len()..]),
            "done": sent.outcome == SendOutcome::Done,
            "inconclusive": is_inconclusive,
            "characters": control.arrived,
            "seconds": sent.elapsed.as_secs_f64(),
            "alarms": alarms,
            "starved": control.starved,
            "starved_seconds": control.starved_for.as_secs_f64(),
            "holds": control.holds,
            "held_seconds": control.held.as_secs_f64(),
            "after_dc3_p50": control.characters_after_dc3.percentile(50),
            "after_dc3_p99": control.characters_after_dc3.percentile(99),
            "after_dc3_max": control.characters_after_dc3.max(),
            "control_late_micros": control.late.0,
            "attempt": attempt,
    })
}
