//! Transfers in both directions on a bench, with a partner whose blocks are made by hand.

use softplug_plugin::bench::{Bench, BenchOptions, Observed};
use softplug_plugin::{Failure, JobId, LineErrorKind};
use xmodem::Xmodem;

const SOH: u8 = 0x01;
const STX: u8 = 0x02;
const EOT: u8 = 0x04;
const ACK: u8 = 0x06;
const NAK: u8 = 0x15;
const CAN: u8 = 0x18;
const C: u8 = b'C';
const SUB: u8 = 0x1A;
const SILENCE: &[u8] = &[];

/// The CRC as XMODEM's document has it in words: a division, bit by bit.
fn crc(data: &[u8]) -> [u8; 2] {
    let mut rest = 0_u32;
    for byte in data.iter().chain(&[0, 0]) {
        for bit in (0..8).rev() {
            rest = rest << 1 | u32::from(byte >> bit & 1);
            if rest & 0x1_0000 != 0 {
                rest ^= 0x1_1021;
            }
        }
    }
    (rest as u16).to_be_bytes()
}

fn padded(data: &[u8], length: usize) -> Vec<u8> {
    let mut data = data.to_vec();
    data.resize(length, SUB);
    data
}

fn headed(number: u8, data: &[u8], length: usize) -> Vec<u8> {
    let first = if length == 1_024 { STX } else { SOH };
    [vec![first, number, 255 - number], padded(data, length)].concat()
}

/// A block of 128 bytes with CRC.
fn block(number: u8, data: &[u8]) -> Vec<u8> {
    let mut block = headed(number, data, 128);
    block.extend(crc(&padded(data, 128)));
    block
}

/// A block of 1,024 bytes with CRC.
fn long(number: u8, data: &[u8]) -> Vec<u8> {
    let mut block = headed(number, data, 1_024);
    block.extend(crc(&padded(data, 1_024)));
    block
}

/// A block of 128 bytes with checksum.
fn summed(number: u8, data: &[u8]) -> Vec<u8> {
    let mut block = headed(number, data, 128);
    block.push(padded(data, 128).iter().fold(0, |sum: u8, byte| sum.wrapping_add(*byte)));
    block
}

fn bench() -> BenchOptions<Xmodem> {
    Bench::new()
}

/// What the bench sent since it was last looked at.
struct Ear(usize);

impl Ear {
    fn new() -> Self {
        Self(0)
    }

    fn heard(&mut self, bench: &Bench<Xmodem>) -> Vec<u8> {
        let sent = bench.sent();
        let new = sent[self.0..].to_vec();
        self.0 = sent.len();
        new
    }

    /// The bytes come, and so many ms go by.
    fn after(&mut self, bench: &mut Bench<Xmodem>, bytes: &[u8], millis: i64) -> Vec<u8> {
        if !bytes.is_empty() {
            bench.receive(bytes);
        }
        bench.run_for_millis(millis);
        self.heard(bench)
    }
}

/// How a job ended, and the bytes that left for it.
fn job_end(bench: &Bench<Xmodem>) -> Option<(Option<Failure>, u64)> {
    bench.observed().iter().rev().find_map(|(_, observed)| match observed {
        Observed::Done { sent, .. } => Some((None, *sent)),
        Observed::Failed { failure, sent, .. } => Some((Some(*failure), *sent)),
        _ => None,
    })
}

fn received(bench: &Bench<Xmodem>) -> Vec<(Vec<u8>, Option<Failure>)> {
    bench.deliveries().iter().map(|d| (d.bytes.clone(), d.failure)).collect()
}

#[test]
fn a_file_comes_with_crc() {
    for swaps in [false, true] {
        let mut bench = bench().open();
        let mut ear = Ear::new();
        let swap = |bench: &mut Bench<Xmodem>| {
            if swaps {
                bench.swap();
            }
        };
        assert_eq!(ear.after(&mut bench, &[], 2_500), [C]);
        assert_eq!(ear.after(&mut bench, &[], 3_000), [C]);
        swap(&mut bench);
        assert_eq!(ear.after(&mut bench, &block(1, &[b'a'; 128]), 100), [ACK]);
        // Our ACK was lost: once more, and it is dropped.
        assert_eq!(ear.after(&mut bench, &block(1, &[b'a'; 128]), 100), [ACK]);
        let second = block(2, b"end\x1A\x1A");
        bench.receive(&second[..70]);
        swap(&mut bench);
        assert_eq!(ear.after(&mut bench, &second[70..], 100), [ACK]);
        // A bit is wrong: NAK, once the line is clear.
        let mut damaged = block(3, b"x");
        damaged[4] ^= 1;
        assert_eq!(ear.after(&mut bench, &damaged, 999), SILENCE);
        swap(&mut bench);
        assert_eq!(ear.after(&mut bench, &[], 10), [NAK]);
        assert_eq!(ear.after(&mut bench, &block(3, b"x"), 100), [ACK]);
        assert_eq!(ear.after(&mut bench, &[EOT], 1_100), [NAK]);
        swap(&mut bench);
        assert_eq!(ear.after(&mut bench, &[EOT], 1_100), [ACK]);
        // The ACK was lost.
        assert_eq!(ear.after(&mut bench, &[EOT], 1_100), [ACK]);
        let mut data = vec![b'a'; 128];
        data.extend(padded(b"end", 128));
        data.push(b'x');
        assert_eq!(received(&bench), [(data, None)]);
        assert_eq!(ear.after(&mut bench, &[], 10_000), [C]);
    }
}

