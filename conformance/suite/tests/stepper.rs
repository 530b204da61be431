//! A run taken apart: what it shows at each moment, and noise on its line.

use crate::common;
use softplug_conformance::{
    Case, Happening, Moment, Noise, Other, Permutation, Stepper, Timer, disturb,
};
use softplug_trace::{NoFiles, Trace};

fn case(profile: &str, id: &str) -> Case {
    let path = common::root().join(format!("fixtures/traces/{profile}/{id}.spt"));
    Case::new(&path, Trace::parse(&std::fs::read_to_string(&path).unwrap()).unwrap())
}

fn hold() -> Case {
    case("xon-xoff", "xon-xoff.tx.hold")
}

fn at(stepper: &Stepper, at_us: i64) -> &Moment {
    stepper.moments.iter().rfind(|moment| moment.at_us <= at_us).unwrap()
}

fn wire(stepper: &Stepper) -> Vec<(i64, &[u8])> {
    let wire = stepper.moments.iter().filter_map(|moment| match &moment.what {
        Happening::Wire(bytes) => Some((moment.at_us, &bytes[..])),
        _ => None,
    });
    wire.collect()
}

#[test]
fn each_moment_says_how_the_plug_in_stands() {
    let stepper = Stepper::new(&common::sandboxed("xon-xoff"), &hold(), &Permutation::Uncut);
    assert_eq!(stepper.failure, None);
    assert_eq!((stepper.differs_at, stepper.end_us, stepper.is_cut), (None, 5_000_000, false));
    assert!(stepper.moments.is_sorted_by_key(|moment| moment.at_us));
    assert!(!at(&stepper, 1_000).after.is_held);
    assert!(at(&stepper, 1_500).after.is_held && !at(&stepper, 2_000_000).after.is_held);
    assert_eq!(wire(&stepper), [(0, &b"AB"[..]), (2_000_000, b"CD")]);
    let heard = stepper.moments.iter().find_map(|moment| match &moment.what {
        Happening::Step(step)
            if step.given.other == Other::Line && !step.given.bytes.is_empty() =>
        {
            Some((moment.line, step.given.bytes.clone()))
        }
        _ => None,
    });
    assert_eq!(heard, Some((14, vec![0x13])));
    let fuel = |moment: &Moment| match &moment.what {
        Happening::Step(step) => step.fuel,
        _ => 0,
    };
    let total: u64 = stepper.moments.iter().map(fuel).sum();
    assert!(total > 0);
    assert_eq!(stepper.moments.last().unwrap().after.fuel, total);
}

#[test]
fn timers_are_kept_until_they_run_out() {
    let case = case("r3964", "r3964.conflict.abort");
    let stepper = Stepper::new(&common::native("r3964"), &case, &Permutation::Uncut);
    // STX has left at 1,146 µs; its answer may take 2 s.
    let timers = &at(&stepper, 1_500).after.timers;
    assert_eq!(timers[..], [Timer { id: 0, until_us: 2_001_146 }]);
    assert_eq!(stepper.moments.last().unwrap().after.timers, []);
}

#[test]
fn a_difference_has_its_moment() {
    let mut case = hold();
    let text = case.trace.format().replace("43 44 ", "43 45 ");
    case.trace = Trace::parse(&text).unwrap();
    let stepper = Stepper::new(&common::native("xon-xoff"), &case, &Permutation::Uncut);
    let moment = &stepper.moments[stepper.differs_at.unwrap()];
    let Happening::Wire(bytes) = &moment.what else { panic!("{moment:?}") };
    assert!(bytes.contains(&0x44) && moment.at_us >= 2_000_000, "{moment:?}");
}

#[test]
fn every_permutation_can_be_walked_through() {
    let plugin = common::native("xon-xoff");
    let instances = |permutation| {
        let stepper = Stepper::new(&plugin, &hold(), permutation);
        assert_eq!(stepper.failure, None, "{permutation}");
        assert_eq!(wire(&stepper).last(), Some(&(2_000_000, &b"CD"[..])), "{permutation}");
        let instances = stepper.moments.iter().filter_map(|moment| match &moment.what {
            Happening::Step(step) => Some(step.instance),
            _ => None,
        });
        (instances.max().unwrap(), stepper.moments[0].at_us)
    };
    assert_eq!(instances(&Permutation::Uncut), (1, 0));
    assert!(instances(&Permutation::SwapAll).0 > 3);
    // The first of two runs lies before the trace's time.
    assert!(instances(&Permutation::Twice).1 < 0);
}

#[test]
fn noise_damages_what_is_received_and_nothing_else() {
    let trace = hold().trace;
    let damaged = |noise| {
        let disturbed = disturb(&trace, &NoFiles, noise).unwrap();
        assert_eq!(Trace::parse(&disturbed.trace.format()).unwrap(), disturbed.trace);
        disturbed
    };
    let quiet = damaged(Noise { seed: 7, ..Noise::default() });
    assert_eq!((quiet.count, &quiet.trace), (0, &trace));
    let noise = Noise { seed: 7, flip: 1_000, ..Noise::default() };
    let turned = damaged(noise);
    assert_eq!(turned.count, 2);
    let bytes = |trace: &Trace| -> Vec<u8> {
        let received = trace.inputs().filter_map(|entry| match &entry.what {
            softplug_trace::What::Given(softplug_trace::Given::Receive(payload)) => {
                payload.bytes(&NoFiles).ok()
            }
            _ => None,
        });
        received.flatten().collect()
    };
    let (before, after) = (bytes(&trace), bytes(&turned.trace));
    assert_eq!(before.len(), after.len());
    assert!(before.iter().zip(&after).all(|(a, b)| (a ^ b).is_power_of_two()));
    let inserted = damaged(Noise { seed: 7, insert: 1_000, ..Noise::default() });
    assert_eq!(bytes(&inserted.trace).len(), 4);
    assert_eq!(bytes(&damaged(Noise { seed: 7, drop: 1_000, ..Noise::default() }).trace), b"");
    assert_eq!(damaged(noise), turned);
}

#[test]
fn a_turned_bit_shows_on_a_line_with_parity() {
    let mut trace = hold().trace;
    trace.front.line.parity = softplug_abi::Parity::Even;
    let noise = Noise { seed: 1, flip: 1_000, ..Noise::default() };
    let text = disturb(&trace, &NoFiles, noise).unwrap().trace.format();
    assert_eq!(text.matches("~p").count(), 2, "{text}");
}
