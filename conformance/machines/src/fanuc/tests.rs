//! The control alone, fed with hand-made bytes.

use super::*;

/// A character at 4,800 7E2.
fn at(count: i64) -> Micros {
    seven_even_two(4_800).characters(count as u64)
}

fn control(options: Options) -> Control {
    Control::new(options).expect("the test's options are sound")
}

/// Runs it to `until` at its own event times; what left, and when.
fn run(control: &mut Control, until: Micros) -> Vec<(Micros, u8)> {
    let mut left = Vec::new();
    while let Some(next) = control.next_event().filter(|next| *next <= until) {
        control.advance(next);
        while let Some(byte) = control.poll_transmit(next) {
            left.push((next, byte));
        }
    }
    control.advance(until);
    left
}

fn bytes(left: &[(Micros, u8)]) -> Vec<u8> {
    left.iter().map(|(_, byte)| *byte).collect()
}

/// A reading whose reader is open: DC1 left with the first character's time.
fn reading(options: Options) -> Control {
    let mut control = control(options);
    control.press(Micros::ZERO, Press::Read);
    assert_eq!(run(&mut control, at(1)), [(at(1), DC1)]);
    control
}

/// Characters back to back after `from` further ones; what the control sent.
fn feed(control: &mut Control, from: i64, text: &[u8]) -> Vec<(Micros, u8)> {
    let mut left = Vec::new();
    for (n, byte) in (1..).zip(text) {
        left.extend(run(control, at(from + n)));
        control.receive(at(from + n), *byte);
    }
    left
}

/// 100 characters of buffer that stay: DC3 under 20 free, DC1 from 60 free.
fn slow() -> Options {
    Options {
        buffer: 100,
        reserve: 20,
        resume: 60,
        block_time: Micros::from_secs(10),
        ..Options::default()
    }
}

/// A label and blocks of 10 characters.
fn tape(blocks: usize) -> Vec<u8> {
    [b"%\n".to_vec(), b"G1X12.345\n".repeat(blocks)].concat()
}

fn kinds(control: &Control) -> Vec<(AlarmKind, u64)> {
    control.report().alarms.iter().map(|alarm| (alarm.kind, alarm.position)).collect()
}

#[test]
fn dc3_goes_out_when_the_buffer_is_nearly_full_and_dc1_when_it_has_drained() {
    let mut control = reading(slow());
    // The first block leaves the buffer when it is complete; the 81st character
    // after it leaves 19 free.
    let sent = feed(&mut control, 1, &tape(9)[..2 + 90]);
    assert_eq!(sent, []);
    control.receive(at(94), b'G');
    assert_eq!(run(&mut control, at(95)), [(at(95), 0x13)]);
    assert_eq!(control.report().largest_level, 81);
    // A block every 10 s: with the fifth 41 remain, so that 59 are free.
    let first = at(1 + 2 + 10);
    let sent = run(&mut control, first + Micros::from_secs(200));
    assert_eq!(sent, [(first + Micros::from_secs(50) + at(1), 0x11)]);
    let report = control.report();
    assert_eq!((report.holds, report.dc3s, report.dc1s), (1, 1, 2));
    assert_eq!(report.held, sent[0].0 - at(95));
    assert_eq!(report.characters_after_dc3.0, [0]);
    assert_eq!((report.starved, report.blocks), (0, 9), "storing does not starve");
}

#[test]
fn the_eleventh_character_after_dc3_is_alarm_087() {
    let mut control = reading(Options { buffer: 200, reserve: 120, resume: 160, ..slow() });
    feed(&mut control, 1, &tape(30)[..2 + 90]);
    control.receive(at(94), b'G');
    // DC3 has left with the 95th: it ended together with it and was in time.
    feed(&mut control, 94, b"1X12.345\nG1");
    assert_eq!(kinds(&control), []);
    control.receive(at(106), b'X');
    assert_eq!(kinds(&control), [(AlarmKind::BufferOverflow, 105)]);
    let report = control.report();
    assert_eq!(report.alarms[0].kind.number(), 87);
    assert_eq!(report.characters_after_dc3.0, [11]);
    // It closes the reader; what still comes means nothing.
    let sent = feed(&mut control, 106, b"12.345");
    assert_eq!(bytes(&sent), [0x13]);
    assert_eq!(control.report().ignored, 7);
}

#[test]
fn a_remote_buffer_is_patient_until_it_is_full() {
    let interface = Interface::RemoteB;
    let mut control = reading(Options { interface, ..slow() });
    feed(&mut control, 1, &tape(11)[..2 + 110]);
    assert_eq!(kinds(&control), []);
    assert_eq!(control.report().characters_after_dc3.0, [18]);
    control.receive(at(114), b'G');
    assert_eq!(kinds(&control), [(AlarmKind::BufferOverflow, 113)]);
}

