//! A 1 MB program fed to a control with a small buffer, in virtual time.

use softplug_abi::manifest::Manifest;
use softplug_abi::{Action, JobId, LineParameters, Micros};
use softplug_link::{Job, LinkHost, LinkOptions, Supply, WireHost};
use softplug_machines::xon_xoff::{Control, ControlOptions, ControlReport};
use softplug_native::NativePlugin;
use softplug_trial::ClosedLoop;

/// Supplies a program and keeps how its job ended.
struct Host<'a> {
    program: &'a [u8],
    at: usize,
    end: Option<Result<u64, softplug_abi::Failure>>,
}

impl LinkHost for Host<'_> {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::JobDone { sent, .. } => self.end = Some(Ok(*sent)),
            Action::JobFailed { failure, .. } => self.end = Some(Err(*failure)),
            _ => {}
        }
    }

    fn supply(&mut self, _job: JobId, buffer: &mut [u8]) -> Supply {
        let rest = &self.program[self.at..];
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

impl WireHost for Host<'_> {}

fn feed(
    program: &[u8],
    depth: usize,
    control: ControlOptions,
) -> (ControlReport, Option<Result<u64, softplug_abi::Failure>>) {
    let plugin = NativePlugin::XonXoff;
    let manifest = Manifest::parse(plugin.manifest().as_bytes()).unwrap();
    let options = LinkOptions {
        line: control.line,
        settings: manifest.resolve_settings([]).unwrap(),
        ..LinkOptions::default()
    };
    let partner = Control::new(control).unwrap();
    let mut line = ClosedLoop::new(plugin.instantiate(), options, depth, partner);
    let mut host = Host { program, at: 0, end: None };
    line.line.link.open(Micros::ZERO, &mut host).unwrap();
    let size = Some(program.len() as u64);
    let job =
        Job { id: JobId(1), kind: 0, size, fields: Vec::new(), check: manifest.needs.check_pass };
    line.line.link.begin_job(Micros::ZERO, job, &mut host).unwrap();
    line.settle(&mut host).unwrap();
    line.run_until(Micros::from_secs(86_400), &mut host, |host| host.end.is_some()).unwrap();
    // What is still in the control's buffer is executed.
    let end = line.now() + Micros::from_secs(60);
    line.partner.advance(end);
    (line.partner.report(), host.end)
}

fn program(bytes: usize) -> Vec<u8> {
    let block =
        |n: usize| format!("N{:05} G1 X{}.{:03} Y-{}\n", n % 100_000, n % 90, n % 1_000, n % 70);
    (0..).flat_map(|n| block(n).into_bytes()).take(bytes).collect()
}

#[test]
fn a_megabyte_reaches_a_control_that_holds_the_line_hundreds_of_times() {
    let program = program(1_000_000);
    let line = LineParameters::new(921_600);
    for depth in [1, 4, 16, 32] {
        let control = ControlOptions {
            line,
            buffer: 512,
            low: 128,
            high: 256,
            rate: 46_080,
            ..ControlOptions::default()
        };
        let (report, end) = feed(&program, depth, control);
        assert_eq!(end, Some(Ok(1_000_000)), "depth {depth}");
        assert!(report.received.matches(&program), "depth {depth}");
        assert_eq!(report.alarms, [], "depth {depth}");
        assert!(report.holds > 300, "depth {depth}: {} holds", report.holds);
        assert!(report.characters_after_xoff.max() <= depth as u32, "depth {depth}");
        assert!(report.rate_while_allowed() > 0.9 * 92_160.0, "depth {depth}");
        assert_eq!(report.starved, 0, "depth {depth}");
    }
}

#[test]
fn never_more_characters_after_xoff_than_the_pacing_depth_at_any_baud() {
    let program = program(20_000);
    for (baud, depth) in
        [(300, 1), (1_200, 1), (9_600, 1), (19_200, 1), (38_400, 2), (115_200, 4), (921_600, 32)]
    {
        let line = LineParameters::new(baud);
        let control = ControlOptions {
            line,
            buffer: 256,
            low: 96,
            high: 128,
            rate: baud / 20,
            ..ControlOptions::default()
        };
        let (report, end) = feed(&program, depth, control);
        assert_eq!(end, Some(Ok(20_000)), "{baud} baud");
        assert!(report.received.matches(&program), "{baud} baud");
        assert_eq!(report.alarms, [], "{baud} baud");
        assert!(report.holds >= 20, "{baud} baud: {} holds", report.holds);
        let most = report.characters_after_xoff.max();
        assert!(most <= depth as u32, "{baud} baud: {most} after XOFF");
    }
}
