//! The FANUC plug-in and a simulated control on one line: programs in, programs
//! out, stops, resets and the remote buffer.

#[path = "common/fanuc.rs"]
mod fanuc;

use fanuc::{Bench, Settings, codings, program, text_of};
use softplug_abi::{Failure, LineErrorKind, Micros, Value, Values};
use softplug_conformance::partners::fanuc::{
    Dc4, Eob, Interface, Options, Press, PunchOptions, RemoteOptions, TvCheck, eight_none_two,
    seven_even_two,
};
use softplug_link::Observed;

const SECOND: Micros = Micros::from_secs(1);
const EOBS: [(&str, Eob); 5] = [
    ("lf", Eob::Lf),
    ("crlf", Eob::CrLf),
    ("lfcrcr", Eob::LfCrCr),
    ("lfcr", Eob::LfCr),
    ("cr", Eob::Cr),
];

/// A control whose 256 characters fill and drain many times.
fn small(options: Options) -> Options {
    Options {
        buffer: 256,
        reserve: 32,
        resume: 128,
        block_time: Micros::from_millis(60),
        ..options
    }
}

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
            let softplug_conformance::partners::xon_xoff::Received::Bytes(read_text) =
                report.received
            else {
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
    let softplug_conformance::partners::xon_xoff::Received::Bytes(text) = report.received else {
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
    bench.line.line.link.abort(now, job, &mut bench.host).unwrap();
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

#[test]
fn a_punch_in_every_form_is_captured_as_it_was() {
    let program = program(20);
    let inner = program.strip_prefix("%\n").unwrap().strip_suffix("%\n").unwrap();
    let leaders: [&[u8]; 2] = [b"", b"\0\0\0\0\x1B&HE:\0\0"];
    for (settings, control) in codings(9_600) {
        for (_, eob) in EOBS {
            for leader in leaders {
                for dc4 in [Dc4::Prompt, Dc4::Late(40), Dc4::Missing] {
                    let is_eia = settings.first().is_some_and(|(_, value)| *value == "eia");
                    let leader = if is_eia { vec![0; leader.len()] } else { leader.to_vec() };
                    let trailer = 20;
                    let what = format!("{settings:?} {eob:?} {dc4:?} leader {leader:?}");
                    let punch = PunchOptions { eob, leader, dc4, trailer, ..Default::default() };
                    let mut bench = Bench::new(&settings, Options { punch, ..control.clone() });
                    bench.press(Press::Punch(inner.into()));
                    bench.run(Micros::from_secs(60));
                    assert_eq!(bench.report().punches, 1, "{what}");
                    let deliveries = bench.deliveries();
                    assert_eq!(deliveries.len(), 1, "{what}");
                    let delivery = &deliveries[0];
                    assert_eq!(delivery.failure, None, "{what}");
                    assert_eq!(std::str::from_utf8(&delivery.bytes), Ok(&*program), "{what}");
                    assert_eq!(delivery.name.as_deref(), Some("O1234"), "{what}");
                }
            }
        }
    }
}

#[test]
fn a_punch_that_waits_for_dc1_is_answered() {
    let wait_dc1 = Some(Micros::from_secs(3));
    for (mut settings, control) in codings(9_600) {
        settings.push(("answer_dc2", "on"));
        let punch = PunchOptions { wait_dc1, ..PunchOptions::default() };
        let mut bench = Bench::new(&settings, Options { punch, ..control });
        bench.press(Press::Punch(b"O7\nM30\n".to_vec()));
        bench.run(Micros::from_secs(30));
        let deliveries = bench.deliveries();
        assert_eq!(deliveries[0].bytes, b"%\nO7\nM30\n%\n", "{settings:?}");
        assert_eq!(bench.host.sent().len(), 1, "{settings:?}: one DC1");
    }
}

/// What becomes of a punch of 100 blocks that something happens to.
fn spoiled(
    control: Options,
    settings: Settings<'_>,
    spoil: impl FnOnce(&mut Bench),
) -> (Option<Failure>, Vec<u8>) {
    let mut bench = Bench::new(settings, control);
    let program = program(20);
    let inner = program.strip_prefix("%\n").unwrap().strip_suffix("%\n").unwrap();
    bench.press(Press::Punch(inner.into()));
    bench.run(Micros::from_millis(500));
    spoil(&mut bench);
    bench.run(Micros::from_secs(60));
    let mut deliveries = bench.deliveries();
    assert_eq!(deliveries.len(), 1, "{settings:?}");
    let delivery = deliveries.remove(0);
    (delivery.failure, delivery.bytes)
}

#[test]
fn a_broken_punch_is_kept_and_marked_as_failed() {
    let program = program(20);
    for (settings, control) in codings(9_600) {
        for (press, failure) in
            [(Press::Reset, Failure::PartnerReset), (Press::Alarm, Failure::PartnerAlarm)]
        {
            let control = Options { tell_reset: true, ..control.clone() };
            let (why, bytes) = spoiled(control, &settings, |bench| bench.press(press));
            assert_eq!(why, Some(failure), "{settings:?}");
            assert!(program.as_bytes().starts_with(bytes.trim_ascii_end()) && bytes.len() > 100);
        }
        let (why, _) = spoiled(control.clone(), &settings, |bench| bench.press(Press::Reset));
        assert_eq!(why, Some(Failure::NoEndMark), "{settings:?}: DC4 without SYN");
        let (why, _) = spoiled(control, &settings, |bench| bench.press(Press::Off));
        assert_eq!(why, Some(Failure::NoEndMark), "{settings:?}: silence");
    }
}

#[test]
fn damaged_characters_mark_a_capture_as_failed() {
    let program = program(20);
    for (settings, control) in codings(9_600) {
        for kind in [LineErrorKind::Parity, LineErrorKind::Framing] {
            let punch = PunchOptions { damage: vec![(90, kind)], ..PunchOptions::default() };
            let control = Options { punch, ..control.clone() };
            let (why, bytes) = spoiled(control, &settings, |_| {});
            assert_eq!(why, Some(Failure::LineError), "{settings:?} {kind}");
            assert_eq!(std::str::from_utf8(&bytes), Ok(&*program), "{settings:?} {kind}");
        }
    }
}

/// A punch to a host that puts 200 bytes away four times a second.
fn slow_host(settings: Settings<'_>, control: Options, program: &str) -> Bench {
    let mut bench = Bench::new(settings, control);
    bench.host.drain_by_hand = true;
    let inner = program.strip_prefix("%\n").unwrap().strip_suffix("%\n").unwrap();
    bench.press(Press::Punch(inner.into()));
    for _ in 0..4_000 {
        bench.run(Micros::from_millis(250));
        bench.host.drain(200);
        bench.line.settle(&mut bench.host).unwrap();
        if !bench.deliveries().is_empty() {
            break;
        }
    }
    let deliveries = bench.deliveries();
    assert_eq!(deliveries.len(), 1, "{settings:?}: {}", bench.account());
    assert_eq!(deliveries[0].failure, None, "{settings:?}");
    assert_eq!(std::str::from_utf8(&deliveries[0].bytes), Ok(program), "{settings:?}");
    bench
}

#[test]
fn a_slow_host_holds_the_punch_by_dc3_or_rts_and_loses_nothing() {
    let program = program(600);
    for (settings, control) in codings(19_200) {
        for resume in ["dc1", "dc2"] {
            let settings = [settings.as_slice(), &[("resume_code", resume)]].concat();
            let punch = PunchOptions { resume_on_dc2: resume == "dc2", ..PunchOptions::default() };
            let report =
                slow_host(&settings, Options { punch, ..control.clone() }, &program).report();
            assert!(report.punched_after_dc3.0.len() > 3, "{settings:?}");
            assert!(report.punched_after_dc3.max() <= 10, "{settings:?}");
        }
        let settings = [settings.as_slice(), &[("output_flow", "rts")]].concat();
        let control = Options { modem_lines: true, ..control };
        let report = slow_host(&settings, control, &program).report();
        assert!(report.punched_after_cs.0.len() > 3, "{settings:?}");
        assert_eq!(report.punched_after_cs.max(), 2, "{settings:?}");
        assert_eq!(report.punched_after_dc3.0, [0; 0], "{settings:?}");
    }
}

#[test]
fn a_request_from_the_panel_is_answered_with_its_program() {
    let program = program(50);
    for (settings, control) in codings(9_600) {
        let mut bench = Bench::new(&settings, small(control));
        bench.press(Press::Request("1234".into()));
        bench.run(SECOND);
        let asked = bench.host.observed.iter().find_map(|(_, observed)| match observed {
            Observed::Request { request, kind, fields } => Some((*request, *kind, fields.clone())),
            _ => None,
        });
        let (request, kind, fields) = asked.expect("the operator has asked");
        let fields = Values::new(&fields);
        assert_eq!(kind, 0);
        assert_eq!(fields.find(0), Some(Value::Text("1234")));
        assert_eq!(fields.find(1), Some(Value::Int(1_234)));
        let now = bench.line.now();
        bench.line.line.link.answer(now, request, Ok(&[]), &mut bench.host).unwrap();
        let job = bench.send(&program);
        assert!(bench.end_of(job).is_ok(), "{settings:?}");
        let report = bench.report();
        assert!(report.received.matches(text_of(&program).as_bytes()), "{settings:?}");
        assert_eq!((report.alarms.len(), report.before_dc1), (0, 0), "{settings:?}");
        assert_eq!(bench.deliveries().len(), 1, "{settings:?}");
    }
}

fn remote_a(remote: RemoteOptions) -> Options {
    Options {
        interface: Interface::RemoteA,
        line: seven_even_two(19_200),
        buffer: 4_096,
        resume: 2_048,
        block_time: Micros::from_millis(20),
        remote,
        ..Options::default()
    }
}

#[test]
fn protocol_a_carries_a_program_in_packets_whatever_is_damaged() {
    let program = program(600);
    // One at a time: two in a row cannot be told apart by any host.
    let faults = RemoteOptions {
        wrong_sums: vec![0, 8, 15],
        refusals: vec![3, 9],
        ..RemoteOptions::default()
    };
    let eight = Options {
        line: eight_none_two(9_600),
        parity: softplug_conformance::partners::fanuc::Parity::None,
        ..remote_a(faults.clone())
    };
    let cases: [(Settings<'_>, Options); 4] = [
        (&[], remote_a(RemoteOptions::default())),
        (&[], remote_a(faults.clone())),
        (
            &[("packet_end", "etx"), ("packet_size", "100"), ("eob", "crlf")],
            remote_a(RemoteOptions { end_code: 3, ..faults }),
        ),
        (&[("parity", "none"), ("packet_size", "16")], eight),
    ];
    for (settings, control) in cases {
        for is_job_first in [true, false] {
            let settings = [&[("mode", "remote-a")], settings].concat();
            let what = format!("{settings:?} job first: {is_job_first}");
            let retries = control.remote.refusals.len() + control.remote.wrong_sums.len();
            let mut bench = Bench::new(&settings, control.clone());
            let job = if is_job_first {
                let job = bench.send(&program);
                bench.run(Micros::from_secs(2));
                bench.press(Press::Read);
                job
            } else {
                bench.press(Press::Read);
                bench.run(Micros::from_secs(2));
                bench.send(&program)
            };
            let end = bench.end_of(job);
            let report = bench.report();
            assert!(end.is_ok(), "{what}: {end:?} {:#?}", report.remote);
            let account = bench.account();
            let is_same = report.received.matches(text_of(&program).as_bytes());
            assert!(is_same, "{what}: {} characters: {account}", report.received.count());
            assert_eq!(report.remote.faults, [""; 0], "{what}");
            assert_eq!((report.remote.silences, report.alarms.len()), (0, 0), "{what}");
            assert_eq!(report.programs, 1, "{what}");
            let seen = report.remote.retries_asked + report.remote.retries_heard;
            assert_eq!(seen as usize, retries, "{what}");
        }
    }
}

#[test]
fn a_reset_or_an_alarm_of_the_remote_buffer_ends_the_job() {
    for (press, failure) in
        [(Press::Reset, Failure::PartnerReset), (Press::Alarm, Failure::PartnerAlarm)]
    {
        let mut bench = Bench::new(&[("mode", "remote-a")], remote_a(RemoteOptions::default()));
        bench.press(Press::Read);
        bench.run(SECOND);
        let job = bench.send(&program(1_000));
        bench.run(Micros::from_secs(3));
        assert!(bench.report().remote.data > 0);
        bench.press(press);
        let (why, sent) = bench.end_of(job).expect_err("the control was reset");
        assert_eq!(why, failure);
        bench.run(Micros::from_secs(30));
        let report = bench.report();
        assert_eq!((report.remote.acknowledged, report.remote.silences), (1, 0));
        assert_eq!(report.remote.faults, [""; 0]);
        assert!(sent > 1_000);
    }
}

#[test]
fn protocol_b_is_held_for_as_long_as_it_takes() {
    let program = program(600);
    let control = Options {
        interface: Interface::RemoteB,
        line: seven_even_two(19_200),
        buffer: 4_096,
        reserve: 1_024,
        resume: 2_048,
        block_time: Micros::from_secs(60),
        ..Options::default()
    };
    let mut bench = Bench::new(&[("mode", "remote-b")], control);
    let job = bench.send(&program);
    bench.press(Press::Read);
    assert!(bench.end_of(job).is_ok());
    let report = bench.report();
    assert!(report.received.matches(text_of(&program).as_bytes()));
    assert_eq!((report.alarms.len(), report.holds > 5), (0, true), "{report:?}");
    assert!(report.held > Micros::from_secs(20_000), "{}", report.held);
}
