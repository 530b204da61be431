//! The sender against a partner that says XOFF and XON as it likes.

use proptest::prelude::*;
use softplug_plugin::bench::{Bench, BenchOptions, Observed};
use softplug_plugin::{JobId, LineParameters, Micros};
use xon_xoff::XonXoff;

const XON: u8 = 0x11;
const XOFF: u8 = 0x13;
/// A character at 10,000 baud 8N1, in µs.
const CHARACTER: i64 = 1_000;

/// What may differ from one transfer to the next.
#[derive(Clone, Debug)]
struct Setup {
    transparent: bool,
    mask: u8,
    feed: bool,
    wait_for_xon: bool,
    depth: usize,
    room: u32,
    /// µs to wait, then what the partner says, all at one time.
    partner: Vec<(i64, Vec<u8>)>,
}

/// How it is carried out, which must make no difference.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
enum How {
    Plain,
    /// The partner's bytes arrive each in an event of its own.
    Cut,
    /// A new instance takes over whenever the partner has spoken.
    Swapped,
}

fn setup() -> impl Strategy<Value = Setup> {
    let said = prop_oneof![Just(XON), Just(XOFF), Just(XOFF)];
    let partner = (0..9_000_i64, proptest::collection::vec(said, 1..4));
    let flags = any::<[bool; 3]>();
    let mask = prop_oneof![Just(0xFF), Just(0x7F)];
    let partner = proptest::collection::vec(partner, 0..30);
    (flags, mask, 1..5_usize, 64..600_u32, partner).prop_map(
        |([transparent, feed, wait_for_xon], mask, depth, room, partner)| Setup {
            transparent,
            mask,
            feed,
            wait_for_xon,
            depth,
            room,
            partner,
        },
    )
}

fn options(setup: &Setup) -> BenchOptions<XonXoff> {
    let on = |flag| if flag { "on" } else { "off" };
    let mut options = Bench::<XonXoff>::new()
        .line(LineParameters::new(10_000))
        .depth(setup.depth)
        .room(setup.room, 4_096)
        .set("transparent", on(setup.transparent))
        .set("wait_for_xon", on(setup.wait_for_xon))
        .set("parity_mask", &setup.mask.to_string());
    if setup.feed {
        options = options.set("feed_start", "00 0d 0a").set("feed_end", "25 04");
    }
    options
}

type Seen = (Micros, Observed);

/// The transfer with all that was seen but state names, and when the partner
/// said XOFF (true) or XON last at a time.
fn transfer(setup: &Setup, program: &[u8], how: How) -> (Vec<Seen>, Vec<(i64, bool)>) {
    let mut bench = options(setup).open();
    bench.send(program);
    let mut told = Vec::new();
    for (wait, said) in setup.partner.iter().chain([&(20_000, vec![XON])]) {
        bench.run_until(bench.now() + Micros(*wait));
        if how == How::Cut {
            bench.host(|link, now, host| {
                said.chunks(1).try_for_each(|byte| link.received(now, byte, host))
            });
        } else {
            bench.receive(said);
        }
        told.push((bench.now().0, said.last() == Some(&XOFF)));
        if how == How::Swapped {
            bench.swap();
        }
    }
    bench.run_for_millis(5_000);
    let names = |(_, seen): &(Micros, Observed)| !matches!(seen, Observed::State(_));
    (bench.observed().iter().filter(|seen| names(seen)).cloned().collect(), told)
}

/// Without holds that end, and releases that are taken back, at the instant at which they
/// begin: no byte leaves in between. What XOFF and XON in one event come to is said once
/// for the event.
fn lasting(observed: Vec<Seen>) -> Vec<Seen> {
    let mut lasting: Vec<Seen> = Vec::new();
    for seen in observed {
        let undoes = lasting.last().is_some_and(|last| {
            let both = (&last.1, &seen.1);
            let is_pair = matches!(
                both,
                (Observed::Hold, Observed::Release) | (Observed::Release, Observed::Hold)
            );
            is_pair && last.0 == seen.0
        });
        if undoes {
            lasting.pop();
        } else {
            lasting.push(seen);
        }
    }
    lasting
}

