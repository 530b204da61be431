//! Transfers in both directions on a bench, with a partner whose frames are made by hand.

use heidenhain_fe::HeidenhainFe;
use softplug_plugin::bench::{Bench, BenchOptions, Observed, Taken};
use softplug_plugin::{Failure, JobId, Micros, RequestId, Value, ValueWriter};

const ACK: u8 = 0x06;
const NAK: u8 = 0x15;
const EOT: u8 = 0x04;
const SILENCE: &[u8] = &[];

/// A header or block as the manual draws it.
fn frame(begin: u8, text: &str) -> Vec<u8> {
    let mut bytes = vec![begin];
    bytes.extend(text.bytes());
    bytes.push(0x17);
    let check = bytes.iter().fold(0, |check, byte| check ^ byte);
    bytes.extend([check & 0x7F, 0x11]);
    bytes
}

fn header(text: &str) -> Vec<u8> {
    frame(0x01, text)
}

fn block(text: &str) -> Vec<u8> {
    frame(0x02, text)
}

fn bench() -> BenchOptions<HeidenhainFe> {
    Bench::new()
}

/// What the bench sent since it was last looked at.
struct Ear(usize);

impl Ear {
    fn new() -> Self {
        Self(0)
    }

    fn heard(&mut self, bench: &Bench<HeidenhainFe>) -> Vec<u8> {
        let sent = bench.sent();
        let new = sent[self.0..].to_vec();
        self.0 = sent.len();
        new
    }

    /// The bytes come, and half a second goes by.
    fn after(&mut self, bench: &mut Bench<HeidenhainFe>, bytes: &[u8]) -> Vec<u8> {
        bench.receive(bytes);
        bench.run_for_millis(500);
        self.heard(bench)
    }
}

/// How a job ended, and the bytes that left for it.
fn job_end(bench: &Bench<HeidenhainFe>) -> Option<(Option<Failure>, u64)> {
    bench.observed().iter().rev().find_map(|(_, observed)| match observed {
        Observed::Done { sent, .. } => Some((None, *sent)),
        Observed::Failed { failure, sent, .. } => Some((Some(*failure), *sent)),
        _ => None,
    })
}

/// What the host was asked for last: name and kind.
fn asked(bench: &Bench<HeidenhainFe>) -> Option<(RequestId, String)> {
    bench.observed().iter().rev().find_map(|(_, observed)| match observed {
        Observed::Request { request, fields, .. } => {
            let texts: Vec<_> = softplug_plugin::Values::new(fields)
                .map(|field| match field {
                    Ok((_, Value::Text(text))) => text.to_owned(),
                    _ => "?".to_owned(),
                })
                .collect();
            Some((*request, texts.join("/")))
        }
        _ => None,
    })
}

#[test]
fn the_control_sends_a_program() {
    for swaps in [false, true] {
        let mut bench = bench().open();
        let mut ear = Ear::new();
        let swap = |bench: &mut Bench<HeidenhainFe>| {
            if swaps {
                bench.swap();
            }
        };
        assert_eq!(ear.after(&mut bench, &header("H15A")), [ACK]);
        swap(&mut bench);
        assert_eq!(ear.after(&mut bench, &block("0 BEGIN PGM 15 MM")), [ACK]);
        // One bit is wrong, then half of the block is lost.
        let mut damaged = block("1 L X+10");
        damaged[3] ^= 0x02;
        assert_eq!(ear.after(&mut bench, &damaged), [NAK]);
        bench.receive(&block("1 L X+10")[..5]);
        swap(&mut bench);
        assert_eq!(ear.after(&mut bench, &[]), SILENCE);
        bench.run_for_millis(600);
        assert_eq!(ear.heard(&bench), [NAK]);
        assert_eq!(ear.after(&mut bench, &block("1 L X+10")), [ACK]);
        assert_eq!(ear.after(&mut bench, &[0x03, EOT]), SILENCE);
        // A second file of the same run.
        assert_eq!(ear.after(&mut bench, &header("H16A")), [ACK]);
        assert_eq!(ear.after(&mut bench, &block("0 END")), [ACK]);
        swap(&mut bench);
        bench.receive(&[0x03, EOT]);
        let deliveries = bench.deliveries();
        let seen: Vec<_> =
            deliveries.iter().map(|d| (d.name.as_deref(), d.bytes.as_slice(), d.failure)).collect();
        assert_eq!(
            seen,
            [
                (Some("15"), b"0 BEGIN PGM 15 MM\n1 L X+10\n".as_slice(), None),
                (Some("16"), b"0 END\n".as_slice(), None)
            ]
        );
    }
}

#[test]
fn a_block_is_asked_for_again_only_so_often() {
    let mut bench = bench().set("repeats", "2").open();
    let mut ear = Ear::new();
    assert_eq!(ear.after(&mut bench, &header("H1A")), [ACK]);
    let mut bad = block("1 L X+10");
    bad[2] ^= 1;
    assert_eq!(ear.after(&mut bench, &bad), [NAK]);
    assert_eq!(ear.after(&mut bench, &bad), [NAK]);
    assert_eq!(ear.after(&mut bench, &bad), [EOT]);
    let deliveries = bench.deliveries();
    assert_eq!(deliveries[0].failure, Some(Failure::Checksum));
}

