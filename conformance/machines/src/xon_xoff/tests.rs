//! The simulated control alone, and in a loop with a sender of a few lines.

use softplug_abi::{LineParameters, Micros};

use super::*;
use crate::kept::Keep;

const XON: u8 = 0x11;
const XOFF: u8 = 0x13;
/// One character at 9,600 8N1, rounded up.
const CHARACTER: i64 = 1_042;

fn control(options: ControlOptions) -> Control {
    Control::new(options).expect("the test's options are sound")
}

/// 100 bytes, XOFF under 20 and XON over 60 free, nothing executed for a second.
fn paused() -> ControlOptions {
    ControlOptions {
        buffer: 100,
        low: 20,
        high: 60,
        pauses: vec![(0, Micros::from_secs(1))],
        ..ControlOptions::default()
    }
}

fn at(count: u64) -> Micros {
    LineParameters::new(9_600).characters(count)
}

/// `count` characters back to back from time 0; what the control sent then.
fn flood(control: &mut Control, count: u64) -> Vec<(Micros, u8)> {
    let mut sent = Vec::new();
    for n in 1..=count {
        drain(control, at(n), &mut sent);
        control.receive(at(n), b'a' + (n % 26) as u8);
    }
    sent
}

/// Runs the control up to `until` at its own event times.
fn drain(control: &mut Control, until: Micros, sent: &mut Vec<(Micros, u8)>) {
    while let Some(next) = control.next_event().filter(|&next| next <= until) {
        control.advance(next);
        while let Some(byte) = control.poll_transmit(next) {
            sent.push((next, byte));
        }
    }
    control.advance(until);
}

fn run(control: &mut Control, until: i64) -> Vec<(i64, u8)> {
    let mut sent = Vec::new();
    drain(control, Micros(until), &mut sent);
    sent.into_iter().map(|(at, byte)| (at.0, byte)).collect()
}

#[test]
fn xoff_goes_out_when_the_free_space_falls_under_the_low_mark() {
    let mut control = control(paused());
    assert_eq!(flood(&mut control, 80), []);
    assert!(!control.holds_line());
    // The 81st leaves 19 free: XOFF takes a character's time to leave.
    control.receive(at(81), b'x');
    assert_eq!(control.next_event(), Some(at(81) + Micros(CHARACTER)));
    assert_eq!(run(&mut control, at(82).0 + 1), [(at(81).0 + CHARACTER, XOFF)]);
    assert!(control.holds_line());
    let report = control.report();
    assert_eq!((report.holds, report.xoffs, report.xons, report.largest_level), (1, 1, 0, 81));
}

#[test]
fn a_sender_that_does_not_stop_overflows_the_buffer() {
    let mut control = control(paused());
    let sent = flood(&mut control, 103);
    assert_eq!(sent, [(at(81) + Micros(CHARACTER), XOFF)]);
    let report = control.report();
    let alarms: Vec<_> = report.alarms.iter().map(|a| (a.at, a.position, a.kind)).collect();
    let overflow = AlarmKind::BufferOverflow;
    assert_eq!(
        alarms,
        [(at(101), 100, overflow), (at(102), 101, overflow), (at(103), 102, overflow)]
    );
    assert_eq!((report.received.count(), report.arrived, report.consumed), (100, 103, 0));
    // XOFF left between the 82nd and the 83rd: the 83rd to the 103rd are late.
    assert_eq!(report.characters_after_xoff, Counts(vec![21]));
    assert_eq!(report.late, Micros::ZERO);
}

#[test]
fn a_character_that_ends_together_with_xoff_is_not_late() {
    let line = LineParameters::new(10_000);
    let mut control = control(ControlOptions { line, ..paused() });
    for n in 1..=83 {
        let now = line.characters(n);
        let mut sent = Vec::new();
        drain(&mut control, now, &mut sent);
        control.receive(now, b'x');
    }
    // XOFF started with the end of the 81st and left with that of the 82nd.
    assert_eq!(control.report().characters_after_xoff, Counts(vec![1]));
}

#[test]
fn xon_goes_out_on_draining_without_any_arrival() {
    let mut control = control(ControlOptions { rate: 1_000, ..paused() });
    flood(&mut control, 81);
    // The pause began with the first byte, which came at 1,042 µs. Then 42
    // bytes at 1,000 a second leave 39 in the buffer, 61 free.
    let decided = CHARACTER + 1_000_000 + 42_000;
    let sent = run(&mut control, 3_000_000);
    let xoff_left = at(81).0 + CHARACTER;
    assert_eq!(sent, [(xoff_left, XOFF), (decided + CHARACTER, XON)]);
    let report = control.report();
    assert_eq!(report.held, Micros(decided + CHARACTER - xoff_left));
    assert_eq!((report.consumed, report.holds), (81, 1));
    assert_eq!(report.characters_after_xoff, Counts(vec![0]));
    // Empty at the end of the program is not starved.
    assert_eq!((report.starved, report.starved_for), (0, Micros::ZERO));
}

