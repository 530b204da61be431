//! READ: programs to the control.

use softplug_abi::{Failure, JobId, Micros};
use softplug_machines::fanuc::{Eob, Options, Press, TvCheck, seven_even_two};

use crate::common::fanuc::{Bench, Settings, codings, program, text_of};
use crate::fanuc_loop::{EOBS, SECOND, small};

/// Sends it to a control that waits for it; all must be well.
fn assert_reads(settings: Settings<'_>, control: Options, depth: usize, program: &str) {
    let what = format!("{settings:?} depth {depth}");
    let mut bench = Bench::with_depth(settings, control, depth);
    let job = bench.send(program);
    bench.run(SECOND);
    assert_eq!(bench.host.sent(), [0; 0], "{what}: before DC1");
    bench.press(Press::Read);
    let sent = bench.end_of(job).unwrap_or_else(|end| panic!("{what}: {end:?}"));
    bench.run(SECOND);
    assert_eq!(sent, bench.host.sent().len() as u64, "{what}");
    let report = bench.report();
    assert_eq!(report.alarms, [], "{what}");
    let text = text_of(program);
    assert!(report.received.matches(text.as_bytes()), "{what}: {:?}", report.received);
    assert_eq!((report.programs, report.before_dc1), (1, 0), "{what}");
    assert!(report.characters_after_dc3.max() <= depth as u32, "{what}");
    assert!(report.holds >= 10, "{what}: only {} holds", report.holds);
}

#[test]
fn a_program_arrives_in_every_coding_and_with_every_end_of_block() {
    let program = program(100);
    for (settings, control) in codings(19_200) {
        for (name, eob) in EOBS {
            let settings = [settings.as_slice(), &[("eob", name)]].concat();
            let control = Options { cr_ends_block: eob == Eob::Cr, ..small(control.clone()) };
            for depth in [1, 4] {
                assert_reads(&settings, control.clone(), depth, &program);
            }
        }
    }
}

#[test]
fn codes_without_parity_repeated_ones_and_a_repeated_dc1_change_nothing() {
    let program = program(100);
    for (mut settings, control) in codings(9_600) {
        settings.push(("plain_codes", "on"));
        let control = Options {
            codes_with_parity: false,
            codes_twice: true,
            repeat_dc1: Some(Micros::from_millis(300)),
            ..small(control)
        };
        assert_reads(&settings, control, 1, &program);
    }
}

#[test]
fn blocks_are_padded_for_the_tv_check() {
    let program = program(60);
    for (name, eob) in EOBS {
        for (returns, comments) in [(true, true), (true, false), (false, true), (false, false)] {
            let on = |is_on| if is_on { "on" } else { "off" };
            let settings = [
                ("eob", name),
                ("tv_cr", on(returns)),
                ("tv_comments", on(comments)),
                ("tv_pad", "on"),
            ];
            let tv = Some(TvCheck { returns, comments });
            let control = small(Options {
                tv,
                cr_ends_block: eob == Eob::Cr,
                line: seven_even_two(9_600),
                ..Options::default()
            });
            let read = |settings| {
                let mut bench = Bench::new(settings, control.clone());
                let job = bench.send(&program);
                bench.press(Press::Read);
                (bench.end_of(job), bench.report())
            };
            let what = format!("{settings:?}");
            let (end, report) = read(&settings);
            assert!(end.is_ok(), "{what}: {end:?}");
            assert_eq!(report.alarms, [], "{what}");
            let softplug_machines::kept::Received::Bytes(read_text) = report.received else {
                panic!("all bytes are kept")
            };
            let read_text = String::from_utf8(read_text).unwrap();
            let blocks =
                read_text.split('\n').map(|block| block.strip_suffix(' ').unwrap_or(block));
            assert_eq!(blocks.collect::<Vec<_>>().join("\n"), text_of(&program), "{what}");
        }
    }
    // Without padding the control does complain.
    let tv = Some(TvCheck { returns: true, comments: true });
    let mut bench = Bench::new(&[], small(Options { tv, ..Options::default() }));
    bench.send(&program);
    bench.press(Press::Read);
    bench.run(SECOND);
    let numbers: Vec<_> = bench.report().alarms.iter().map(|alarm| alarm.kind.number()).collect();
    assert_eq!(numbers, [2]);
}

#[test]
fn a_program_with_characters_outside_the_code_is_refused_or_mended() {
    let program = "%\nO1(half \u{fc}ber_all; 50%)\nM30\n%\n";
    let mut bench = Bench::new(&[], Options::default());
    let job = bench.send(program);
    bench.press(Press::Read);
    assert_eq!(bench.end_of(job), Err((Failure::UnsupportedCharacter, 0)));
    assert_eq!(bench.host.sent(), [0; 0]);
    let settings = [("unsupported", "space"), ("upper", "on")];
    let mut bench = Bench::new(&settings, Options::default());
    let job = bench.send(program);
    bench.press(Press::Read);
    assert!(bench.end_of(job).is_ok());
    let report = bench.report();
    assert_eq!(report.alarms, []);
    assert!(report.received.matches(b"O1(HALF   BER ALL  50 )\nM30\n%"), "{report:?}");
}

