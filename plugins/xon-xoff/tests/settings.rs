//! Settings that cannot work, the check pass, and how jobs end.

use softplug_plugin::bench::{Bench, BenchError, Observed};
use softplug_plugin::{Failure, JobId, Micros};
use xon_xoff::XonXoff;

/// Why the converter does not open with these settings.
fn refusal(settings: &[(&str, &str)]) -> Option<String> {
    Some(opened(settings).err()?.to_string())
}

fn opened(settings: &[(&str, &str)]) -> Result<Bench<XonXoff>, BenchError> {
    Bench::<XonXoff>::new().set_all(settings).try_open()
}

#[test]
fn settings_that_cannot_work_are_refused_in_words() {
    let refused = [
        (
            vec![("xoff", "17")],
            "xon and xoff are the same byte under parity_mask; change one of them",
        ),
        (
            vec![("xoff", "0x91"), ("parity_mask", "127")],
            "xon and xoff are the same byte under parity_mask; change one of them",
        ),
        (
            vec![("transparent", "on"), ("escape", "0x13")],
            "escape is a control byte; choose another",
        ),
        (
            vec![("transparent", "on"), ("escape_xor", "2")],
            "escape_xor turns a control byte into another; choose another",
        ),
        (
            vec![("transparent", "on"), ("escape_xor", "1")],
            "escape_xor turns a control byte into another; choose another",
        ),
    ];
    for (settings, text) in refused {
        let said = refusal(&settings).unwrap_or_else(|| panic!("{settings:?} was taken"));
        assert!(said.contains(text), "{settings:?}: {said}");
    }
    let taken = [
        vec![("xoff", "0x91")],
        vec![("escape", "0x13")],
        vec![("escape_xor", "2")],
        vec![("transparent", "on")],
        vec![("transparent", "on"), ("escape_xor", "0xff")],
        vec![("preset", "tape")],
        vec![("preset", "parity"), ("preset", "memory")],
    ];
    for settings in taken {
        assert_eq!(refusal(&settings), None, "{settings:?}");
    }
}

/// The results of checks, then what was sent.
fn checked(program: &[u8], settings: &[(&str, &str)]) -> (Vec<Observed>, Vec<u8>) {
    let mut bench = opened(settings).expect("settings that can work");
    bench.send(program);
    bench.run_for_millis(10_000);
    let results = bench.observed().iter().map(|(_, seen)| seen.clone());
    (results.filter(|seen| matches!(seen, Observed::Checked { .. })).collect(), bench.sent())
}

#[test]
fn the_check_finds_the_place_before_anything_is_sent() {
    let result = |failure, line, column| {
        vec![Observed::Checked { job: JobId(1), failure, status: 0, line, column }]
    };
    let bad = Some(Failure::UnsupportedCharacter);
    let places: [(&[u8], u32, u32); 5] = [
        (b"\x13", 1, 1),
        (b"G1 X1\x11", 1, 6),
        (b"%\nG1\nG2\x13G3\n\x11", 3, 3),
        (b"%\r\nG1\r\n\x13", 3, 1),
        (b"\n\n\n\x11", 4, 1),
    ];
    for (program, line, column) in places {
        assert_eq!(checked(program, &[]), (result(bad, line, column), vec![]), "{program:?}");
    }
    // Over any number of pieces of data.
    let long = [b"N1 G1 X100 Y200\n".repeat(700), b"N2 \x13".to_vec()].concat();
    assert_eq!(checked(&long, &[]), (result(bad, 701, 4), vec![]));

    let good = |sent: &[u8]| (result(None, 0, 0), sent.to_vec());
    assert_eq!(checked(b"G1\nG2\n", &[]), good(b"G1\nG2\n"));
    assert_eq!(checked(b"", &[]), good(b""));
    let program = b"A\x11B\x93C";
    assert_eq!(checked(program, &[("control_in_data", "drop")]), good(b"AB\x93C"));
    assert_eq!(checked(program, &[("control_in_data", "send")]), good(program));
    assert_eq!(checked(program, &[("send_drop", "11")]), good(b"AB\x93C"));
    assert_eq!(checked(program, &[("transparent", "on")]), good(b"A\x10\x51B\x10\xD3C"));
    let parity = [("parity_mask", "127"), ("send_drop", "11")];
    assert_eq!(checked(program, &parity), (result(bad, 1, 4), vec![]));
}