#[test]
fn the_control_reacts_after_its_latency_in_both_decisions() {
    let options = ControlOptions { rate: 1_000, latency: Micros(5_000), ..paused() };
    let mut control = control(options);
    // In 5 ms five characters arrive, so the FIFO is served for five at a time:
    // those that the 1st, 6th, 11th, … and the 81st began.
    let sent = flood(&mut control, 90);
    assert_eq!(sent.len(), 1);
    assert_eq!(sent[0], (at(81) + Micros(5_000 + CHARACTER), XOFF));
    let rest = run(&mut control, 3_000_000);
    // 90 bytes, 39 stay: 51 at 1,000 a second; the pause began at 6,042 µs.
    assert_eq!(rest, [(6_042 + 1_000_000 + 51_000 + 5_000 + CHARACTER, XON)]);
}

#[test]
fn a_slow_control_overruns_its_receive_fifo() {
    let options = ControlOptions { latency: Micros(5_000), receive_fifo: 4, ..paused() };
    let mut control = control(options);
    flood(&mut control, 12);
    run(&mut control, 100_000);
    let report = control.report();
    let alarms: Vec<_> = report.alarms.iter().map(|a| (a.at, a.position, a.kind)).collect();
    assert_eq!(alarms, [(at(5), 4, AlarmKind::Overrun), (at(10), 9, AlarmKind::Overrun)]);
    assert!(report.received.matches(b"bcdeghijlm"));
}

#[test]
fn xon_is_repeated_on_silence_but_never_while_the_line_is_held() {
    let options = ControlOptions {
        repeat_xon: Some(Micros::from_millis(300)),
        xon_at_start: Some(Micros(10)),
        ..paused()
    };
    let mut control = control(options);
    let first = 10 + CHARACTER;
    let second = first + 300_000 + CHARACTER;
    assert_eq!(
        run(&mut control, 700_000),
        [(first, XON), (second, XON), (second + 300_000 + CHARACTER, XON)]
    );
    // A character restarts the silence.
    control.receive(Micros(800_000), b'x');
    assert_eq!(run(&mut control, 1_099_999), []);
    assert_eq!(run(&mut control, 1_101_042), [(1_100_000 + CHARACTER, XON)]);
    // 81 bytes hold it until the pause, which ends at 1.8 s, lets it drain.
    for n in 0..80 {
        control.receive(Micros(1_200_000) + at(n), b'x');
    }
    let sent = run(&mut control, 2_000_000);
    assert_eq!(sent, [(1_200_000 + at(79).0 + CHARACTER, XOFF), (1_800_000 + CHARACTER, XON)]);
    assert_eq!(control.report().holds, 1);
}

#[test]
fn xoff_is_repeated_after_further_characters_and_counts_as_one_hold() {
    let mut control = control(ControlOptions { repeat_xoff: Some(5), ..paused() });
    let sent = flood(&mut control, 95);
    let xoffs: Vec<_> = [81, 86, 91].iter().map(|&n| (at(n) + Micros(CHARACTER), XOFF)).collect();
    assert_eq!(sent, xoffs);
    let report = control.report();
    assert_eq!((report.holds, report.xoffs), (1, 3));
    assert_eq!(report.characters_after_xoff, Counts(vec![13]));
}

#[test]
fn a_punched_program_leaves_back_to_back() {
    let mut control = control(ControlOptions::default());
    control.punch(Micros(100), b"%\nO1\n".to_vec());
    let sent = run(&mut control, 1_000_000);
    let expected: Vec<_> =
        b"%\nO1\n".iter().zip(1..).map(|(&byte, n)| (100 + at(n).0, byte)).collect();
    assert_eq!(sent, expected);
    let report = control.report();
    assert_eq!((report.punched, report.punch_waiting), (5, 0));
}

