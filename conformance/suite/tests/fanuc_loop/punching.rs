//! PUNCH: programs from the control, and its requests for others.

use softplug_abi::{Failure, LineErrorKind, Micros, Value, Values};
use softplug_link::Observed;
use softplug_machines::fanuc::{Dc4, Options, Press, PunchOptions};

use crate::common::fanuc::{Bench, Settings, codings, program, text_of};
use crate::fanuc_loop::{EOBS, SECOND, small};

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