#[test]
fn leader_and_trailer_mean_nothing_to_the_control() {
    for (settings, control) in codings(9_600) {
        let settings = [settings.as_slice(), &[("leader", "60"), ("trailer", "60")]].concat();
        assert_reads(&settings, small(control), 1, &program(100));
    }
}

#[test]
fn a_dc1_that_came_before_the_job_counts() {
    let mut bench = Bench::new(&[], Options::default());
    bench.press(Press::Read);
    bench.run(SECOND);
    let program = program(3);
    let job = bench.send(&program);
    assert!(bench.end_of(job).is_ok());
    assert!(bench.report().received.matches(text_of(&program).as_bytes()));
}

#[test]
fn the_final_dc3_ends_the_job_and_its_trailer() {
    let final_dc3 = Some(Micros::from_millis(400));
    let control = Options { final_dc3, ..Options::default() };
    let mut bench = Bench::new(&[("end_wait", "5000"), ("trailer", "50")], control);
    let job = bench.send(&program(3));
    bench.press(Press::Read);
    assert!(bench.end_of(job).is_ok());
    let report = bench.report();
    assert_eq!((report.programs, report.dc3s, report.ignored), (1, 1, 50));

    // In the middle of the trailer: its rest is not sent.
    let control = Options { final_dc3: Some(Micros::ZERO), ..Options::default() };
    let mut bench = Bench::new(&[("end_wait", "5000"), ("trailer", "50")], control);
    let job = bench.send(&program(3));
    bench.press(Press::Read);
    assert!(bench.end_of(job).is_ok());
    bench.run(SECOND);
    let ignored = bench.report().ignored;
    assert!(ignored <= 3, "{ignored} after the closing %");
}

#[test]
fn resets_and_alarms_in_mid_transfer_end_the_job_and_leave_nothing_behind() {
    let program = program(100);
    for (settings, control) in codings(9_600) {
        for (press, failure) in
            [(Press::Reset, Failure::PartnerReset), (Press::Alarm, Failure::PartnerAlarm)]
        {
            let control = Options { tell_reset: true, ..small(control.clone()) };
            let mut bench = Bench::new(&settings, control);
            let job = bench.send(&program);
            bench.press(Press::Read);
            bench.run_to(700);
            bench.press(press);
            let sent = bench.host.sent().len() as u64;
            let (why, exact) = bench.end_of(job).expect_err("the control was reset");
            assert_eq!(why, failure, "{settings:?}");
            bench.run(SECOND);
            assert_eq!(exact, bench.host.sent().len() as u64, "{settings:?}");
            // DC3 stops it, and what follows is only what was on the wire.
            assert!(exact <= sent + 3, "{} after the reset", exact - sent);
            assert_next_job_is_whole(&mut bench);
        }
    }
}

/// Nothing stale reaches the next job.
fn assert_next_job_is_whole(bench: &mut Bench) {
    let before = bench.report();
    let next = program(5);
    let job = bench.send(&next);
    bench.run(SECOND);
    bench.press(Press::Read);
    assert!(bench.end_of(job).is_ok());
    let report = bench.report();
    let softplug_machines::kept::Received::Bytes(text) = report.received else {
        panic!("all bytes are kept")
    };
    let start = before.received.count() as usize;
    assert_eq!(std::str::from_utf8(&text[start..]), Ok(text_of(&next)));
    assert_eq!(report.before_dc1, before.before_dc1);
}

#[test]
fn an_aborted_job_leaves_nothing_behind() {
    let control = Options { line: seven_even_two(9_600), ..Options::default() };
    let mut bench = Bench::new(&[], small(control));
    let job = bench.send(&program(100));
    bench.press(Press::Read);
    bench.run_to(700);
    let now = bench.line.now();
    bench.line.line.link.abort(now, JobId(job), &mut bench.host).unwrap();
    bench.line.settle(&mut bench.host).unwrap();
    let (why, sent) = bench.end_of(job).expect_err("it was aborted");
    assert_eq!(why, Failure::Aborted);
    bench.run(SECOND);
    assert!(bench.host.sent().len() as u64 - sent <= 1);
    bench.press(Press::Reset);
    bench.run(SECOND);
    assert_next_job_is_whole(&mut bench);
}

#[test]
fn a_control_that_is_switched_off_is_gone() {
    let control = Options { modem_lines: true, ..Options::default() };
    let mut bench = Bench::new(&[("watch_dsr", "on")], small(control));
    let job = bench.send(&program(100));
    bench.press(Press::Read);
    bench.run_to(700);
    bench.press(Press::Off);
    let (why, _) = bench.end_of(job).expect_err("the control is off");
    assert_eq!(why, Failure::PartnerGone);
}