#[test]
fn a_file_comes_with_checksum_after_four_calls_for_crc() {
    let mut bench = bench().set("end_twice", "off").open();
    let mut ear = Ear::new();
    assert_eq!(ear.after(&mut bench, &[], 14_900), [C, C, C, C, NAK]);
    assert_eq!(ear.after(&mut bench, &summed(1, b"abc"), 100), [ACK]);
    assert_eq!(ear.after(&mut bench, &[EOT], 1_100), [ACK]);
    assert_eq!(received(&bench), [(b"abc".to_vec(), None)]);
}

#[test]
fn blocks_of_both_lengths_come() {
    let mut bench = bench().set("padding", "keep").open();
    let mut ear = Ear::new();
    assert_eq!(ear.after(&mut bench, &[], 100), [C]);
    assert_eq!(ear.after(&mut bench, &long(1, &[7; 1_024]), 100), [ACK]);
    assert_eq!(ear.after(&mut bench, &block(2, b"z"), 100), [ACK]);
    assert_eq!(ear.after(&mut bench, &[EOT], 1_100), [NAK]);
    assert_eq!(ear.after(&mut bench, &[EOT], 1_100), [ACK]);
    let data = [vec![7; 1_024], padded(b"z", 128)].concat();
    assert_eq!(received(&bench), [(data, None)]);
}

#[test]
fn numbers_go_on_at_0_behind_255() {
    let mut bench = bench().open();
    let mut ear = Ear::new();
    ear.after(&mut bench, &[], 100);
    for number in (1..=600_u32).map(|number| number as u8) {
        assert_eq!(ear.after(&mut bench, &block(number, &[number; 128]), 10), [ACK], "{number}");
    }
    // What was two blocks before is no repetition.
    assert_eq!(ear.after(&mut bench, &block(87, &[0; 128]), 100), [CAN; 8]);
    let deliveries = received(&bench);
    assert_eq!(deliveries[0].0.len(), 599 * 128 + 128);
    assert_eq!(deliveries[0].1, Some(Failure::Protocol));
}

#[test]
fn the_end_in_place_of_a_missing_block_is_none() {
    let mut bench = bench().open();
    let mut ear = Ear::new();
    ear.after(&mut bench, &[], 100);
    assert_eq!(ear.after(&mut bench, &block(1, b"a"), 100), [ACK]);
    // SOH is damaged: all of the block is noise.
    let mut damaged = block(2, b"b");
    damaged[0] = 0x41;
    assert_eq!(ear.after(&mut bench, &damaged, 1_100), [NAK]);
    assert_eq!(ear.after(&mut bench, &[EOT], 1_100), [CAN; 8]);
    assert_eq!(received(&bench)[0].1, Some(Failure::Protocol));
}

#[test]
fn a_damaged_end_is_asked_for_again() {
    let mut bench = bench().open();
    let mut ear = Ear::new();
    ear.after(&mut bench, &[], 100);
    assert_eq!(ear.after(&mut bench, &block(1, b"a"), 100), [ACK]);
    assert_eq!(ear.after(&mut bench, &[EOT ^ 8], 1_100), [NAK]);
    bench.line_error(LineErrorKind::Framing, Some(EOT));
    assert_eq!(ear.after(&mut bench, &[], 1_100), [NAK]);
    // Two of them, or one and something, are none.
    assert_eq!(ear.after(&mut bench, &[EOT, b'x'], 1_100), [NAK]);
    assert_eq!(ear.after(&mut bench, &[EOT, EOT], 1_100), [NAK]);
    assert_eq!(ear.after(&mut bench, &[EOT], 1_100), [ACK]);
    assert_eq!(received(&bench), [(b"a".to_vec(), None)]);
}

