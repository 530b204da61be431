//! Part programs on a bench: what leaves, when, and what the machine may do meanwhile.

use pulse_lathe::{PulseLathe, codes};
use softplug_plugin::LineParameters;
use softplug_plugin::bench::{Bench, BenchOptions, Observed};

fn bench() -> BenchOptions<PulseLathe> {
    Bench::new().line(LineParameters::new(40_000))
}

/// Whatever command leaves is done at once. Ends when the job has.
fn run(bench: &mut Bench<PulseLathe>) {
    // The first byte leaves as the job begins.
    let mut seen = bench.sent().len().saturating_sub(1);
    for _ in 0..200_000 {
        bench.run_until(bench.now() + softplug_plugin::Micros(250));
        let sent = bench.sent();
        for byte in &sent[seen..] {
            if (0x80..0xE0).contains(byte) {
                bench.run_until(bench.now() + softplug_plugin::Micros(250));
                bench.receive(&[*byte]);
            }
        }
        seen = sent.len();
        if bench.link().job().is_none() && end(bench).is_some() {
            return;
        }
    }
    panic!("the job does not end");
}

fn end(bench: &Bench<PulseLathe>) -> Option<Observed> {
    let ends = bench.observed().iter().rev().map(|(_, seen)| seen);
    ends.clone()
        .find(|seen| {
            matches!(seen, Observed::Done { .. } | Observed::Failed { .. })
                || matches!(seen, Observed::Checked { failure: Some(_), .. })
        })
        .cloned()
}

/// Pulses of x and z in all that has left.
fn place(bytes: &[u8]) -> (i64, i64) {
    bytes.iter().fold((0, 0), |(x, z), byte| {
        let (by_x, by_z) = codes::pulses(*byte);
        (x + by_x, z + by_z)
    })
}

fn commands(bytes: &[u8]) -> Vec<u8> {
    bytes.iter().copied().filter(|byte| *byte >= 0x80).collect()
}

fn sent_for(options: BenchOptions<PulseLathe>, program: &str) -> Vec<u8> {
    let mut bench = options.open();
    bench.send(program.as_bytes());
    run(&mut bench);
    let ended = end(&bench);
    assert!(matches!(ended, Some(Observed::Done { .. })), "{program}: {ended:?}");
    bench.sent()
}

fn refused(program: &str) -> (u16, u32, u32) {
    let mut bench = bench().open();
    bench.send(program.as_bytes());
    bench.run_for_millis(50);
    assert_eq!(bench.sent(), b"", "{program}: nothing has left");
    match end(&bench) {
        Some(Observed::Checked { status, line, column, .. }) => (status, line, column),
        other => panic!("{program}: {other:?}"),
    }
}

/// The example of the page: z in the positive direction, 5200 octal pulses, all else as before.
#[test]
fn the_example_moves_z_in_the_positive_direction() {
    let before = "6000 0000 0001 0000 1122 7777";
    let sent = sent_for(bench(), &format!("{before}\n6010; 4000; 5200; 0000"));
    assert_eq!(place(&sent), (0, 1 + 0o5200));
    // Speed step 11, tool 2, function 2.
    assert_eq!(commands(&sent), [0x80 | 0o11, 0xC2, 0xD2, codes::END]);
    assert_eq!(sent.len(), 1 + 0o5200 + 4);
}

#[test]
fn each_axis_goes_where_its_g_says() {
    for (g, expected) in [("6000", (0, 3)), ("4000", (0, -3)), ("1000", (3, 0)), ("0001", (-3, 0))]
    {
        let sent = sent_for(bench(), &format!("{g} 0000 0003 0000 0000 7777"));
        assert_eq!(place(&sent), expected, "{g}");
    }
}

#[test]
fn tapers_go_into_their_quadrant() {
    for (g, expected) in [
        ("7200", (5, 10)),
        ("5200", (5, -10)),
        ("4200", (-5, -10)),
        ("6200", (-5, 10)),
        ("3200", (10, 5)),
        ("1200", (10, -5)),
        ("0200", (-10, -5)),
        ("2200", (-10, 5)),
    ] {
        let sent = sent_for(bench(), &format!("{g} 0000 0012 0000 4000 0000 7777"));
        assert_eq!(place(&sent), expected, "{g}");
    }
}

