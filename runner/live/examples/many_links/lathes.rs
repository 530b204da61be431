//! Lathes without a control, which take every feed pulse from the gateway, beside lines that are
//! full. Each has a port that clocks a byte out every 250 µs; if that runs dry inside a cut, there is
//! a gap. Every byte is compared with the program's lines, reckoned here.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde_json::{Value, json};
use softplug_abi::Micros;
use softplug_live::PortError;
use softplug_live::pty::PtyPair;
use softplug_live::simulator::Simulator;
use softplug_machines::pulse_lathe::{Lathe, LatheOptions, PERIOD};
use softplug_machines::{Clocked, Partner};

use super::subject::{Subject, Wanted};
use super::{Outcome, saturate};

const BAUD: u32 = 40_000;
const PERIODS_A_SECOND: u64 = 4_000;
/// The program begins when all is set up, and may end late.
const LONGER: u64 = 12;

/// Moves of a pass, in pulses of x and z; all at the highest feed, a pulse each period.
const PASS: [(i64, i64); 7] =
    [(-120, 0), (0, -4_000), (100, 0), (0, 4_000), (-70, -1_234), (90, 1_200), (0, 34)];

/// What is asked for.
pub struct Wish<'a> {
    pub plugin: &'a str,
    pub count: usize,
    /// Bytes in the port at most.
    pub depth: u32,
    pub seconds: u64,
}

pub fn run(subject: &mut Subject, machines: &[PtyPair], wish: &Wish<'_>) -> Outcome<Value> {
    let passes = wish.seconds * PERIODS_A_SECOND / periods(&PASS) + 1;
    let mut running = Vec::new();
    for _ in 0..wish.count {
        let lathe = Running::start(passes)?;
        let mut wanted = Wanted::new(&lathe.path, wish.plugin, BAUD, wish.depth)?;
        wanted.0["settings"] = json!({"input": "iso"});
        wanted.0["program"] = program(passes).into();
        subject.add(&[wanted])?;
        running.push(lathe);
    }
    subject.begin()?;
    let span = Duration::from_secs(wish.seconds + LONGER);
    let mut result = saturate::both_ways(subject, machines, span)?;
    let jobs = (0..wish.count).map(|_| subject.answer()).collect::<Outcome<Vec<_>>>()?;
    result["jobs"] = jobs.into();
    let lathes = running.into_iter().map(Running::end).collect::<Outcome<Vec<_>>>()?;
    result["lathes"] = lathes.into();
    Ok(result)
}

/// A program of so many passes. X is a diameter of 0.01 mm a pulse, as Z is of length.
fn program(passes: u64) -> String {
    let mut text = "G91 F9999\n".to_owned();
    let hundredths = |value: i64| {
        format!(
            "{}{}.{:02}",
            if value < 0 { "-" } else { "" },
            value.abs() / 100,
            value.abs() % 100
        )
    };
    for (x, z) in (0..passes).flat_map(|_| PASS) {
        text.extend(["G01 X", &hundredths(x), " Z", &hundredths(z), "\n"]);
    }
    text + "M30\n"
}

fn periods(pass: &[(i64, i64)]) -> u64 {
    pass.iter().map(|(x, z)| x.unsigned_abs().max(z.unsigned_abs())).sum()
}

/// The bytes of a program: of each move a pulse of the longer axis a period, and one of the other
/// where its share, rounded half up, grows.
fn bytes(passes: u64) -> impl Iterator<Item = u8> {
    let moves = (0..passes).flat_map(|_| PASS);
    moves.flat_map(|(x, z)| stretch(x, z)).chain([0xE2])
}

fn stretch(x: i64, z: i64) -> impl Iterator<Item = u8> {
    let main = x.abs().max(z.abs());
    let done = move |axis: i64, step: i64| (2 * step * axis.abs() + main) / (2 * main);
    (1..=main).map(move |step| {
        let pulse = |axis: i64, there: u8, minus: u8| match done(axis, step) - done(axis, step - 1)
        {
            0 => 0,
            _ if axis < 0 => there | minus,
            _ => there,
        };
        pulse(x, 0x01, 0x02) | pulse(z, 0x04, 0x08) | if step < main { 0x40 } else { 0 }
    })
}

/// A lathe at work, on a thread of its own.
struct Running {
    path: std::path::PathBuf,
    has_ended: Arc<AtomicBool>,
    thread: JoinHandle<Result<Value, PortError>>,
}

impl Running {
    fn start(passes: u64) -> Outcome<Self> {
        let far = 1 << 30;
        let (x_limits, z_limits) = ((-far, far), (-far, far));
        let lathe = Lathe::new(LatheOptions { x_limits, z_limits, ..LatheOptions::default() })?;
        let port = Clocked::new(lathe, PERIOD);
        let compared = Compared { port, expected: Box::new(bytes(passes)), wrong: 0, count: 0 };
        let mut simulator = Simulator::new(compared)?;
        let path = std::path::PathBuf::from(simulator.port().to_string());
        let has_ended = Arc::new(AtomicBool::new(false));
        let ended = Arc::clone(&has_ended);
        let thread = thread::spawn(move || {
            while !ended.load(Ordering::Relaxed) {
                simulator.turn(simulator.now() + Micros::from_millis(20))?;
            }
            Ok(simulator.partner.account())
        });
        Ok(Self { path, has_ended, thread })
    }

    fn end(self) -> Outcome<Value> {
        self.has_ended.store(true, Ordering::Relaxed);
        Ok(self.thread.join().map_err(|_| "a simulated lathe panicked")??)
    }
}

/// A lathe whose bytes are compared as they come.
struct Compared {
    port: Clocked<Lathe>,
    expected: Box<dyn Iterator<Item = u8> + Send>,
    wrong: u64,
    count: u64,
}

impl Compared {
    fn account(&mut self) -> Value {
        let lathe = self.port.machine();
        let report = lathe.report();
        json!({
            "bytes": self.count,
            "wrong_bytes": self.wrong,
            "missing_bytes": self.expected.by_ref().count(),
            "pulses": report.x_pulses + report.z_pulses,
            "gaps": report.gaps,
            "missing_periods": report.missing_periods,
            "longest_gap_micros": report.longest_gap.0,
            "most_in_the_port": self.port.most_waited(),
            "programs": report.programs,
        })
    }
}

impl Partner for Compared {
    fn receive(&mut self, now: Micros, byte: u8) {
        self.count += 1;
        self.wrong += u64::from(self.expected.next() != Some(byte));
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