#[test]
fn the_control_asks_and_gets_its_program() {
    for swaps in [false, true] {
        let mut bench = bench().open();
        let mut ear = Ear::new();
        assert_eq!(ear.after(&mut bench, &header("H15E")), SILENCE);
        let (request, text) = asked(&bench).unwrap();
        assert_eq!(text, "15/H");
        bench.host(|link, now, host| link.answer(now, request, Ok(&[]), host));
        assert_eq!(ear.heard(&bench), SILENCE);
        let program = "0 BEGIN PGM 15 MM\r\n1 L X+10\n2 END";
        bench.send(program.as_bytes());
        bench.run_for_millis(500);
        let mut first = vec![ACK];
        first.extend(block("0 BEGIN PGM 15 MM"));
        assert_eq!(ear.heard(&bench), first);
        if swaps {
            bench.swap();
        }
        assert_eq!(ear.after(&mut bench, &[NAK]), block("0 BEGIN PGM 15 MM"));
        assert_eq!(ear.after(&mut bench, &[ACK]), block("1 L X+10"));
        if swaps {
            bench.swap();
        }
        assert_eq!(ear.after(&mut bench, &[ACK]), block("2 END"));
        assert_eq!(job_end(&bench), None);
        assert_eq!(ear.after(&mut bench, &[ACK]), [0x03, EOT]);
        let sent = 2 * 21 + 12 + 9 + 2;
        assert_eq!(job_end(&bench), Some((None, sent)));
        assert_eq!(ear.after(&mut bench, &[EOT]), SILENCE);
    }
}

#[test]
fn a_job_waits_for_its_name() {
    let mut bench = bench().open();
    let mut ear = Ear::new();
    let mut buffer = [0; 32];
    let mut fields = ValueWriter::new(&mut buffer);
    fields.push(0, Value::Text("15")).unwrap();
    bench.begin_job(0, fields.written().to_vec(), b"1 L X+10\n");
    assert_eq!(ear.after(&mut bench, &header("H16E")), [EOT]);
    let mut first = vec![ACK];
    first.extend(block("1 L X+10"));
    assert_eq!(ear.after(&mut bench, &header("H15E")), first);
    // The control gives up in the middle.
    assert_eq!(ear.after(&mut bench, &[EOT]), SILENCE);
    assert_eq!(job_end(&bench), Some((Some(Failure::Refused), 12)));
}

#[test]
fn answers_that_do_not_come_or_come_too_early() {
    let mut bench = bench().set("answer_time", "2000").open();
    let mut ear = Ear::new();
    bench.send(b"1 L X+10\n");
    bench.receive(&header("H15E"));
    bench.run_for_millis(5);
    // The block is still on its way: this answers nothing.
    bench.receive(&[ACK]);
    bench.run_for_millis(100);
    let mut first = vec![ACK];
    first.extend(block("1 L X+10"));
    assert_eq!(ear.heard(&bench), first);
    bench.run_for_millis(1_800);
    assert_eq!(ear.heard(&bench), SILENCE);
    bench.run_for_millis(200);
    assert_eq!(ear.heard(&bench), [EOT]);
    assert_eq!(job_end(&bench), Some((Some(Failure::NoAnswer), 12)));
}

#[test]
fn the_time_for_an_answer_begins_when_the_block_has_left_for_certain() {
    let mut bench = bench().set("answer_time", "2000").open();
    bench.send(b"1 L X+10\n");
    bench.host(|link, now, host| {
        link.received(now, &header("H15E"), host)?;
        link.handle_timeout(now, host)?;
        let sent = (1 + block("1 L X+10").len()) as u64;
        let mut taken = 0;
        while let Taken::Bytes(count) = link.take(&mut [0; 64]) {
            taken += count as u64;
        }
        assert_eq!(taken, sent);
        // The port has it all, and cannot say yet that it has gone.
        link.left(sent, 0);
        link.handle_timeout(now + Micros(100), host)?;
        assert_eq!(link.poll_timeout(), None);
        link.left(sent, sent);
        link.handle_timeout(now + Micros(200), host)?;
        assert_eq!(link.poll_timeout(), Some(now + Micros(200) + Micros::from_millis(2_000)));
        Ok(())
    });
}

#[test]
fn blocks_go_on_when_a_port_says_late_what_has_left() {
    let mut bench = bench().open();
    bench.send("1 L X+10\n".repeat(70).as_bytes());
    bench.host(|link, now, host| {
        link.received(now, &header("H15E"), host)?;
        let mut taken = 0;
        for round in 1..200 {
            let now = now + Micros(100 * round);
            link.handle_timeout(now, host)?;
            while let Taken::Bytes(count) = link.take(&mut [0; 64]) {
                taken += count as u64;
            }
            // The port has it all at once, and says seldom that it has gone.
            link.left(taken, if round % 50 == 0 { taken } else { 0 });
            link.handle_timeout(now, host)?;
            link.received(now, &[ACK], host)?;
        }
        Ok(())
    });
    assert_eq!(job_end(&bench), Some((None, 70 * 12 + 2)));
}