#[test]
fn a_punching_control_obeys_after_its_latency_and_what_its_fifo_holds_still_leaves() {
    let options =
        ControlOptions { transmit_fifo: 16, latency: Micros(3_000), ..ControlOptions::default() };
    let mut control = control(options);
    control.punch(Micros::ZERO, vec![b'x'; 100]);
    let start = 3_000;
    let stop = start + at(10).0;
    assert_eq!(run(&mut control, stop).len(), 10);
    control.receive(Micros(stop), XOFF);
    // It looks 3 ms later, when 12 have left and 16 more are in the FIFO.
    let sent = run(&mut control, 900_000);
    assert_eq!(sent.len(), 18);
    assert_eq!(sent[17], (start + at(28).0, b'x'));
    control.receive(Micros(1_000_000), XON);
    let sent = run(&mut control, 2_000_000);
    assert_eq!((sent.len(), sent[0]), (72, (1_003_000 + CHARACTER, b'x')));
    let report = control.report();
    assert_eq!((report.punched, report.punch_waiting), (100, 0));
    assert_eq!(report.punched_after_xoff, Counts(vec![18]));
    assert_eq!((report.arrived, report.received.count()), (0, 0));
}

#[test]
fn its_own_xoff_goes_in_front_of_the_program_that_it_sends() {
    let mut control = control(ControlOptions { transmit_fifo: 2, ..paused() });
    control.punch(Micros::ZERO, vec![b'p'; 300]);
    let sent = flood(&mut control, 90);
    let place = sent.iter().position(|&(_, byte)| byte == XOFF);
    // At the end of the 81st, two of the program stand in the FIFO: the 82nd
    // and the 83rd.
    assert_eq!(place, Some(83));
    assert_eq!(sent[83].0, at(84));
}

#[test]
fn control_bytes_are_settable_and_data_where_they_are_not_obeyed() {
    let mut settable = control(ControlOptions { xoff: 0x93, xon: 0x91, ..paused() });
    assert_eq!(flood(&mut settable, 83)[0].1, 0x93);
    settable.receive(at(84), 0x13);
    assert_eq!(settable.report().arrived, 84);

    let mut deaf = control(ControlOptions { obey: false, ..ControlOptions::default() });
    deaf.punch(Micros::ZERO, vec![b'x'; 3]);
    deaf.receive(Micros(1), XOFF);
    assert_eq!(run(&mut deaf, 10_000).len(), 3);
    assert!(deaf.report().received.matches(&[XOFF]));
}

#[test]
fn an_echoing_control_sends_data_back_but_no_control_bytes() {
    let mut control = control(ControlOptions { echo: true, ..ControlOptions::default() });
    let mut sent = Vec::new();
    for (n, &byte) in (1..).zip(b"A\x13BC") {
        drain(&mut control, at(n), &mut sent);
        control.receive(at(n), byte);
    }
    // Stopped by the XOFF, while the echo of A is on the wire.
    drain(&mut control, at(100), &mut sent);
    assert_eq!(sent, [(at(1) + Micros(CHARACTER), b'A')]);
    control.receive(at(101), XON);
    drain(&mut control, at(200), &mut sent);
    assert_eq!(sent[1..].iter().map(|&(_, byte)| byte).collect::<Vec<_>>(), b"BC");
}

#[test]
fn an_empty_buffer_in_mid_program_is_counted_and_timed() {
    let mut control = control(ControlOptions { rate: 100, ..paused() });
    // Paused until 1.0 s; 3 bytes are executed by 1.03 s; the next one is late.
    for now in [0, 10, 20] {
        control.receive(Micros(now), b'x');
    }
    control.receive(Micros(1_250_000), b'x');
    control.receive(Micros(1_255_000), b'x');
    control.advance(Micros(9_000_000));
    let report = control.report();
    assert_eq!((report.starved, report.starved_for), (1, Micros(220_000)));
    assert_eq!(report.consumed, 5);
}

#[test]
fn feed_holds_stop_the_execution_where_they_are_set() {
    let pauses = vec![(2, Micros(50_000)), (3, Micros(7_000))];
    let mut control = control(ControlOptions { rate: 1_000, pauses, ..ControlOptions::default() });
    for _ in 0..5 {
        control.receive(Micros::ZERO, b'x');
    }
    let consumed = |control: &mut Control, now| {
        control.advance(Micros(now));
        control.report().consumed
    };
    let steps = [(999, 0), (1_000, 1), (2_000, 2), (52_999, 2), (53_000, 3), (60_999, 3)];
    for (now, count) in steps {
        assert_eq!(consumed(&mut control, now), count, "at {now} µs");
    }
    assert_eq!(consumed(&mut control, 61_000), 4);
    assert_eq!(consumed(&mut control, 62_000), 5);
}

