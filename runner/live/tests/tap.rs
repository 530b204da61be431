//! A tap between two ports: all passes, in order, and is told as it passed.
#![cfg(target_os = "linux")]

use std::io::{Read, Write};
use std::net::TcpListener;

use softplug_abi::{LineParameters, LinkDownReason, Micros};
use softplug_live::pty::PtyPair;
use softplug_live::tap::{Event, Side, Tap, Turn};
use softplug_live::{Input, Port, PortOptions, PortSpec, ReadOutcome};

/// No tap may hold more of one direction than this.
const MOST_HELD: usize = 4_096;

fn slave(pair: &PtyPair) -> Port {
    let spec = PortSpec::Device(pair.slave_path().to_owned());
    Port::open(&spec, &PortOptions::new(LineParameters::new(9_600))).unwrap()
}

/// All byte values, FF and 00 often, so that marks could be mistaken.
fn data(bytes: usize, seed: usize) -> Vec<u8> {
    let byte = |n: usize| match n * 7 % 5 {
        0 => 0xFF,
        1 => 0,
        _ => (n * seed / 3) as u8,
    };
    (0..bytes).map(byte).collect()
}

/// Both partners, and what the tap told.
struct Bench {
    tap: Tap,
    pairs: [Option<PtyPair>; 2],
    sent: [usize; 2],
    got: [Vec<u8>; 2],
    heard: [Vec<u8>; 2],
    passed: [Vec<u8>; 2],
    times: Vec<Micros>,
}

impl Bench {
    fn new() -> Self {
        let pairs = [PtyPair::open().unwrap(), PtyPair::open().unwrap()];
        let tap = Tap::new(slave(&pairs[0]), slave(&pairs[1])).unwrap();
        let none = || [Vec::new(), Vec::new()];
        let pairs = pairs.map(Some);
        let (heard, passed, times) = (none(), none(), Vec::new());
        Self { tap, pairs, sent: [0; 2], got: none(), heard, passed, times }
    }

    fn turn(&mut self) -> Turn {
        let until = self.tap.now() + Micros::from_millis(1);
        let (heard, passed, times) = (&mut self.heard, &mut self.passed, &mut self.times);
        let turn = self.tap.turn(until, &mut |at, event| {
            times.push(at);
            match event {
                Event::Heard { from, what: Input::Bytes(bytes) } => {
                    heard[from as usize].extend(bytes);
                }
                Event::Passed { to, what: Input::Bytes(bytes) } => {
                    passed[to.other() as usize].extend(bytes);
                }
                other => panic!("{other:?} on a pty"),
            }
        });
        for side in [Side::A, Side::B] {
            assert!(self.tap.held(side) <= MOST_HELD);
        }
        turn.unwrap()
    }

    /// The partner of a side writes what its port takes.
    fn write(&mut self, side: usize, data: &[u8]) -> usize {
        let rest = &data[self.sent[side]..];
        let Some(pair) = &self.pairs[side] else { return 0 };
        let written = pair.write(&rest[..rest.len().min(1_000)]).unwrap();
        self.sent[side] += written;
        written
    }

    /// The partner of a side reads what is there.
    fn read(&mut self, side: usize) {
        let mut buffer = [0; 777];
        let Some(pair) = &self.pairs[side] else { return };
        while let ReadOutcome::Read(count) = pair.read(&mut buffer).unwrap() {
            self.got[1 - side].extend_from_slice(&buffer[..count]);
        }
    }
}

#[test]
fn every_byte_passes_both_ways_under_load() {
    let mut bench = Bench::new();
    let data = [data(120_000, 11), data(90_000, 29)];
    while bench.got[0].len() < data[0].len() || bench.got[1].len() < data[1].len() {
        for side in [0, 1] {
            bench.write(side, &data[side]);
            bench.read(side);
        }
        assert_eq!(bench.turn(), Turn::Live);
    }
    for (side, data) in data.iter().enumerate() {
        assert!(bench.got[side] == *data, "side {side}: other bytes arrived");
        assert!(bench.heard[side] == *data && bench.passed[side] == *data, "side {side}");
    }
    assert!(bench.times.is_sorted());
}