#[test]
fn silence_and_damage_end_a_reception() {
    let mut bench = bench().set_all(&[("repeats", "2"), ("call", "on")]).open();
    let mut ear = Ear::new();
    ear.after(&mut bench, &[], 100);
    ear.after(&mut bench, &block(1, b"a"), 100);
    assert_eq!(ear.after(&mut bench, &[], 29_800), [NAK, NAK]);
    assert_eq!(ear.after(&mut bench, &[], 1_000), [CAN; 8]);
    assert_eq!(received(&bench)[0].1, Some(Failure::NoAnswer));
    assert_eq!(ear.after(&mut bench, &[], 9_100), [C]);
    assert_eq!(ear.after(&mut bench, &block(1, b"b"), 100), [ACK]);
    bench.receive(&block(2, b"c")[..100]);
    assert_eq!(ear.after(&mut bench, &[], 1_100), [NAK]);
    assert_eq!(ear.after(&mut bench, &[CAN, b'x'], 1_100), [NAK]);
    assert_eq!(ear.after(&mut bench, &[CAN, CAN], 1_100), SILENCE);
    assert_eq!(received(&bench)[1].1, Some(Failure::NoEndMark));
}

#[test]
fn a_block_waits_for_room() {
    let mut bench = bench().room(64, 100).drain_by_hand().open();
    let mut ear = Ear::new();
    assert_eq!(ear.after(&mut bench, &[], 100), [C]);
    assert_eq!(ear.after(&mut bench, &block(1, &[9; 128]), 100), SILENCE);
    bench.drain(27);
    assert_eq!(ear.after(&mut bench, &[], 100), SILENCE);
    bench.swap();
    bench.drain(73);
    assert_eq!(ear.after(&mut bench, &[], 100), [ACK]);
    bench.host(|link, now, host| link.abort(now, JobId::NONE, host));
    assert_eq!(received(&bench), [(vec![9; 128], Some(Failure::Aborted))]);
    assert_eq!(ear.after(&mut bench, &[], 900), SILENCE);
    assert_eq!(ear.after(&mut bench, &[], 200), [CAN; 8]);
}

#[test]
fn a_job_goes_with_crc() {
    for swaps in [false, true] {
        let mut bench = bench().open();
        let mut ear = Ear::new();
        let swap = |bench: &mut Bench<Xmodem>| {
            if swaps {
                bench.swap();
            }
        };
        assert_eq!(ear.after(&mut bench, &[], 100), [C]);
        bench.send(&[vec![b'a'; 128], b"xyz".to_vec()].concat());
        assert_eq!(ear.after(&mut bench, &[b'x', ACK], 20_000), SILENCE);
        swap(&mut bench);
        assert_eq!(ear.after(&mut bench, &[C], 500), block(1, &[b'a'; 128]));
        // Until the first ACK a C is a NAK.
        assert_eq!(ear.after(&mut bench, &[C], 500), block(1, &[b'a'; 128]));
        assert_eq!(ear.after(&mut bench, &[NAK], 500), block(1, &[b'a'; 128]));
        // It was repeated: what comes behind the ACK belongs to it.
        assert_eq!(ear.after(&mut bench, &[ACK], 500), SILENCE);
        swap(&mut bench);
        assert_eq!(ear.after(&mut bench, &[ACK], 999), SILENCE);
        assert_eq!(ear.after(&mut bench, &[], 500), block(2, b"xyz"));
        assert_eq!(ear.after(&mut bench, &[C], 500), SILENCE);
        swap(&mut bench);
        assert_eq!(ear.after(&mut bench, &[ACK], 500), [EOT]);
        assert_eq!(ear.after(&mut bench, &[NAK], 500), [EOT]);
        assert_eq!(ear.after(&mut bench, &[], 9_600), [EOT]);
        assert_eq!(job_end(&bench), None);
        bench.receive(&[ACK]);
        assert_eq!(job_end(&bench), Some((None, 4 * 133 + 3)));
        assert_eq!(ear.after(&mut bench, &[], 10_100), [C]);
    }
}

#[test]
fn an_empty_job_is_its_end() {
    let mut bench = bench().open();
    let mut ear = Ear::new();
    ear.after(&mut bench, &[], 100);
    bench.send(b"");
    assert_eq!(ear.after(&mut bench, &[NAK], 100), [EOT]);
    bench.receive(&[ACK]);
    assert_eq!(job_end(&bench), Some((None, 1)));
}