#[test]
fn lateness_is_the_drivers_and_is_reported() {
    let mut control = control(paused());
    flood(&mut control, 81);
    let due = control.next_event().expect("XOFF is on its way out");
    control.advance(due + Micros(1_234));
    assert_eq!(control.poll_transmit(due + Micros(1_234)), Some(XOFF));
    let report = control.report();
    assert_eq!(report.late, Micros(1_234));
    // The XOFF's own time is the one at which its last bit left.
    control.advance(due + Micros(2_000));
    assert_eq!(control.report().held, Micros(2_000));
}

/// A sender of a few lines that has up to `depth` characters under way.
struct Sender<'a> {
    program: std::slice::Iter<'a, u8>,
    uart: Uart,
    held: bool,
}

/// Sends `program` until all has arrived, each side at its own event times.
fn transfer(options: ControlOptions, depth: usize, program: &[u8]) -> ControlReport {
    let mut sender = Sender {
        program: program.iter(),
        uart: Uart::new(UartOptions {
            line: options.line,
            transmit_fifo: depth,
            receive_fifo: 1,
            latency: Micros::ZERO,
        }),
        held: false,
    };
    let mut control = control(options);
    let mut now = Micros::ZERO;
    loop {
        while let Some(byte) = control.poll_transmit(now) {
            sender.held = byte == XOFF;
        }
        while let Some(left) = sender.uart.poll(now) {
            control.receive(now, left.byte);
        }
        while !sender.held && sender.uart.has_room() {
            let Some(&byte) = sender.program.next() else { break };
            assert!(sender.uart.push(now, byte, Sort::Data));
        }
        let next = sender.uart.next_left().into_iter().chain(control.next_event()).min();
        let Some(next) = next.filter(|_| control.arrived < program.len() as u64) else {
            break;
        };
        now = next;
    }
    drain(&mut control, now + Micros::from_secs(3_600), &mut Vec::new());
    control.report()
}

fn program(length: usize) -> Vec<u8> {
    (0..length).map(|n| b"G1X12.345Y-0.5Z3\n"[n % 17]).collect()
}

#[test]
fn a_slow_control_holds_an_obedient_sender_and_loses_nothing() {
    let program = program(100_000);
    for depth in [1, 2, 4, 32] {
        // A latency that lets XOFF leave in the middle of a character.
        let options = ControlOptions {
            rate: 300,
            latency: Micros(300),
            keep: Keep::Digest,
            ..ControlOptions::default()
        };
        let report = transfer(options, depth, &program);
        assert!(report.received.matches(&program));
        assert_eq!(report.alarms, []);
        assert_eq!(report.consumed, 100_000);
        assert_eq!(report.late, Micros::ZERO);
        assert_eq!(report.characters_after_xoff.max() as usize, depth, "depth {depth}");
        // An execution at a third of the line's rate never waits.
        assert_eq!(report.starved, 0);
        assert!(report.holds > 300, "{} holds", report.holds);
        assert_eq!(report.holds, report.xoffs);
        // All that is lost is the time in which XON comes back.
        let rate = report.rate_while_allowed();
        assert!((930.0..961.0).contains(&rate), "{rate} bytes a second");
    }
}

#[test]
fn a_megabyte_at_921_600_baud_is_held_hundreds_of_times_and_arrives() {
    let program = program(1_000_000);
    let options = ControlOptions {
        line: LineParameters::new(921_600),
        rate: 60_000,
        latency: Micros(5),
        keep: Keep::Digest,
        ..ControlOptions::default()
    };
    let report = transfer(options, 16, &program);
    assert!(report.received.matches(&program));
    assert_eq!(report.alarms, []);
    assert_eq!(report.characters_after_xoff.max(), 16);
    assert!(report.holds > 300, "{} holds", report.holds);
    assert!(report.rate_while_allowed() > 0.9 * 92_160.0);
}

#[test]
fn a_sender_deeper_than_the_reserve_overflows_the_control() {
    let program = program(10_000);
    let report = transfer(ControlOptions { rate: 300, ..ControlOptions::default() }, 200, &program);
    assert!(!report.alarms.is_empty());
    assert!(!report.received.matches(&program));
    assert_eq!(report.received.count() + report.alarms.len() as u64, 10_000);
    assert_eq!(report.largest_level, 512);
}

#[test]
fn without_a_rate_the_line_is_immediate_and_the_loop_still_holds() {
    let program = program(20_000);
    let options = ControlOptions {
        line: LineParameters::new(0),
        rate: 1_000_000,
        ..ControlOptions::default()
    };
    let report = transfer(options, 1, &program);
    assert!(report.received.matches(&program));
    assert_eq!(report.alarms, []);
    assert_eq!(report.characters_after_xoff.max(), 0);
    assert!(report.holds > 100, "{} holds", report.holds);
}
