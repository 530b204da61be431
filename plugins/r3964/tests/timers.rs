//! Each wait at its last instant, and one tick before and after it.

use r3964::R3964;
use softplug_plugin::bench::{Bench, Delivery, Observed};
use softplug_plugin::{Failure, JobId, Micros};

/// One character at 9600 8N1, as the bench's line has it.
const CHARACTER: Micros = Micros(1_042);

fn bench(settings: &[(&str, &str)]) -> Bench<R3964> {
    Bench::<R3964>::new().set("nak_at_start", "off").set_all(settings).open()
}

fn millis(millis: i64) -> Micros {
    Micros::from_millis(millis)
}

/// Bytes on the wire with the start of each, from `since` on.
fn sent_since(bench: &Bench<R3964>, since: Micros) -> Vec<(Micros, u8)> {
    let byte = |(at, seen): &(Micros, Observed)| match seen {
        Observed::Byte(byte) if *at >= since => Some((*at, *byte)),
        _ => None,
    };
    bench.observed().iter().filter_map(byte).collect()
}

fn failures(bench: &Bench<R3964>) -> Vec<(Micros, Failure, u16)> {
    let failed = |(at, seen): &(Micros, Observed)| match seen {
        Observed::Failed { failure, status, .. } => Some((*at, *failure, *status)),
        Observed::Delivery(Delivery { failure: Some(failure), status, .. }) => {
            Some((*at, *failure, *status))
        }
        _ => None,
    };
    bench.observed().iter().filter_map(failed).collect()
}

/// Bytes arrive at this instant, before the timers of the same.
fn receive_at(bench: &mut Bench<R3964>, at: Micros, bytes: &[u8]) {
    bench.run_until(at - Micros(1));
    bench.host(|link, _, host| link.received(at, bytes, host));
    bench.run_until(at);
}

/// When a wait is over that ends at `end`: what happens at the instants around it
/// if `act` comes at each of them.
fn around(end: Micros, mut act: impl FnMut(Micros)) {
    for tick in [-1, 0, 1] {
        act(end + Micros(tick));
    }
}

#[test]
fn qvz_after_stx() {
    for (settings, qvz) in [
        (&[("qvz", "0")][..], 2_000),
        (&[("bcc", "off")], 550),
        (&[("qvz", "300")], 300),
        (&[("qvz", "300"), ("bcc", "off")], 300),
    ] {
        // It counts from the end of STX.
        let end = CHARACTER + millis(qvz);
        around(end, |at| {
            let mut bench = bench(settings);
            bench.send(b"A");
            receive_at(&mut bench, at, b"\x10");
            bench.run_for_millis(1);
            let next = sent_since(&bench, Micros(1));
            // Late, it finds a second STX that has only begun.
            let expected = if at <= end { b'A' } else { 0x02 };
            assert_eq!(next.first().map(|(_, byte)| *byte), Some(expected), "{at}");
        });
    }
}

#[test]
fn qvz_after_the_block() {
    // STX, then DLE at 10 ms, then `A DLE ETX BCC`.
    let end = millis(10) + Micros(4_167) + millis(2_000);
    around(end, |at| {
        let mut bench = bench(&[]);
        bench.send(b"A");
        bench.run_until(millis(10));
        bench.receive(b"\x10");
        receive_at(&mut bench, at, b"\x10");
        let done = bench.observed().contains(&(at, Observed::Done { job: JobId(1), sent: 5 }));
        assert_eq!(done, at <= end, "{at}");
        if at > end {
            assert_eq!(sent_since(&bench, millis(100)).first(), Some(&(end, 0x02)));
        }
    });
}

