//! A thousand lathes that take every feed pulse from their line, all at work at once in virtual
//! time.

use softplug_abi::manifest::Manifest;
use softplug_abi::{Action, Failure, JobId, LineParameters, Micros};
use softplug_link::{Job, LinkHost, LinkOptions, Supply, WireHost};
use softplug_machines::pulse_lathe::{Lathe, LatheOptions};
use softplug_native::{NativeInstance, NativePlugin};
use softplug_trial::ClosedLoop;

const LATHES: usize = 1_000;
/// 8N1: a character takes 250 µs.
const BAUD: u32 = 40_000;
/// All are looked at in turn, so often.
const TURN: Micros = Micros::from_millis(20);
const LONGEST: Micros = Micros::from_secs(30);

/// A lathe with its line, and the program that it is fed.
struct Fed {
    both: ClosedLoop<NativeInstance, Lathe>,
    program: Program,
    /// Where it ends, in pulses of x and z.
    end: (i64, i64),
}

struct Program {
    text: Vec<u8>,
    at: usize,
    end: Option<Result<u64, Failure>>,
}

impl LinkHost for Program {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::JobDone { sent, .. } => self.end = Some(Ok(*sent)),
            Action::JobFailed { failure, .. } => self.end = Some(Err(*failure)),
            _ => {}
        }
    }

    fn supply(&mut self, _job: JobId, buffer: &mut [u8]) -> Supply {
        let rest = &self.text[self.at..];
        let count = rest.len().min(buffer.len());
        if count == 0 {
            return Supply::End;
        }
        buffer[..count].copy_from_slice(&rest[..count]);
        self.at += count;
        Supply::Bytes(count)
    }

    fn rewind(&mut self, _job: JobId) {
        self.at = 0;
    }
}

impl WireHost for Program {}

/// Each has a program of its own: a spindle, a taper, an arc and a thread. A hundredth of a mm is a
/// pulse, of X as a diameter.
fn program(nth: usize) -> (String, (i64, i64)) {
    let nth = nth as i64;
    let (x, z, radius) = (1 + nth * 7 % 300, 500 + nth * 13 % 1_500, 1 + nth % 5);
    let text = format!(
        "G91 S{speed} T1 M3\nG01 X-{}.{:02} Z-{}.{:02} F2000\n\
         G02 X{} Z-{radius} I{radius} F600\nG33 Z-0.5 F0.1\nM30\n",
        x / 100,
        x % 100,
        z / 100,
        z % 100,
        2 * radius,
        speed = 1 + nth % 40,
    );
    (text, (200 * radius - x, -z - 100 * radius - 50))
}

impl Fed {
    fn new(nth: usize) -> Self {
        let plugin = NativePlugin::PulseLathe;
        let manifest = Manifest::parse(plugin.manifest().as_bytes()).unwrap();
        let settings = manifest.resolve_settings([("input", "iso")]).unwrap();
        let line = LineParameters { stop_half_bits: 2, ..LineParameters::new(BAUD) };
        let options = LinkOptions { line, settings, ..LinkOptions::default() };
        let far = (i64::MIN / 2, i64::MAX / 2);
        let lathe = LatheOptions { x_limits: far, z_limits: far, ..LatheOptions::default() };
        let (text, end) = program(nth);
        let mut fed = Self {
            both: ClosedLoop::new(plugin.instantiate(), options, 16, Lathe::new(lathe).unwrap()),
            program: Program { text: text.into(), at: 0, end: None },
            end,
        };
        let Self { both, program, .. } = &mut fed;
        both.line.link.open(Micros::ZERO, program).unwrap();
        let size = Some(program.text.len() as u64);
        let job = Job { id: JobId(1), kind: 0, size, fields: Vec::new(), check: true };
        both.line.link.begin_job(Micros::ZERO, job, program).unwrap();
        both.settle(program).unwrap();
        fed
    }
}

#[test]
fn a_thousand_lathes_at_once_have_no_gap_and_end_where_they_are_to() {
    let mut shop: Vec<Fed> = (0..LATHES).map(Fed::new).collect();
    let mut now = Micros::ZERO;
    while now < LONGEST && shop.iter().any(|fed| fed.program.end.is_none()) {
        now = now + TURN;
        for Fed { both, program, .. } in &mut shop {
            both.wait_until(now, program).unwrap();
        }
    }
    let mut pulses = 0;
    for (nth, fed) in shop.iter().enumerate() {
        let report = fed.both.partner.report();
        assert_eq!(fed.program.end, Some(Ok(report.bytes)), "lathe {nth}");
        assert_eq!((report.gaps, report.programs), (0, 1), "lathe {nth}");
        assert_eq!((report.x, report.z), fed.end, "lathe {nth}");
        pulses += report.x_pulses + report.z_pulses;
    }
    assert!(pulses > 1_000_000, "{pulses} pulses");
}