#[test]
fn characters_before_dc1_has_left_are_lost() {
    let mut control = control(Options::default());
    control.receive(Micros(10), b'%');
    control.press(Micros(100), Press::Read);
    control.receive(Micros(200), b'%');
    run(&mut control, at(2));
    feed(&mut control, 2, b"%\nO1\n%");
    let report = control.report();
    assert_eq!((report.ignored, report.before_dc1, report.arrived), (1, 1, 6));
    assert!(report.received.matches(b"O1\n%"));
}

#[test]
fn the_final_dc3_comes_after_its_delay_and_once() {
    let delay = Micros::from_millis(30);
    let mut control = reading(Options { final_dc3: Some(delay), ..Options::default() });
    feed(&mut control, 1, b"%\nO1\n%\n\0\0");
    let end = at(1 + 6) + delay;
    assert_eq!(run(&mut control, Micros::from_secs(9)), [(end + at(1), 0x13)]);
    let report = control.report();
    assert_eq!((report.programs, report.holds, report.dc3s, report.ignored), (1, 0, 1, 3));
    let mut silent = reading(Options { final_dc3: None, ..Options::default() });
    feed(&mut silent, 1, b"%\nO1\n%");
    assert_eq!(run(&mut silent, Micros::from_secs(9)), []);
    assert!(silent.is_idle());
}

#[test]
fn dc1_is_repeated_while_nothing_comes() {
    let repeat_dc1 = Some(Micros::from_secs(5));
    let mut control = reading(Options { repeat_dc1, codes_twice: true, ..Options::default() });
    let sent = run(&mut control, Micros::from_secs(12));
    // The second of the first pair, then every 5 s.
    assert_eq!(bytes(&sent), [DC1, DC1, DC1]);
    assert_eq!(sent[1].0, at(2) + Micros::from_secs(5) + at(1));
    control.receive(Micros::from_secs(13), b'%');
    let sent = run(&mut control, Micros::from_secs(19));
    assert_eq!(sent, [(Micros::from_secs(18) + at(1), DC1)]);
}

#[test]
fn reset_and_alarm_close_the_reader_and_say_so() {
    let line = eight_none_two(4_800);
    for (press, code) in [(Press::Reset, 0x96), (Press::Alarm, 0x95)] {
        let tell_reset = true;
        let mut control = reading(Options { line, tell_reset, ..Options::default() });
        feed(&mut control, 1, b"%\nO1\nG");
        control.press(at(9), press);
        assert_eq!(bytes(&run(&mut control, at(20))), [0x93, code]);
        assert_eq!(control.report().programs, 0);
    }
    let codes_with_parity = false;
    let mut plain = reading(Options { line, codes_with_parity, ..Options::default() });
    plain.press(at(9), Press::Reset);
    assert_eq!(bytes(&run(&mut plain, at(20))), [0x13]);
}

#[test]
fn each_alarm_has_its_cause() {
    let tv = Some(TvCheck { returns: true, comments: true });
    let cases: [(&[u8], AlarmKind, u64); 3] = [
        (b"%\nO12\ng", AlarmKind::Th, 7),
        (b"%\nO12\nG1\n", AlarmKind::Tv, 9),
        (b"%\nO12\nG100\n", AlarmKind::Tv, 11),
    ];
    for (text, kind, position) in cases {
        let mut control = reading(Options { tv, ..Options::default() });
        feed(&mut control, 1, text);
        assert_eq!(kinds(&control), [(kind, position)], "{}", text.escape_ascii());
    }
    let mut control = reading(Options::default());
    feed(&mut control, 1, b"%\nO1");
    control.receive_damaged(at(6));
    assert_eq!(kinds(&control), [(AlarmKind::LineError, 5)]);
    // An overrun: the software comes after 3 characters, the FIFO holds one.
    let latency = at(3);
    let mut late = reading(Options { latency, receive_fifo: 1, ..Options::default() });
    feed(&mut late, 1, b"%\nO");
    assert_eq!(kinds(&late)[0], (AlarmKind::LineError, 2));
    // DTR dropped.
    let mut control = reading(Options { modem_lines: true, ..Options::default() });
    let outputs = ModemLines::OUTPUTS;
    Partner::modem_lines(&mut control, at(2), outputs, ModemLines::RTS);
    assert_eq!(kinds(&control), [(AlarmKind::NotReady, 0)]);
    let numbers = [AlarmKind::Th, AlarmKind::Tv, AlarmKind::LineError, AlarmKind::NotReady];
    assert_eq!(numbers.map(AlarmKind::number), [1, 2, 85, 86]);
}