#[test]
fn a_job_goes_with_checksum() {
    let mut bench = bench().open();
    let mut ear = Ear::new();
    ear.after(&mut bench, &[], 100);
    bench.send(b"abc");
    assert_eq!(ear.after(&mut bench, &[NAK], 500), summed(1, b"abc"));
    // An ACK that comes before the block can have left is none.
    assert_eq!(ear.after(&mut bench, &[NAK], 100), summed(1, b"abc")[..97]);
    assert_eq!(ear.after(&mut bench, &[ACK], 500), summed(1, b"abc")[97..]);
    assert_eq!(ear.after(&mut bench, &[CAN, CAN], 500), SILENCE);
    assert_eq!(job_end(&bench), Some((Some(Failure::Refused), 2 * 132)));
}

#[test]
fn long_blocks_become_short_ones() {
    let data: Vec<u8> = (0..5_000_u32).map(|place| (place / 7) as u8).collect();
    let mut bench = bench().set("mode", "1k").open();
    let mut ear = Ear::new();
    ear.after(&mut bench, &[], 100);
    bench.send(&data);
    assert_eq!(ear.after(&mut bench, &[C], 2_000), long(1, &data[..1_024]));
    assert_eq!(ear.after(&mut bench, &[NAK], 2_000), long(1, &data[..1_024]));
    assert_eq!(ear.after(&mut bench, &[ACK], 3_000), long(2, &data[1_024..2_048]));
    assert_eq!(ear.after(&mut bench, &[NAK], 2_000), long(2, &data[1_024..2_048]));
    assert_eq!(ear.after(&mut bench, &[NAK], 2_000), long(2, &data[1_024..2_048]));
    assert_eq!(ear.after(&mut bench, &[ACK], 3_000), block(3, &data[2_048..2_176]));
    assert_eq!(ear.after(&mut bench, &[ACK], 3_000), block(4, &data[2_176..2_304]));
}

#[test]
fn a_rest_goes_in_short_blocks() {
    for (rest, is_long) in [(897, true), (896, false), (1, false)] {
        let data = vec![b'r'; 1_024 + rest];
        let mut bench = bench().set("mode", "1k").open();
        let mut ear = Ear::new();
        ear.after(&mut bench, &[], 100);
        bench.send(&data);
        assert_eq!(ear.after(&mut bench, &[C], 2_000), long(1, &data[..1_024]));
        if is_long {
            assert_eq!(ear.after(&mut bench, &[ACK], 2_000), long(2, &data[1_024..]));
        } else {
            for (number, part) in (2..).zip(data[1_024..].chunks(128)) {
                assert_eq!(ear.after(&mut bench, &[ACK], 2_000), block(number, part));
            }
        }
        assert_eq!(ear.after(&mut bench, &[ACK], 2_000), [EOT]);
    }
}

#[test]
fn an_abort_lets_the_block_become_whole() {
    let mut bench = bench().open();
    let mut ear = Ear::new();
    ear.after(&mut bench, &[], 100);
    let job = bench.send(&[b'a'; 300]);
    assert_eq!(ear.after(&mut bench, &[C], 100).len(), 97);
    bench.swap();
    bench.host(|link, now, host| link.abort(now, job, host));
    let rest = [block(1, &[b'a'; 128])[97..].to_vec(), vec![CAN; 8]].concat();
    assert_eq!(ear.after(&mut bench, &[], 500), rest);
    assert_eq!(job_end(&bench), Some((Some(Failure::Aborted), 133)));
    // Nothing more is said to the receiver.
    assert_eq!(ear.after(&mut bench, &[C, NAK], 5_000), SILENCE);
}

#[test]
fn nobody_answers() {
    let mut bench = bench().set_all(&[("request_time", "5000"), ("answer_time", "2000")]).open();
    let mut ear = Ear::new();
    ear.after(&mut bench, &[], 100);
    bench.send(b"1");
    bench.run_for_millis(5_001);
    assert_eq!(job_end(&bench), Some((Some(Failure::NoAnswer), 0)));
    bench.send(b"2");
    assert_eq!(ear.after(&mut bench, &[C], 2_000), block(1, b"2"));
    assert_eq!(ear.after(&mut bench, &[], 1_000), [CAN; 8]);
    assert_eq!(job_end(&bench), Some((Some(Failure::NoAnswer), 133)));
}

#[test]
fn a_narrow_line_carries_nothing() {
    let mut line = softplug_plugin::LineParameters::new(9_600);
    line.data_bits = 7;
    let mut bench = bench().line(line).open();
    bench.run_for_millis(20_000);
    bench.send(b"1");
    assert_eq!(job_end(&bench), Some((Some(Failure::NotSupported), 0)));
    assert_eq!(bench.sent(), SILENCE);
}
