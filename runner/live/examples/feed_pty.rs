//! Feeds a program to a simulated control over a pty in real time, and prints
//! as JSON how the line was used and how many characters came after each XOFF.
//!
//! `feed_pty PLUGIN.wasm [BAUD [BYTES [BUFFER [RATE]]]]`: baud 921600, 1,000,000
//! bytes, a buffer of 512 bytes, the control executes RATE bytes per second
//! (half the line's rate).

use std::error::Error;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use softplug_abi::{LineParameters, Micros};
use softplug_host::{Host, HostOptions};
use softplug_live::simulator::Simulator;
use softplug_live::station::{Station, StationOptions};
use softplug_live::transfer::{SendOptions, SendOutcome, SendReport, send};
use softplug_live::{Port, PortOptions};
use softplug_machines::xon_xoff::{Control, ControlOptions, ControlReport};

/// The control's own lateness past which an overflow says nothing.
const INCONCLUSIVE: Micros = Micros::from_millis(1);

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, otherwise: u64| {
        arguments.get(at).map_or(Ok(otherwise), |text| text.parse::<u64>())
    };
    let plugin = PathBuf::from(arguments.first().ok_or("name the plug-in's file")?);
    let line = LineParameters::new(u32::try_from(number(1, 921_600)?)?);
    let per_second = u64::from(line.baud) / 10;
    let (bytes, buffer) = (number(2, 1_000_000)?, number(3, 512)?);
    let rate = number(4, per_second / 2)?;
    let program: Vec<u8> = program(usize::try_from(bytes)?);
    // An overflow while the control itself was late says nothing: try again.
    for attempt in 1.. {
        let (control, sent) = run(&plugin, line, &program, usize::try_from(buffer)?, rate)?;
        let is_inconclusive = !control.alarms.is_empty() && control.late > INCONCLUSIVE;
        if is_inconclusive && attempt < 5 {
            continue;
        }
        print(&control, &sent, line, &program, attempt);
        return Ok(());
    }
    Ok(())
}

fn program(bytes: usize) -> Vec<u8> {
    let block =
        |n: usize| format!("N{:05} G1 X{}.{:03} Y-{}\n", n % 100_000, n % 90, n % 1_000, n % 70);
    let mut program: Vec<u8> = (0..).flat_map(|n| block(n).into_bytes()).take(bytes).collect();
    program.truncate(bytes);
    program
}

fn run(
    plugin: &Path,
    line: LineParameters,
    program: &[u8],
    buffer: usize,
    rate: u64,
) -> Result<(ControlReport, SendReport), Box<dyn Error>> {
    let options = ControlOptions {
        line,
        buffer,
        low: buffer / 4,
        high: buffer / 2,
        rate: u32::try_from(rate)?,
        ..ControlOptions::default()
    };
    let mut simulator = Simulator::new(Control::new(options)?)?;
    let port = simulator.port();
    let done = Arc::new(AtomicBool::new(false));
    let ended = Arc::clone(&done);
    let machine = thread::spawn(move || {
        while !ended.load(Ordering::Relaxed) {
            simulator.turn(simulator.now() + Micros::from_millis(20))?;
        }
        // What is still in its buffer is executed.
        let end = simulator.now() + Micros::from_millis(100);
        while simulator.now() < end {
            simulator.turn(end)?;
        }
        Ok::<_, softplug_live::PortError>(simulator.partner.report())
    });
    let host = Host::new(HostOptions::default())?;
    let plugin = host.load(plugin)?;
    let settings = plugin.manifest().resolve_settings([])?;
    let port = Port::open(&port, &PortOptions::new(line))?;
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

fn print(
    control: &ControlReport,
    sent: &SendReport,
    line: LineParameters,
    program: &[u8],
    attempt: u32,
) {
    let line_rate = f64::from(line.baud) * 2.0 / f64::from(line.half_bits());
    println!(
        "{}",
        serde_json::json!({
            "identical": control.received.matches(program),
            "done": sent.outcome == SendOutcome::Done,
            "overflows": control.alarms.len(),
            "holds": control.holds,
            "held_seconds": control.held.as_secs_f64(),
            "seconds": sent.elapsed.as_secs_f64(),
            "line_use_while_allowed": control.rate_while_allowed() / line_rate,
            "after_xoff_p50": control.characters_after_xoff.percentile(50),
            "after_xoff_p99": control.characters_after_xoff.percentile(99),
            "after_xoff_max": control.characters_after_xoff.max(),
            "control_late_micros": control.late.0,
            "attempt": attempt,
        })
    );
}