#[test]
fn zvz_from_our_dle_and_from_each_character() {
    // From the end of our DLE.
    let end = millis(10) + CHARACTER + millis(220);
    around(end, |at| {
        let mut bench = bench(&[]);
        bench.run_until(millis(10));
        bench.receive(b"\x02");
        receive_at(&mut bench, at, b"A\x10\x03\x52");
        let good = bench.deliveries().first().is_some_and(|delivery| delivery.failure.is_none());
        assert_eq!(good, at <= end, "{at}");
        if at > end {
            assert_eq!(failures(&bench), [(end, Failure::NoAnswer, 0x0806)]);
            assert_eq!(sent_since(&bench, millis(100)).first(), Some(&(end, 0x15)));
        }
    });
    // From a character to the next, also to the block check.
    for cut in 1..4 {
        let wire = b"A\x10\x03\x52";
        let end = millis(20) + millis(220);
        around(end, |at| {
            let mut bench = bench(&[]);
            bench.run_until(millis(10));
            bench.receive(b"\x02");
            bench.run_until(millis(20));
            bench.receive(&wire[..cut]);
            receive_at(&mut bench, at, &wire[cut..]);
            let good =
                bench.deliveries().first().is_some_and(|delivery| delivery.failure.is_none());
            assert_eq!(good, at <= end, "{cut} {at}");
        });
    }
}

#[test]
fn bwz_from_the_end_of_nak() {
    let end = millis(20) + CHARACTER + millis(4_000);
    around(end, |at| {
        let mut bench = bench(&[]);
        bench.run_until(millis(10));
        bench.receive(b"\x02");
        bench.run_until(millis(20));
        bench.receive(b"A\x10\x03\x53");
        receive_at(&mut bench, at, b"\x02");
        // In time, the attempt goes on; late, it is a new block.
        let gone = failures(&bench);
        let late = [(end, Failure::Checksum, 0x0808)];
        assert_eq!(gone, if at <= end { &[][..] } else { &late }, "{at}");
        bench.run_for_millis(1);
        let answers: Vec<u8> =
            sent_since(&bench, millis(100)).iter().map(|(_, byte)| *byte).collect();
        assert_eq!(answers, [0x10]);
    });
}

#[test]
fn a_buffer_is_looked_for_every_50_ms() {
    let stx = millis(100);
    for (free_after, seen_after) in [(1, 50), (50, 100), (51, 100), (349, 350), (399, 400)] {
        let mut bench = Bench::<R3964>::new()
            .set("nak_at_start", "off")
            .room(4_096, 2_000)
            .drain_by_hand()
            .open();
        bench.receive(b"\x02");
        bench.run_until(millis(10));
        let block = [&[0x41; 1_024][..], b"\x10\x03\x13"].concat();
        bench.receive(&block);
        bench.run_until(stx);
        bench.receive(b"\x02");
        bench.run_until(stx + millis(free_after));
        bench.drain(1_024);
        bench.run_until(millis(600));
        let answers = sent_since(&bench, stx);
        assert_eq!(answers.first(), Some(&(stx + millis(seen_after), 0x10)), "{free_after}");
    }
}

#[test]
fn garbage_is_refused_after_silence_only() {
    let mut bench = bench(&[]);
    for at in [10, 229, 448] {
        bench.run_until(millis(at));
        bench.receive(b"\x41");
    }
    bench.run_until(millis(2_000));
    assert_eq!(sent_since(&bench, Micros(0)), [(millis(448 + 220), 0x15)]);
}

#[test]
fn a_burst_of_anything_ends_in_idle() {
    // As many bytes as one event has, in each state: the output must hold what follows.
    for settings in [
        &[][..],
        &[("setup_attempts", "255"), ("transmission_attempts", "255")],
        &[("setup_attempts", "255"), ("transmission_attempts", "255"), ("handshake", "off")],
        &[("priority", "none"), ("bwz", "0"), ("bcc", "off")],
        &[("layer", "rk512"), ("transmission_attempts", "255")],
    ] {
        for burst in [&b"\x02"[..], b"\x15", b"\x10", b"\x41", b"\x02\x10\x03\x13", b"\x02\x10\x03"]
        {
            for prefix in [&b""[..], b"\x10"] {
                let mut bench = bench(settings);
                bench.send(&[0x10; 1_000]);
                bench.run_until(millis(5));
                bench.receive(prefix);
                bench.run_until(millis(6));
                let burst: Vec<u8> = burst.iter().copied().cycle().take(1_040).collect();
                bench.receive(&burst);
                bench.run_for_millis(10_000_000);
                let last = bench.observed().iter().rev().find_map(|(_, seen)| match seen {
                    Observed::State(name) => Some(name.as_str()),
                    _ => None,
                });
                assert_eq!(last, Some("idle"), "{settings:?} {burst:02X?}");
                assert_eq!(bench.link().job(), None);
            }
        }
    }
}
