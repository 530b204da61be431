//! Captures on the bench.

use crate::FanucRs232;
use softplug_plugin::bench::{Bench, BenchOptions, Delivery};
use softplug_plugin::{Failure, LineErrorKind};

fn options() -> BenchOptions<FanucRs232> {
    Bench::new()
}

/// Text, how it ended, and name of what is delivered of bytes between DC2 and DC4.
fn captured(
    options: BenchOptions<FanucRs232>,
    tape: &[u8],
) -> Vec<(String, Option<Failure>, String)> {
    let mut bench = options.open();
    bench.receive(&[0x12]);
    for piece in tape.chunks(7) {
        bench.receive(piece);
        bench.run_for_millis(20);
    }
    bench.receive(&[0x14]);
    bench.run_for_millis(1_000);
    bench.deliveries().into_iter().map(read).collect()
}

fn read(delivery: &Delivery) -> (String, Option<Failure>, String) {
    let text = String::from_utf8_lossy(&delivery.bytes).into_owned();
    (text, delivery.failure, delivery.name.clone().unwrap_or_default())
}

fn good(text: &str, name: &str) -> (String, Option<Failure>, String) {
    (text.to_owned(), None, name.to_owned())
}

#[test]
fn every_form_of_eob_is_one_line_end() {
    for eob in ["\n", "\r\n", "\n\r\r", "\n\r", "\r"] {
        let tape = format!("\0\0ESC&HE:%{eob}O12{eob}N1G0{eob}M30{eob}%{eob}\0\0");
        let text = "%\nO12\nN1G0\nM30\n%\n";
        assert_eq!(captured(options(), tape.as_bytes()), [good(text, "O12")], "{eob:?}");
        let crlf = captured(options().set("line_end", "crlf"), tape.as_bytes());
        assert_eq!(crlf, [good(&text.replace('\n', "\r\n"), "O12")], "{eob:?}");
    }
}

#[test]
fn a_last_block_without_eob_and_line_ends_of_several_kinds() {
    assert_eq!(captured(options(), b"%\nO1\nM\r30%"), [good("%\nO1\nM\n30%\n", "O1")]);
    assert_eq!(captured(options(), b"%\rO1\r\rM30\r%"), [good("%\nO1\n\nM30\n%\n", "O1")]);
    assert_eq!(captured(options(), b"%\n\r\r\rO1\r\n\rM30%"), [good("%\n\nO1\n\nM30%\n", "O1")]);
}

#[test]
fn both_codes_are_known_by_their_first_eob() {
    // %, EOB, O1, EOB, N3, EOB, %
    let eia = [0x0B, 0x80, 0x46, 0x01, 0x80, 0x45, 0x13, 0x80, 0x0B];
    assert_eq!(captured(options(), &eia), [good("%\nO1\nN3\n%\n", "O1")]);
    // A header of more than 128 characters: what fits decides.
    let iso = [b"%".as_slice(), &[b'-'; 200], b"\nO1\n%\n"].concat();
    let text = format!("%{}\nO1\n%\n", "-".repeat(200));
    assert_eq!(captured(options(), &iso), [good(&text, "O1")]);
    let eia = [&[0x0B], [0x61; 200].as_slice(), &[0x80, 0x46, 0x01, 0x80, 0x0B]].concat();
    let text = format!("%{}\nO1\n%\n", "A".repeat(200));
    assert_eq!(captured(options(), &eia), [good(&text, "O1")]);
}

#[test]
fn programs_are_split_or_kept_together() {
    let tape = b"%\nO1\nM30\n:2(B)\nM99\nO3\n%";
    assert_eq!(captured(options(), tape), [good("%\nO1\nM30\n:2(B)\nM99\nO3\n%\n", "O1")]);
    let split =
        [good("%\nO1\nM30\n%\n", "O1"), good("%\n:2(B)\nM99\n%\n", "O2"), good("%\nO3\n%\n", "O3")];
    assert_eq!(captured(options().set("programs", "split"), tape), split);
}

