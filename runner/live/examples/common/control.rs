//! A simulated FANUC control on a pty that is drip-fed in real time, and a
//! program for it.
#![allow(unreachable_pub)]

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use softplug_abi::{LineParameters, Micros};
use softplug_live::PortError;
use softplug_live::simulator::Simulator;
use softplug_machines::fanuc::{Control, FeedHold, Feeding, Options, Parity, Press, Report};

/// The control's own lateness past which a complaint says nothing.
pub const INCONCLUSIVE: Micros = Micros::from_millis(1);
/// Characters that a control must take after DC3.
const TOLERATED: u32 = 10;
/// The first line, which a control skips.
const LABEL: &str = "%\n";

/// Blocks of 14 to 40 characters, 25 on the average: as many as the control
/// executes in `seconds`, at four fifths of the line's rate.
pub fn program(line: LineParameters, seconds: u32) -> String {
    let per_second = 2 * line.baud / line.half_bits();
    let characters = (per_second * 4 / 5 * seconds) as usize;
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

/// A control with a buffer of 2 KB and two feed holds of a second, which a person
/// has told to read.
pub struct Machine {
    path: PathBuf,
    has_ended: Arc<AtomicBool>,
    thread: JoinHandle<Result<Report, PortError>>,
}

impl Machine {
    pub fn start(line: LineParameters, program: &str) -> Result<Self, Box<dyn Error>> {
        let blocks = program.matches('\n').count() as i64;
        let block_time = Micros(line.characters(program.len() as u64).0 * 5 / 4 / blocks);
        let hold = |share: i64| FeedHold {
            after: (blocks * share / 100) as u64,
            span: Micros::from_secs(1),
        };
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
        let path = PathBuf::from(simulator.port().to_string());
        let has_ended = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&has_ended);
        let thread = thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                simulator.turn(simulator.now() + Micros::from_millis(20))?;
            }
            // What is still on the pty is read.
            let end = simulator.now() + Micros::from_millis(200);
            while simulator.now() < end {
                simulator.turn(end)?;
            }
            Ok(simulator.partner.report())
        });
        Ok(Self { path, has_ended, thread })
    }

    /// The port to open.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The control is switched off; what it saw.
    pub fn end(self) -> Result<Report, Box<dyn Error>> {
        self.has_ended.store(true, Ordering::Relaxed);
        Ok(self.thread.join().map_err(|_| "the simulated control panicked")??)
    }
}

pub fn is_clean(control: &Report) -> bool {
    control.alarms.is_empty()
        && control.starved == 0
        && control.characters_after_dc3.max() <= TOLERATED
}

/// What the control saw, the program being what it was to read.
pub fn account(control: &Report, program: &str) -> serde_json::Value {
    let alarms: Vec<u16> = control.alarms.iter().map(|alarm| alarm.kind.number()).collect();
    serde_json::json!({
        "identical": control.received.matches(&program.as_bytes()[LABEL.len()..]),
        "inconclusive": !is_clean(control) && control.late > INCONCLUSIVE,
        "characters": control.arrived,
        "alarms": alarms,
        "starved": control.starved,
        "starved_seconds": control.starved_for.as_secs_f64(),
        "holds": control.holds,
        "held_seconds": control.held.as_secs_f64(),
        "after_dc3_p50": control.characters_after_dc3.percentile(50),
        "after_dc3_p99": control.characters_after_dc3.percentile(99),
        "after_dc3_max": control.characters_after_dc3.max(),
        "control_late_micros": control.late.0,
    })
}