fn wire(observed: &[(Micros, Observed)]) -> Vec<(i64, u8)> {
    let byte = |(at, seen): &(Micros, Observed)| match seen {
        Observed::Byte(byte) => Some((at.0, *byte)),
        _ => None,
    };
    observed.iter().filter_map(byte).collect()
}

fn unescaped(setup: &Setup, wire: &[u8]) -> Vec<u8> {
    if !setup.transparent {
        return wire.to_vec();
    }
    let mut bytes = wire.iter();
    let mut plain = Vec::new();
    while let Some(byte) = bytes.next() {
        let is_control = matches!(byte & 0x7F, XON | XOFF);
        assert!(!is_control, "a control byte went out unescaped");
        plain.push(if *byte == 0x10 {
            bytes.next().expect("a pair is whole") ^ 0x40
        } else {
            *byte
        });
    }
    plain
}

/// A program that this set-up can send.
fn sendable(setup: &Setup, mut program: Vec<u8>) -> Vec<u8> {
    if !setup.transparent {
        program.retain(|byte| !matches!(byte & setup.mask, XON | XOFF));
    }
    program
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn the_program_reaches_the_wire(
        setup in setup(),
        program in proptest::collection::vec(any::<u8>(), 0..400),
    ) {
        let program = sendable(&setup, program);
        let (observed, told) = transfer(&setup, &program, How::Plain);
        let wire = wire(&observed);
        let bytes: Vec<u8> = wire.iter().map(|(_, byte)| *byte).collect();
        // The feed's strings are sent as they are.
        let (start, end): (&[u8], &[u8]) =
            if setup.feed { (b"\x00\r\n", b"%\x04") } else { (b"", b"") };
        let middle = bytes.strip_prefix(start).and_then(|rest| rest.strip_suffix(end));
        prop_assert_eq!(unescaped(&setup, middle.expect("the feed is whole")), program);

        // Done, when the last character has left and not before.
        let last = wire.last().map_or(0, |(at, _)| at + CHARACTER);
        let done: Vec<_> =
            observed.iter().filter(|(_, seen)| matches!(seen, Observed::Done { .. })).collect();
        prop_assert_eq!(done.len(), 1);
        let sent = bytes.len() as u64;
        prop_assert_eq!(&done[0].1, &Observed::Done { job: JobId(1), sent });
        prop_assert!(bytes.is_empty() || done[0].0 == Micros(last));

        // After an XOFF only what the port holds, until the next XON.
        let mut held_since = setup.wait_for_xon.then_some(-1);
        for (at, is_xoff) in told {
            if let Some(since) = held_since {
                let late = wire.iter().filter(|(start, _)| *start > since && *start < at).count();
                let most = if since < 0 { 0 } else { setup.depth };
                prop_assert!(late <= most, "{late} from {since} to {at}");
            }
            held_since = match (is_xoff, held_since) {
                (true, None) => Some(at),
                (true, since) => since,
                (false, _) => None,
            };
        }
    }

    #[test]
    fn cuts_and_swaps_change_nothing(
        setup in setup(),
        program in proptest::collection::vec(any::<u8>(), 0..200),
    ) {
        let program = sendable(&setup, program);
        let plain = lasting(transfer(&setup, &program, How::Plain).0);
        for how in [How::Cut, How::Swapped] {
            let other = lasting(transfer(&setup, &program, how).0);
            prop_assert_eq!(&other, &plain, "{:?}", how);
        }
    }
}

#[test]
fn a_job_is_done_when_its_own_last_byte_has_left() {
    // All of the first job is with the port when it is aborted.
    let mut bench = Bench::<XonXoff>::new().line(LineParameters::new(10_000)).depth(4).open();
    bench.send(b"ABCD");
    bench.host(|link, now, host| link.abort(now, JobId(1), host));
    bench.send(b"EFGH");
    bench.run_for_millis(100);
    assert_eq!(bench.sent(), b"ABCDEFGH");
    let done = bench.observed().iter().find(|(_, seen)| matches!(seen, Observed::Done { .. }));
    assert_eq!(done, Some(&(Micros(8_000), Observed::Done { job: JobId(2), sent: 4 })));
}
