//! Room for what is to be sent, and for what is delivered.

use r3964::R3964;
use softplug_plugin::bench::{Bench, Observed};
use softplug_plugin::{JobId, LineParameters, Micros, Value, ValueWriter};

const DLE: u8 = 0x10;
/// One character at 10,000 baud 8N1.
const CHARACTER: Micros = Micros(1_000);

#[test]
fn a_block_leaves_whole_and_without_a_gap() {
    for (room, length) in [(64, 200), (64, 1_024), (8_192, 1_024)] {
        // A DLE in the data is doubled.
        for (byte, on_line) in [(b'x', &[b'x'][..]), (DLE, &[DLE, DLE])] {
            let options = Bench::<R3964>::new().set("nak_at_start", "off");
            let options = options.line(LineParameters::new(10_000)).depth(4).room(room, 4_096);
            let mut bench = options.open();
            bench.send(&vec![byte; length]);
            bench.run_for_millis(10);
            assert_eq!(bench.sent(), [0x02]);

            let answered = bench.now();
            bench.receive(&[DLE]);
            let rest = [&on_line.repeat(length)[..], &[DLE, 0x03, 0x13]].concat();
            let end = answered + Micros(CHARACTER.0 * rest.len() as i64);
            bench.run_until(end);
            assert!(bench.sent()[1..] == rest, "room {room}, {length} of {byte}");
            let starts = bench.observed().iter().filter_map(|(at, seen)| match seen {
                Observed::Byte(_) if *at >= answered => Some(*at),
                _ => None,
            });
            let expected = (0..).map(|number| answered + Micros(CHARACTER.0 * number));
            assert!(starts.zip(expected).all(|(at, expected)| at == expected), "room {room}");

            bench.receive(&[DLE]);
            let sent = 1 + rest.len() as u64;
            let done = Observed::Done { job: JobId(1), sent };
            assert!(bench.observed().iter().any(|(_, seen)| *seen == done), "room {room}");
        }
    }
}

#[test]
fn data_that_was_asked_for_is_taken_only_with_room_for_all_that_may_come() {
    for (room, answer) in [(127, 0x15), (128, DLE)] {
        let options = Bench::<R3964>::new().set("layer", "rk512").set("nak_at_start", "off");
        let mut bench = options.room(4_096, room).open();
        let mut buffer = [0; 64];
        let mut fields = ValueWriter::new(&mut buffer);
        for (field, value) in [(0, Value::Text("DB")), (1, Value::Int(7)), (3, Value::Int(1))] {
            fields.push(field, value).unwrap();
        }
        bench.begin_job(2, fields.written().to_vec(), b"");
        // Two bytes are asked for, but more may come.
        for _ in 0..2 {
            bench.run_for_millis(100);
            bench.receive(&[DLE]);
        }
        let telegram = bench.sent().len();
        bench.receive(&[0x02]);
        bench.run_for_millis(1_000);
        assert_eq!(bench.sent().get(telegram), Some(&answer), "{room} bytes of room");
    }
}

#[test]
fn the_largest_state_survives_a_swap() {
    let settings = [("nak_at_start", "off"), ("handshake", "off"), ("transmission_attempts", "1")];
    let mut bench = Bench::<R3964>::new().set_all(&settings).room(1, 4_096).open();
    // Good and bad blocks in turn, so that no answer is as the one before.
    let blocks = |first: u8, second: u8, pairs: usize| {
        let good_and_bad = [2, 0x10, 3, first, 2, 0x10, 3, second].repeat(pairs);
        [&good_and_bad[..], &[2, 0x10, 3, first]].concat()
    };
    bench.run_for_millis(1_000);
    bench.receive(&blocks(0x13, 0x12, 127));
    bench.run_for_millis(2_000);
    bench.receive(&blocks(0x12, 0x13, 128));
    bench.receive(&[&[2][..], &[b'A'; 1_024]].concat());
    bench.send(&[b'B'; 1_024]);
    bench.swap();
    bench.run_for_millis(1);
}