/// A quarter from an axis to the next one: two pulses of x for each step.
#[test]
fn arcs_go_around_their_centre() {
    let (r, z, x) = (0o144, (0o144, 0), (0, 0o144));
    for (g, (nz, nx), expected) in [
        ("5040", z, (2 * r, -r)),
        ("4040", x, (-2 * r, -r)),
        ("6040", z, (-2 * r, r)),
        ("7040", x, (2 * r, r)),
        ("2040", x, (-2 * r, r)),
        ("3040", z, (2 * r, r)),
        ("1040", x, (2 * r, -r)),
        ("0040", z, (-2 * r, -r)),
    ] {
        let steps = 2 * r;
        let sent = sent_for(
            bench(),
            &format!("{g} 0000 {nz:04o} 0000 {nx:04o} 0000 {steps:04o} 0000 0000 7777"),
        );
        assert_eq!(place(&sent), expected, "{g}");
    }
}

#[test]
fn loops_run_as_often_as_they_say_also_in_loops() {
    let block = "6000 0000 0001 0000 0000 7777";
    // The inner section three times, the outer one four times.
    let text = format!("{block}\n1010 0000 0002 0000\n0000 0003 0006\n0000 0004 0000");
    let sent = sent_for(bench(), &text);
    assert_eq!(place(&sent), (4 * 3 * 2, 4));
}

#[test]
fn a_return_finds_zero_after_anything() {
    let text = "7200 0000 0144 0000 1234 0000 7777 5010 0000\n".replace("5010 0000", "");
    let text = format!("{text} 1010 0000 0100 0000 0004 0002");
    let sent = sent_for(bench(), &text);
    assert_eq!(place(&sent), (0, 0));
}

#[test]
fn an_offset_is_in_force_in_the_blocks_that_have_it() {
    let options = bench().set("x_offset_2", "7").set("z_offset_2", "-5");
    let with = "6000 4000 0012 0000 0020 7777";
    assert_eq!(place(&sent_for(options, with)), (7, 10 - 5));
    let options = bench().set("x_offset_2", "7").set("z_offset_2", "-5");
    let text = format!("{with} 6010 4000 0012 0000 6010 0000 0012 0000");
    assert_eq!(place(&sent_for(options, &text)), (0, 30));
}

#[test]
fn a_dwell_is_periods_without_pulses() {
    let sent = sent_for(bench().set("dwell", "3"), "6000 1000 0001 0000 0000 7777");
    assert_eq!(sent[2..], [0x04, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, codes::END]);
}

/// Each byte begins where the one before it ends, over blocks and lines.
#[test]
fn nothing_is_between_two_bytes_of_a_program() {
    let mut bench = bench().open();
    let block = "7210 0000 0144 0000 1234\n".repeat(30);
    bench.send(format!("6000 0000 0001 0000 0000 6000 {block}").as_bytes());
    run(&mut bench);
    let times: Vec<i64> = bench
        .observed()
        .iter()
        .filter(|(_, seen)| matches!(seen, Observed::Byte(byte) if *byte < 0x80))
        .map(|(at, _)| at.0)
        .collect();
    assert!(times.len() > 3_000);
    assert!(times.windows(2).all(|pair| pair[1] - pair[0] == 250));
}

#[test]
fn a_hold_loses_no_pulse_and_a_stop_knows_where_it_stands() {
    let program = "6000 0000 3720 0000 0000 7777";
    let whole = sent_for(bench(), program);
    let mut bench = bench().open();
    bench.send(program.as_bytes());
    bench.run_for_millis(2);
    for code in [0x80, 0xC0] {
        bench.receive(&[code]);
        bench.run_for_millis(2);
    }
    bench.run_for_millis(100);
    bench.receive(&[codes::KEY_HOLD]);
    let before = bench.sent().len();
    bench.run_for_millis(500);
    // The one on the wire, and the hold itself.
    assert!(bench.sent().len() <= before + 2);
    assert_eq!(bench.sent().last(), Some(&codes::HOLD));
    bench.receive(&[codes::KEY_START]);
    run(&mut bench);
    let sent: Vec<u8> = bench.sent().into_iter().filter(|byte| *byte != codes::HOLD).collect();
    assert_eq!(sent, whole);

    // Another one, stopped in the middle; then back to zero by the next job.
    bench.send(program.as_bytes());
    bench.run_for_millis(2);
    for code in [0x80, 0xC0] {
        bench.receive(&[code]);
        bench.run_for_millis(2);
    }
    bench.run_for_millis(77);
    bench.receive(&[codes::KEY_STOP]);
    bench.run_for_millis(10);
    assert!(matches!(end(&bench), Some(Observed::Failed { status: 21, .. })));
    assert_eq!(bench.sent().last(), Some(&codes::STOP));
    assert_ne!(place(&bench.sent()), (0, 4_000));
    bench.send(b"6000 0000 0000 0000 0000 7777 0004");
    run(&mut bench);
    assert_eq!(place(&bench.sent()), (0, 0));
}

