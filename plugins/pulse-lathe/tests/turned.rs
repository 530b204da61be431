//! The plug-in and a simulated lathe on one line, in virtual time: no period is missing inside a
//! cut, and the turned part is the one that was programmed.

use pulse_lathe::PulseLathe;
use softplug_machines::Partner;
use softplug_machines::pulse_lathe::{Lathe, LatheOptions};
use softplug_plugin::bench::{Bench, BenchOptions, Observed};
use softplug_plugin::{LineParameters, Micros};

const PERIOD: Micros = Micros(250);

fn bench() -> BenchOptions<PulseLathe> {
    Bench::new().line(LineParameters::new(40_000))
}

/// Runs a program to its end, the host's pause and resume included.
fn turned(options: BenchOptions<PulseLathe>, program: &str, pause_at: Option<Micros>) -> Lathe {
    let mut bench = options.open();
    let mut lathe = Lathe::new(LatheOptions::default()).expect("they are the default");
    let mut seen = 0;
    let job = bench.send(program.as_bytes());
    while bench.link().job().is_some() {
        let now = bench.now() + PERIOD;
        assert!(now < Micros::from_secs(300), "it ends");
        bench.run_until(now);
        let begun: Vec<(Micros, u8)> = bench.observed()[seen..]
            .iter()
            .filter_map(|(at, what)| match what {
                Observed::Byte(byte) => Some((*at, *byte)),
                _ => None,
            })
            .collect();
        seen = bench.observed().len();
        for (at, byte) in begun {
            lathe.receive(at + PERIOD, byte);
        }
        lathe.advance(now);
        while let Some(byte) = lathe.poll_transmit(now) {
            bench.receive(&[byte]);
        }
        if pause_at.is_some_and(|at| at > now - PERIOD && at <= now) {
            bench.host(|link, now, outside| link.pause(now, job, outside));
            bench.run_for_millis(777);
            bench.host(|link, now, outside| link.resume(now, job, outside));
        }
    }
    // The last byte.
    for (at, what) in &bench.observed()[seen..] {
        if let Observed::Byte(byte) = what {
            lathe.receive(*at + PERIOD, *byte);
        }
    }
    let done = bench.observed().iter().any(|(_, what)| matches!(what, Observed::Done { .. }));
    assert!(done, "{:?}", bench.observed().last());
    lathe
}

/// From the tool's start, X50 Z5 of the work: a shoulder of 30 mm across and 20 mm long.
const SHOULDER: &str = "S20 T1 M3\nG00 X-15\nG01 Z-25 F600\nG00 X-10\nG00 Z0\nG00 X-20\n\
     G01 Z-25\nG01 X0\nG28\nM5\nM30\n";

#[test]
fn a_shoulder_is_turned_to_its_pulse_without_a_gap() {
    let lathe = turned(bench().set("input", "iso"), SHOULDER, None);
    let report = lathe.report();
    assert_eq!((report.gaps, report.lost_pulses, report.cut_while_still), (0, 0, 0));
    assert_eq!((report.x, report.z, report.programs), (0, 0, 1));
    let contour = lathe.contour();
    // 30 mm across: 3,000 pulses of radius, from the face to 20 mm; beyond it the blank.
    assert!(contour[..=2_000].iter().all(|radius| *radius == 3_000));
    assert!(contour[2_001..].iter().all(|radius| *radius == 4_000));
}

#[test]
fn a_pause_leaves_no_mark() {
    let whole = turned(bench().set("input", "iso"), SHOULDER, None);
    for millis in [30, 1_500, 4_321] {
        let at = Some(Micros::from_millis(millis));
        let held = turned(bench().set("input", "iso"), SHOULDER, at);
        assert_eq!(held.report().holds, 1);
        assert_eq!(held.report().gaps, 0);
        assert_eq!(held.contour(), whole.contour());
        assert_eq!((held.report().x, held.report().z), (0, 0));
    }
}

#[test]
fn a_thread_is_cut_with_the_turning_spindle() {
    // Step 12 is 600 turns a minute: 2 mm a turn are 20 mm a second, 2,000 pulses.
    let text = "S12 T0 M3\nG00 X-12\nG33 W-30 F2\nG00 X0\nG28\nM30\n";
    let lathe = turned(bench().set("input", "iso"), text, None);
    let report = lathe.report();
    assert_eq!((report.gaps, report.lost_pulses), (0, 0));
    assert_eq!((report.x, report.z), (0, 0));
    assert_eq!(report.z_pulses, 2 * 3_000);
    assert!(lathe.contour()[..=2_500].iter().all(|radius| *radius == 3_800));
}

#[test]
fn octal_arcs_leave_no_gap_and_find_zero() {
    let text = "4000 0000 1130 0000 2411 7777\n0011 0000 3720 0000\n\
         7050 0000 0144 0000 0000 0000 0144 0000\n3050 0000 0144 0000 0000 0000 0310 0000\n\
         0000 0003 0012\n0004 0002";
    let lathe = turned(bench(), text, None);
    assert_eq!((lathe.report().x, lathe.report().z, lathe.report().gaps), (0, 0, 0));
    assert_eq!(lathe.report().commands[..3], [0x80 | 0o24, 0xC1, 0xD1]);
}

#[test]
fn the_picture_shows_the_part() {
    let lathe = turned(bench().set("input", "iso"), SHOULDER, None);
    let picture = lathe.picture();
    assert!(
        picture.contains("M-0.00 -15.000L-20.01 -15.000L-20.01 -20.000L-60.00 -20.000"),
        "{picture}"
    );
}