#[test]
fn execution_starves_when_the_host_may_send_and_does_not() {
    let drip = |feed_holds| Feeding::Drip { cycle_start: 20, feed_holds };
    let block_time = Micros::from_millis(100);
    let hold = FeedHold { after: 2, span: Micros::from_secs(7_200) };
    let options = Options { block_time, feeding: drip(vec![hold]), ..Options::default() };
    let mut control = reading(options);
    feed(&mut control, 1, &tape(3));
    // Started with 20 characters, two blocks, then two hours, then the third.
    let start = at(1 + 2 + 20);
    let hours = start + Micros::from_millis(200) + hold.span;
    run(&mut control, hours + Micros::from_millis(99));
    assert_eq!((control.report().blocks, control.report().starved), (2, 0));
    let end = hours + Micros::from_millis(100);
    run(&mut control, end + Micros::from_millis(500));
    let report = control.report();
    let span = Micros::from_millis(500);
    assert_eq!((report.blocks, report.starved, report.starved_for), (3, 1, span));
    assert_eq!(report.starvations, [Starvation { at: end, block: 3, span }]);
    // A block ends it, and the closing percent lets it rest.
    let later = end + Micros::from_secs(1);
    for byte in b"X1\n%" {
        control.receive(later, *byte);
    }
    run(&mut control, later + Micros::from_secs(9));
    let report = control.report();
    let span = Micros::from_secs(1);
    assert_eq!((report.blocks, report.starved, report.starved_for), (4, 1, span));
}

#[test]
fn time_in_which_the_host_was_held_does_not_count_as_starved() {
    // The buffer is held with one long block that takes 10 s; nothing else fits.
    let feeding = Feeding::Drip { cycle_start: 0, feed_holds: Vec::new() };
    let mut control = reading(Options { feeding, resume: 100, ..slow() });
    let long = [b"%\n".to_vec(), vec![b'1'; 81]].concat();
    feed(&mut control, 1, &long);
    let sent = run(&mut control, at(90));
    // What is there is executed as if it were a block.
    assert_eq!(bytes(&sent), [0x13, DC1]);
    assert_eq!(control.report().starved, 0);
}

#[test]
fn a_punch_is_leader_program_trailer_between_dc2_and_dc4() {
    let punch = PunchOptions {
        leader: b"\0\x1B&HE:".to_vec(),
        eob: Eob::LfCrCr,
        trailer: 2,
        dc4: Dc4::Late(1),
        ..PunchOptions::default()
    };
    let mut iso = control(Options { punch: punch.clone(), ..Options::default() });
    iso.press(Micros::ZERO, Press::Punch(b"O1\nM30\n".to_vec()));
    let expected = b"\x12\0\x1B&HE:%\n\r\rO1\n\r\rM30\n\r\r%\n\r\r\0\0\0\x14";
    let left = run(&mut iso, Micros::from_secs(1));
    assert_eq!(bytes(&left), expected);
    assert_eq!(left.last().map(|(time, _)| *time), Some(at(expected.len() as i64)));
    assert_eq!((iso.report().punches, iso.report().punched), (1, expected.len() as u64));

    let line = eight_none_two(4_800);
    let parity = Parity::Software;
    let mut software = control(Options { line, parity, punch, ..Options::default() });
    software.press(Micros::ZERO, Press::Punch(b"O1\n".to_vec()));
    let expected = b"\x12\0\x1B\xA6H\xC5:\xA5\n\x8D\x8D\xCF\xB1\n\x8D\x8D\xA5\n\x8D\x8D\0\0\0\x14";
    assert_eq!(bytes(&run(&mut software, Micros::from_secs(1))), expected);

    let missing = PunchOptions { dc4: Dc4::Missing, dc2: false, ..PunchOptions::default() };
    let code = Code::Eia;
    let mut eia = control(Options { line, code, punch: missing, ..Options::default() });
    eia.press(Micros::ZERO, Press::Punch(b"O36\n".to_vec()));
    let left = run(&mut eia, Micros::from_secs(1));
    assert_eq!(bytes(&left), [0x0B, 0x80, 0x46, 0x13, 0x16, 0x80, 0x0B, 0x80]);
    assert_eq!(eia.report().punches, 1);
}

#[test]
fn dc2_is_repeated_until_the_host_says_dc1() {
    let wait_dc1 = Some(Micros::from_secs(3));
    let punch = PunchOptions { wait_dc1, ..PunchOptions::default() };
    let mut control = control(Options { punch, ..Options::default() });
    control.press(Micros::ZERO, Press::Punch(b"O1\n".to_vec()));
    assert_eq!(bytes(&run(&mut control, Micros::from_secs(7))), [DC2; 3]);
    control.receive(Micros::from_secs(7), DC1);
    assert_eq!(bytes(&run(&mut control, Micros::from_secs(8))), b"%\nO1\n%\n\x14");
}