#[test]
fn a_first_block_is_reached_where_the_blocks_before_it_end() {
    let text = "6000 0000 0100 0000 1122 7777\n7210 0000 0144 0000 1234\n\
         5050 0000 0144 0000 0000 0000 0300 0000\n0000 0003 0013\n1010 0000 0007 0000\n0001 0000 0003 0000 0235 7000";
    let whole = sent_for(bench(), text);
    for block in 2..=6 {
        let sent = sent_for(bench().set("start_block", &block.to_string()), text);
        assert_eq!(place(&sent), place(&whole), "from block {block}");
        if block < 6 {
            assert_eq!(commands(&sent)[..3], [0x80 | 0o11, 0xC2, 0xD2]);
        }
    }
    // What follows the way there is what it is in the whole.
    let last = sent_for(bench().set("start_block", "6"), text);
    let tail = |bytes: &[u8]| bytes[bytes.len() - 4..].to_vec();
    assert_eq!(tail(&last), tail(&whole));
}

#[test]
fn a_thread_follows_the_spindle_from_its_index_mark() {
    let mut bench = bench().set("spindle_increments", "100").open();
    // 1 mm a turn, 250 pulses.
    bench.send(b"4100 0000 0372 0000 0000 0144");
    bench.run_for_millis(2);
    for code in [0x80, 0xC0] {
        bench.receive(&[code]);
        bench.run_for_millis(2);
    }
    bench.receive(&[50, 10]);
    bench.run_for_millis(20);
    assert_eq!(place(&bench.sent()), (0, 0));
    bench.receive(&[0x40 | 0x28]);
    let mut turned = 0;
    while turned < 270 {
        bench.receive(&[3]);
        bench.run_for_millis(2);
        turned += 3;
        assert_eq!(place(&bench.sent()), (0, -i64::from(turned.min(250))));
    }
    bench.run_for_millis(5);
    assert!(matches!(end(&bench), Some(Observed::Done { .. })));
}

#[test]
fn iso_code_is_carried_out() {
    let text = "T0 S9 M3\nG00 X20 Z5\nG01 Z-10 F6000\nG02 X30 Z-15 I5 K0\nG28\nM30\n";
    let sent = sent_for(bench().set("input", "iso"), text);
    assert_eq!(place(&sent), (0, 0));
    assert_eq!(commands(&sent), [0x89, 0xC0, 0xD3, codes::END]);
}

#[test]
fn bad_words_are_refused_before_the_first_pulse() {
    let good = "6000 0000 0001 0000 0000 7777";
    for (program, expected) in [
        (format!("{good} 8000"), (1, 1, 31)),
        (format!("{good}\n 60104"), (1, 2, 2)),
        (format!("{good}\n(comment) 601"), (1, 2, 11)),
        (format!("{good}\n7777"), (2, 2, 1)),
        (format!("{good}\n6010 2000"), (3, 2, 6)),
        (format!("{good}\n6010 0000 0000 4000"), (4, 2, 16)),
        (format!("{good}\n5050 0000 0001 0000 0000 0000"), (5, 2, 26)),
        ("6010 0000".to_owned(), (6, 1, 1)),
        ("0004".to_owned(), (6, 1, 1)),
        (format!("{good} 0000 0000"), (7, 1, 36)),
        (format!("{good} 0000 0002 0003"), (8, 1, 41)),
        (format!("{good} 0000 0002 0006"), (8, 1, 41)),
        (format!("{good} {good} 0000 0002 0000 0000 0002 0006"), (8, 1, 86)),
        (format!("{good}\n6010 0000"), (10, 2, 6)),
        ("(nothing)".to_owned(), (10, 1, 1)),
    ] {
        assert_eq!(refused(&program), expected, "{program}");
    }
    let full = format!("{good}\n{}", "0004\n".repeat(2_810));
    assert_eq!(refused(&format!("{full}0004")), (9, 2_812, 1));
}

/// A swap in the middle of anything changes nothing.
#[test]
fn a_swap_changes_nothing() {
    let text = "6000 0000 0100 0000 1122 7000\n7210 0000 0144 0000 1234\n\
         5050 0000 0144 0000 0000 0000 0300 0000\n0000 0003 0006\n0002 0004";
    let whole = sent_for(bench(), text);
    let mut bench = bench().open();
    bench.send(text.as_bytes());
    let mut seen = 0;
    while bench.link().job().is_some() {
        bench.run_until(bench.now() + softplug_plugin::Micros(1_250));
        bench.swap();
        let sent = bench.sent();
        for byte in &sent[seen..] {
            if (0x80..0xE0).contains(byte) {
                bench.receive(&[*byte]);
            }
        }
        seen = sent.len();
    }
    assert_eq!(bench.sent(), whole);
}