#[test]
fn what_follows_a_closing_percent_is_another_delivery() {
    let two = [good("%\nO1\nM30\n%\n", "O1"), good("%\nO2\nM30\n%\n", "O2")];
    for eob in ["\n", "\r\n", "\r"] {
        for between in ["%\n", "%\n%\n", "%\n\0 \n%\n"] {
            let tape = format!("%\nO1\nM30\n{between}O2\nM30\n%\n\0\0");
            let tape = tape.replace('\n', eob);
            assert_eq!(captured(options(), tape.as_bytes()), two, "{tape:?}");
        }
    }
    let cut = captured(options(), b"%\nO7(50% )\nG1\nM30\n%\n");
    assert_eq!(cut, [good("%\nO7(50%\n", "O7"), good("%)\nG1\nM30\n%\n", "")]);
    let open = captured(options(), b"%\nO1\n%\nO2\nM30\n");
    let failed = ("%\nO2\nM30\n".to_owned(), Some(Failure::NoEndMark), "O2".to_owned());
    assert_eq!(open, [good("%\nO1\n%\n", "O1"), failed]);
}

#[test]
fn a_flood_of_programs_loses_nothing() {
    let tape = (0..300).map(|number| format!("O{number}")).collect::<Vec<_>>().join("\n") + "\n";
    let mut bench = options().set("programs", "split").open();
    bench.receive(&[b"\x12%\n", tape.as_bytes(), b"%\n\x14"].concat());
    bench.run_for_millis(1_000);
    let deliveries = bench.deliveries();
    assert_eq!(deliveries.len(), 300);
    assert!(deliveries.iter().all(|delivery| delivery.failure.is_none()));
    let text: String = deliveries.into_iter().map(|delivery| read(delivery).0).collect();
    assert_eq!(text.replace("%\n", ""), tape);
}

#[test]
fn the_tape_check_counts_as_it_is_set() {
    let checked = |set: &[(&str, &str)], tape: &str| {
        let options = options().set("tv_check", "on").set_all(set);
        captured(options, tape.as_bytes()).remove(0).1
    };
    let odd = Some(Failure::ParityCheck);
    // Characters and EOB: O12 has four, M30_ five.
    assert_eq!(checked(&[], "%\nO12\nM30\n%"), None);
    assert_eq!(checked(&[], "%\nO12\nM30 \n%"), odd);
    assert_eq!(checked(&[], "%A\nO12\n%"), None, "the first line is not checked");
    assert_eq!(checked(&[], "%\nO12\nM30 %"), None, "nor what no EOB ends");
    assert_eq!(checked(&[], "%\r\nO12\r\n%"), odd);
    assert_eq!(checked(&[("tv_cr", "off")], "%\r\nO12\r\n%"), None);
    assert_eq!(checked(&[], "%\n\rO12\n\rM30\n\r%"), odd, "the CR is of the next block");
    assert_eq!(checked(&[], "%\n\r\rO12\n\r\r%"), None);
    for set in ["on", "off"] {
        assert_eq!(checked(&[("tv_cr", set)], "%\rO12\rM30\r%"), None, "CR is EOB");
    }
    assert_eq!(checked(&[], "%\nO12(A)\n%"), odd);
    assert_eq!(checked(&[("tv_comments", "off")], "%\nO12(A)\n%"), None, "brackets count");
}

#[test]
fn a_damaged_character_keeps_its_place() {
    for (set, failure) in [("fail", Some(Failure::LineError)), ("keep", None)] {
        let mut bench = options().set("on_line_error", set).open();
        bench.receive(b"\x12%\nO");
        bench.line_error(LineErrorKind::Parity, Some(b'1'));
        bench.receive(b"\n%\n\x14");
        bench.run_for_millis(1_000);
        let delivered: Vec<_> = bench.deliveries().into_iter().map(read).collect();
        assert_eq!(delivered, [("%\nO1\n%\n".to_owned(), failure, "O1".to_owned())]);
    }
}

#[test]
fn a_flood_of_dc2_has_one_answer_at_a_time() {
    let mut bench = options().set("answer_dc2", "on").open();
    bench.receive(&[0x12; 1_000]);
    bench.run_for_millis(100);
    bench.receive(&[0x12; 1_000]);
    bench.run_for_millis(100);
    assert_eq!(bench.sent(), [0x11, 0x11]);
}
