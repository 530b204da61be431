//! Two converters on one line: one sends, the other stops it in time.

use proptest::prelude::*;
use softplug_plugin::bench::{Bench, Observed};
use softplug_plugin::{JobId, LineParameters, Micros};
use xon_xoff::XonXoff;

/// A character at 10,000 baud 8N1, in µs: every event stands on this grid.
const CHARACTER: i64 = 1_000;

#[derive(Clone, Debug)]
struct Setup {
    transparent: bool,
    depth: usize,
    /// Room for deliveries at the receiver.
    room: u32,
    low: u32,
    high: u32,
    /// Bytes that the receiver's host puts away in one character time, over and over.
    drains: Vec<u32>,
    /// After how many characters either is replaced, over and over; 0: never.
    swap_every: usize,
}

fn setup() -> impl Strategy<Value = Setup> {
    let drains = prop_oneof![3 => Just(0_u32), 2 => 0..3_u32, 1 => 0..200_u32];
    (
        any::<bool>(),
        1..4_usize,
        32..300_u32,
        1..200_u32,
        1..300_u32,
        proptest::collection::vec(drains, 1..40),
        prop_oneof![Just(0_usize), 1..60_usize],
    )
        .prop_map(|(transparent, depth, room, low, high, drains, swap_every)| Setup {
            transparent,
            depth,
            room,
            // Our own queue, the XOFF itself, the partner's port and its reaction.
            low: low.max(2 * depth as u32 + 4),
            high,
            drains,
            swap_every,
        })
}

/// Bytes of one side that arrive at the other, a character after they start.
#[derive(Debug, Default)]
struct Arrivals {
    looked_at: usize,
    under_way: Vec<(i64, u8)>,
}

impl Arrivals {
    fn at(&mut self, now: i64, from: &Bench<XonXoff>) -> Vec<u8> {
        for (at, seen) in &from.observed()[self.looked_at..] {
            if let Observed::Byte(byte) = seen {
                self.under_way.push((at.0 + CHARACTER, *byte));
            }
        }
        self.looked_at = from.observed().len();
        let (due, later) = self.under_way.iter().partition(|(at, _)| *at <= now);
        self.under_way = later;
        let due: Vec<(i64, u8)> = due;
        due.into_iter().map(|(_, byte)| byte).collect()
    }
}

fn side(setup: &Setup) -> softplug_plugin::bench::BenchOptions<XonXoff> {
    Bench::<XonXoff>::new()
        .line(LineParameters::new(10_000))
        .depth(setup.depth)
        .room(200, setup.room)
        .set("transparent", if setup.transparent { "on" } else { "off" })
        .set("low_mark", &setup.low.to_string())
        .set("high_mark", &setup.high.to_string())
        .set("quiet_time", "600000")
}

fn transfer(setup: &Setup, program: &[u8]) -> (Bench<XonXoff>, Bench<XonXoff>) {
    let mut sender = side(setup).open();
    let mut receiver = side(setup).drain_by_hand().open();
    let (mut there, mut back) = (Arrivals::default(), Arrivals::default());
    sender.send(program);
    let mut drains = setup.drains.iter().cycle();
    let most = 12 * (program.len() as i64 + 100);
    for step in 1..=most {
        let now = Micros(step * CHARACTER);
        sender.run_until(now);
        receiver.run_until(now);
        let to_receiver = there.at(now.0, &sender);
        let to_sender = back.at(now.0, &receiver);
        if !to_receiver.is_empty() {
            receiver.receive(&to_receiver);
        }
        if !to_sender.is_empty() {
            sender.receive(&to_sender);
        }
        // Towards the end all is put away, so that nobody waits for ever.
        let drain = *drains.next().expect("it goes round");
        receiver.drain(if step > most / 2 { 100 } else { drain });
        if setup.swap_every > 0 && (step as usize).is_multiple_of(setup.swap_every) {
            sender.swap();
            receiver.swap();
        }
    }
    receiver.run_for_millis(700_000);
    (sender, receiver)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn what_is_sent_is_delivered(
        setup in setup(),
        program in proptest::collection::vec(any::<u8>(), 1..300),
    ) {
        let mut program = program;
        if !setup.transparent {
            program.retain(|byte| !matches!(byte, 0x11 | 0x13));
            program.push(b'%');
        }
        let (sender, receiver) = transfer(&setup, &program);
        let done = |seen: &Observed| matches!(seen, Observed::Done { job: JobId(1), .. });
        prop_assert!(sender.observed().iter().any(|(_, seen)| done(seen)), "not done");
        let delivered = receiver.deliveries();
        prop_assert_eq!(delivered.len(), 1);
        prop_assert_eq!(delivered[0].failure, None, "overrun");
        prop_assert!(delivered[0].bytes == program);
    }
}

#[test]
fn a_slow_host_holds_the_sender_many_times() {
    let setup = Setup {
        transparent: false,
        depth: 2,
        room: 64,
        low: 16,
        high: 40,
        drains: vec![0, 1, 0],
        swap_every: 0,
    };
    let program: Vec<u8> = b"N10 G1 X12.5 Y-3.25 F800\n".repeat(30);
    let (sender, receiver) = transfer(&setup, &program);
    assert_eq!(receiver.deliveries()[0].bytes, program);
    let count = |seen: &Observed| sender.observed().iter().filter(|(_, s)| s == seen).count();
    assert!(count(&Observed::Hold) > 10, "{} holds", count(&Observed::Hold));
    assert_eq!(count(&Observed::Hold), count(&Observed::Release));
}

#[test]
fn a_swap_keeps_the_marks() {
    let stops = |swaps: bool| {
        let mut bench = Bench::<XonXoff>::new()
            .room(100, 100)
            .drain_by_hand()
            .set("low_mark", "50")
            .set("high_mark", "75")
            .open();
        let mut sent = Vec::new();
        // 40 bytes of room are left, then 54, then 80, then 45.
        for (received, drained) in [(60, 0), (0, 14), (0, 26), (35, 0)] {
            if received > 0 {
                bench.receive(&vec![b'x'; received]);
            }
            if swaps {
                bench.swap();
            }
            bench.drain(drained);
            bench.run_for_millis(10);
            sent.push(bench.sent());
        }
        sent
    };
    let expected: [&[u8]; 4] = [b"\x13", b"\x13", b"\x13\x11", b"\x13\x11\x13"];
    assert_eq!(stops(false), expected);
    assert_eq!(stops(true), expected);
}