#[test]
fn a_punch_obeys_dc3_and_cs_within_its_limits() {
    let mut control = control(Options { modem_lines: true, ..Options::default() });
    control.press(Micros::ZERO, Press::Punch(vec![b'A'; 100]));
    run(&mut control, at(10));
    control.receive(at(10) + Micros(1), DC3);
    assert_eq!(run(&mut control, Micros::from_secs(1)).len(), 10);
    control.receive(Micros::from_secs(1), 0x93);
    assert_eq!(run(&mut control, Micros::from_secs(2)), []);
    control.receive(Micros::from_secs(2), DC1);
    let from = Micros::from_secs(2);
    run(&mut control, from + at(5));
    let (rts, off) = (ModemLines::RTS, ModemLines::default());
    Partner::modem_lines(&mut control, from + at(5) + Micros(1), rts, off);
    assert_eq!(run(&mut control, Micros::from_secs(3)).len(), 2);
    Partner::modem_lines(&mut control, Micros::from_secs(3), rts, rts);
    run(&mut control, Micros::from_secs(5));
    let report = control.report();
    assert_eq!((report.punched_after_dc3.0, report.punched_after_cs.0), (vec![10], vec![2]));
    assert_eq!((report.punches, report.punched), (1, 2 + 100 + 2 + 2));
}

#[test]
fn a_broken_punch_ends_with_dc4_and_its_reason() {
    let mut control = control(Options { tell_reset: true, ..Options::default() });
    control.press(Micros::ZERO, Press::Punch(vec![b'A'; 100]));
    run(&mut control, at(5));
    control.press(at(5) + Micros(1), Press::Reset);
    let left = run(&mut control, Micros::from_secs(1));
    assert_eq!(bytes(&left), [b'A', 0x14, 0x16]);
    assert_eq!(left[2].0, at(7) + Micros::from_millis(50) + at(1));
}

#[test]
fn characters_are_damaged_on_the_way_as_ordered() {
    let damage = vec![(2, LineErrorKind::Parity), (3, LineErrorKind::Break)];
    let punch = PunchOptions { damage, ..PunchOptions::default() };
    let signals = |options: Options| {
        let mut control = control(options);
        control.press(Micros::ZERO, Press::Punch(b"O1\n".to_vec()));
        let until = Micros::from_secs(1);
        std::iter::from_fn(|| control.poll_signal(until)).skip(3).take(3).collect::<Vec<_>>()
    };
    let kind = LineErrorKind::Parity;
    let uart = signals(Options { punch: punch.clone(), ..Options::default() });
    let broken = Signal::LineError { kind: LineErrorKind::Break, byte: None };
    let parity = Signal::LineError { kind, byte: Some(b'O') };
    assert_eq!(uart, [parity, broken, Signal::Character(b'\n')]);
    let line = eight_none_two(4_800);
    let software = Options { line, parity: Parity::Software, punch, ..Options::default() };
    assert_eq!(signals(software), [Signal::Character(0x4F), broken, Signal::Character(b'\n')]);
}

#[test]
fn a_request_is_punched_and_then_the_program_is_read() {
    let mut control = control(Options::default());
    control.press(Micros::ZERO, Press::Request("1234".into()));
    let left = bytes(&run(&mut control, Micros::from_secs(1)));
    assert_eq!(left, b"\x12%\nO9999\n(SEND 1234)\n%\n\x14\x11");
}

#[test]
fn the_panel_works_by_itself() {
    let panel = vec![(Micros(5), Press::Read), (Micros(50_000), Press::Off), (at(40), Press::On)];
    let mut control = control(Options { panel, modem_lines: true, ..Options::default() });
    let until = Micros::from_secs(1);
    let signals: Vec<_> = std::iter::from_fn(|| control.poll_signal(until)).collect();
    let lines = ModemLines::DSR.union(ModemLines::DCD);
    let ready = |on| Signal::ModemLines { lines, on };
    let none = ModemLines::default();
    assert_eq!(signals, [ready(lines), Signal::Character(DC1), ready(none), ready(lines)]);
}

#[test]
fn who_wants_to_read_waits_until_a_punch_is_over_and_reset_does_not() {
    let punch = |reset: Option<Micros>| {
        let mut panel = vec![
            (Micros::ZERO, Press::Punch(vec![b'A'; 100])),
            (at(10), Press::Request("1234".into())),
        ];
        panel.extend(reset.map(|reset| (reset, Press::Reset)));
        let mut control = control(Options { panel, ..Options::default() });
        bytes(&run(&mut control, Micros::from_secs(1)))
    };
    let request = b"\x12%\nO9999\n(SEND 1234)\n%\n\x14\x11";
    let whole = punch(None);
    assert!(whole.ends_with(&[b"AA%\n\x14", request.as_slice()].concat()));
    let broken = punch(Some(at(20)));
    assert!(broken.ends_with(request) && broken.len() < whole.len() - 70);
}