#[test]
fn what_cannot_be_sent_is_refused_before_it_is_sent() {
    let long = "X".repeat(241);
    let cases = [
        ("1 L X+10\n2 \u{7f}\n", Failure::UnsupportedCharacter, 2, 3),
        ("1 L\rX+10\n", Failure::UnsupportedCharacter, 1, 4),
        (long.as_str(), Failure::TooLong, 1, 241),
    ];
    for (program, failure, line, column) in cases {
        let mut bench = bench().open();
        bench.send(program.as_bytes());
        let checked = bench.observed().iter().find_map(|(_, observed)| match observed {
            Observed::Checked { failure, line, column, .. } => Some((*failure, *line, *column)),
            _ => None,
        });
        assert_eq!(checked, Some((Some(failure), line, column)), "{program:?}");
        assert_eq!(bench.sent(), SILENCE);
    }
}

#[test]
fn parity_and_space_are_made_and_taken_off() {
    let mut bench = bench().set("parity", "even").set("bcc_space", "on").open();
    let mut ear = Ear::new();
    let even = |bytes: &[u8]| -> Vec<u8> {
        bytes.iter().map(|b| b | if b.count_ones() % 2 == 1 { 0x80 } else { 0 }).collect()
    };
    // The manual's own example: the check 1F is 9F on the wire.
    assert_eq!(even(&header("H15E"))[6], 0x9F);
    bench.send(b"10\n");
    let mut answer = vec![ACK];
    // 02 ^ '1' ^ '0' ^ 17 is 14: a space makes it 34.
    answer.extend(block("10 "));
    assert_eq!(ear.after(&mut bench, &even(&header("H15E"))), even(&answer));
    assert_eq!(ear.after(&mut bench, &even(&[ACK])), even(&[0x03, EOT]));
    assert_eq!(ear.after(&mut bench, &even(&header("H15A"))), even(&[ACK]));
    assert_eq!(ear.after(&mut bench, &even(&block("10 "))), even(&[ACK]));
    bench.receive(&even(&[0x03, EOT]));
    assert_eq!(bench.deliveries()[0].bytes, b"10\n");
}

#[test]
fn a_block_waits_for_room() {
    let mut bench = bench().room(256, 20).drain_by_hand().open();
    let mut ear = Ear::new();
    assert_eq!(ear.after(&mut bench, &header("H1A")), [ACK]);
    assert_eq!(ear.after(&mut bench, &block("1 L X+10")), [ACK]);
    assert_eq!(ear.after(&mut bench, &block("2 L X+11.5")), [ACK]);
    assert_eq!(ear.after(&mut bench, &block("3 L X+12")), SILENCE);
    bench.drain(20);
    bench.run_for_millis(10);
    assert_eq!(ear.heard(&bench), [ACK]);
    assert_eq!(ear.after(&mut bench, &[0x03, EOT]), SILENCE);
    assert_eq!(bench.deliveries()[0].bytes, b"1 L X+10\n2 L X+11.5\n3 L X+12\n");
}

#[test]
fn the_control_holds_the_line() {
    let mut bench = bench().open();
    let mut ear = Ear::new();
    bench.send(b"1 L X+10\n2 L X+20\n");
    bench.receive(&[0x13]);
    assert_eq!(ear.after(&mut bench, &header("H15E")), SILENCE);
    let mut first = vec![ACK];
    first.extend(block("1 L X+10"));
    assert_eq!(ear.after(&mut bench, &[0x11]), first);
    bench.host(|link, now, host| link.pause(now, JobId(1), host));
    assert_eq!(ear.after(&mut bench, &[ACK]), SILENCE);
    bench.host(|link, now, host| link.resume(now, JobId(1), host));
    bench.run_for_millis(100);
    assert_eq!(ear.heard(&bench), block("2 L X+20"));
    bench.host(|link, now, host| link.abort(now, JobId(1), host));
    bench.run_for_millis(100);
    assert_eq!(ear.heard(&bench), [EOT]);
    assert_eq!(job_end(&bench), Some((Some(Failure::Aborted), 24)));
}

#[test]
fn as_many_headers_as_one_event_holds() {
    // Each ends what the one before has begun: a delivery, a request.
    for (text, often) in [("H1A", 148), ("H1E", 148), ("HA", 173), ("H", 207)] {
        let mut bench = bench().room(4_096, 4_096).open();
        bench.receive(&header(text).repeat(often));
        bench.run_for_millis(1_000);
        let ends = |(_, seen): &&(Micros, Observed)| {
            matches!(seen, Observed::Withdraw(_) | Observed::Delivery { .. })
        };
        let ended = bench.observed().iter().filter(ends).count();
        let is_taken = text.len() > 1;
        assert_eq!(ended, if is_taken { often - 1 } else { 0 }, "{text}");
        let answers = if text.ends_with('E') { 0 } else { often };
        assert_eq!(bench.sent().len(), answers, "{text}");
    }
}