#[test]
fn a_side_that_stalls_holds_up_the_other_and_loses_nothing() {
    let mut bench = Bench::new();
    let (much, little) = (data(400_000, 17), data(5_000, 3));
    // B reads nothing: A is held up at some time, and B is heard all the same.
    let mut idle = 0;
    while idle < 50 {
        let written = bench.write(0, &much);
        bench.write(1, &little);
        bench.read(0);
        bench.turn();
        idle = if written > 0 { 0 } else { idle + 1 };
    }
    assert!(bench.sent[0] < much.len(), "nobody held A up");
    assert!(bench.got[1] == little, "B was not heard while it stalled");
    let stalled_at = bench.passed[0].len();
    while bench.got[0].len() < much.len() {
        bench.write(0, &much);
        bench.read(1);
        bench.turn();
    }
    assert!(bench.got[0] == much, "bytes were lost or altered by the stall");
    assert!(stalled_at < much.len());
}

#[test]
fn an_unplugged_side_is_named_and_what_it_said_still_passes() {
    let mut bench = Bench::new();
    let data = data(3_000, 5);
    while bench.write(0, &data) > 0 {}
    while bench.heard[0].len() < data.len() {
        assert_eq!(bench.turn(), Turn::Live);
    }
    bench.pairs[0] = None;
    let gone = loop {
        match bench.turn() {
            Turn::Live => {}
            Turn::Gone(side, reason) => break (side, reason),
        }
    };
    assert_eq!(gone, (Side::A, LinkDownReason::Unplugged));
    let held = bench.tap.finish(&mut |_, event| match event {
        Event::Passed { to: Side::B, what: Input::Bytes(bytes) } => bench.passed[0].extend(bytes),
        other => panic!("{other:?} after the end"),
    });
    assert_eq!(held.unwrap(), [0, 0]);
    bench.read(1);
    assert!(bench.got[0] == data && bench.passed[0] == data);
}

#[test]
fn what_cannot_be_passed_on_is_counted() {
    let mut bench = Bench::new();
    let data = data(400_000, 7);
    let mut idle = 0;
    while idle < 50 {
        let written = bench.write(0, &data);
        bench.turn();
        idle = if written > 0 { 0 } else { idle + 1 };
    }
    let held = bench.tap.finish(&mut |_, _| {}).unwrap();
    assert_eq!(held, [bench.heard[0].len() - bench.passed[0].len(), 0]);
    assert!(held[0] > 0);
}

#[test]
fn a_device_server_and_a_pty_made_here_are_sides_too() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let spec: PortSpec = format!("tcp://{}", listener.local_addr().unwrap()).parse().unwrap();
    let options = PortOptions::new(LineParameters::new(9_600));
    let server = Port::open(&spec, &options).unwrap();
    let (mut machine, _) = listener.accept().unwrap();
    let pty = Port::open(&PortSpec::Pty, &options).unwrap();
    let path = pty.slave_path().unwrap().to_owned();
    let mut tap = Tap::new(pty, server).unwrap();
    let mut software =
        Port::open(&PortSpec::Device(path), &PortOptions::new(LineParameters::new(9_600))).unwrap();

    machine.write_all(b"\x11\xFF\x00").unwrap();
    assert_eq!(software.write(b"%\nM30\n%").unwrap(), 7);
    let mut got = Vec::new();
    while got.len() < 3 {
        tap.turn(tap.now() + Micros::from_millis(1), &mut |_, _| {}).unwrap();
        let mut sink = |input: Input<'_>| match input {
            Input::Bytes(bytes) => got.extend_from_slice(bytes),
            other @ Input::LineError { .. } => panic!("{other:?}"),
        };
        software.read(usize::MAX, &mut sink).unwrap();
    }
    assert_eq!(got, b"\x11\xFF\x00");
    while tap.held(Side::A) > 0 {
        tap.turn(tap.now() + Micros::from_millis(1), &mut |_, _| {}).unwrap();
    }
    let mut program = [0; 7];
    machine.read_exact(&mut program).unwrap();
    assert_eq!(&program, b"%\nM30\n%");
    drop(machine);
    let gone = loop {
        let until = tap.now() + Micros::from_millis(1);
        if let Turn::Gone(side, reason) = tap.turn(until, &mut |_, _| {}).unwrap() {
            break (side, reason);
        }
    };
    assert_eq!(gone, (Side::B, LinkDownReason::Disconnected));
}