#[test]
fn line_ends_are_read_alike_and_written_as_set() {
    let ends: [&[u8]; 5] = [b"\n", b"\r\n", b"\r", b"\n\r", b"\n\r\r"];
    let forms: [(&str, &[u8]); 4] =
        [("lf", b"\n"), ("cr", b"\r"), ("crlf", b"\r\n"), ("lfcrcr", b"\n\r\r")];
    for end in ends {
        let program = [b"%", end, b"G1", end, end, b"M30", end].concat();
        for (form, wanted) in forms {
            let expected = [b"%", wanted, b"G1", wanted, wanted, b"M30", wanted].concat();
            for transparent in ["off", "on"] {
                let settings = [("send_line_end", form), ("transparent", transparent)];
                let (_, sent) = checked(&program, &settings);
                assert_eq!(sent.escape_ascii().to_string(), expected.escape_ascii().to_string());
            }
        }
    }
}

#[test]
fn what_grows_most_fits_into_a_small_room() {
    // Each byte of a line end is a control byte, and is sent as two.
    let settings = [("xon", "10"), ("xoff", "13"), ("transparent", "on")];
    let grown: [(&str, &[u8]); 4] = [
        ("lf", b"\x10\x4A"),
        ("cr", b"\x10\x4D"),
        ("crlf", b"\x10\x4D\x10\x4A"),
        ("lfcrcr", b"\x10\x4A\x10\x4D\x10\x4D"),
    ];
    for (form, bytes) in grown {
        let options = Bench::<XonXoff>::new().set("send_line_end", form).set_all(&settings);
        let mut bench = options.room(60, 64).open();
        bench.send(&[b'\n'; 200]);
        bench.run_for_millis(3_000);
        assert_eq!(bench.sent(), bytes.repeat(200), "{form}");
    }
}

#[test]
fn an_abort_leaves_nothing_stale() {
    let mut bench = Bench::<XonXoff>::new().set("abort_send", "18").open();
    bench.send(b"ABCDEFGH");
    bench.receive(b"\x13");
    bench.run_for_millis(10);
    bench.host(|link, now, host| link.abort(now, JobId(1), host));
    bench.send(b"xyz");
    bench.run_for_millis(10);
    let sent = bench.sent();
    assert!(sent.len() <= 2 && b"ABCDEFGH".starts_with(&sent), "{sent:?}");
    bench.receive(b"\x11");
    bench.run_for_millis(50);
    assert_eq!(bench.sent(), [&sent[..], b"\x18xyz"].concat());
    let ends: Vec<_> = bench
        .observed()
        .iter()
        .filter(|(_, seen)| matches!(seen, Observed::Done { .. } | Observed::Failed { .. }))
        .map(|(_, seen)| seen.clone())
        .collect();
    let count = sent.len() as u64;
    let failed =
        Observed::Failed { job: JobId(1), failure: Failure::Aborted, status: 0, sent: count };
    assert_eq!(ends, [failed, Observed::Done { job: JobId(2), sent: 3 }]);
}

#[test]
fn a_hold_that_is_too_long_fails_the_job() {
    let mut bench = Bench::<XonXoff>::new().set("held_timeout", "500").open();
    bench.send(&[b'x'; 40]);
    bench.run_for_millis(10);
    bench.receive(b"\x13");
    bench.run_for_millis(499);
    bench.receive(b"\x13");
    assert_eq!(
        bench.link().job(),
        Some(JobId(1)),
        "a repeated XOFF does not begin anew, nor end it"
    );
    bench.run_for_millis(1);
    let sent = bench.sent().len() as u64;
    let failure = Failure::HeldTooLong;
    let failed = Observed::Failed { job: JobId(1), failure, status: 0, sent };
    assert!(bench.observed().contains(&(Micros::from_millis(510), failed)));
}
