//! The feed against a control that says DC1 and DC3 as it likes.

use fanuc_rs232::FanucRs232;
use proptest::prelude::*;
use softplug_plugin::bench::{Bench, BenchOptions, Observed};
use softplug_plugin::{Failure, JobId, LineParameters, Micros};

const DC1: u8 = 0x11;
const DC3: u8 = 0x13;
/// A character at 10,000 baud 8N1, in µs.
const CHARACTER: i64 = 1_000;

/// What may differ from one transfer to the next.
#[derive(Clone, Debug)]
struct Setup {
    lfcrcr: bool,
    renumber: bool,
    leader: usize,
    trailer: usize,
    depth: usize,
    room: u32,
    /// Bytes of the program that come each ms; without it all are there.
    rate: Option<usize>,
    /// µs to wait, then what the control says, all at one time.
    control: Vec<(i64, Vec<u8>)>,
}

/// How it is carried out, which must make no difference.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
enum How {
    Plain,
    /// The control's codes arrive each in an event of its own.
    Cut,
    /// A new instance takes over whenever the control has spoken.
    Swapped,
}

fn setup() -> impl Strategy<Value = Setup> {
    let said = prop_oneof![Just(DC1), Just(DC3), Just(0x93)];
    let said = (0..9_000_i64, proptest::collection::vec(said, 1..4));
    let control = proptest::collection::vec(said, 0..30);
    let nuls = || prop_oneof![Just(0), 1..300_usize];
    let rate = proptest::option::of(1..9_usize);
    (any::<[bool; 2]>(), nuls(), nuls(), 1..5_usize, 1..600_u32, rate, control).prop_map(
        |([lfcrcr, renumber], leader, trailer, depth, room, rate, control)| Setup {
            lfcrcr,
            renumber,
            leader,
            trailer,
            depth,
            room,
            rate,
            control,
        },
    )
}

/// Blocks, some of them with a number.
fn program() -> impl Strategy<Value = Vec<String>> {
    proptest::collection::vec("(N[0-9]{1,3}|/N7)?(G1X[0-9]{1,4}|\\(N5 [A-Z]{0,9}\\)|M8)?", 0..60)
}

fn options(setup: &Setup) -> BenchOptions<FanucRs232> {
    let options = Bench::<FanucRs232>::new();
    let options = match setup.rate {
        Some(rate) => options.source_rate(rate),
        None => options,
    };
    options
        .line(LineParameters::new(10_000))
        .depth(setup.depth)
        .room(setup.room, 4_096)
        .set("parity", "none")
        .set("eob", if setup.lfcrcr { "lfcrcr" } else { "lf" })
        .set("block_numbers", if setup.renumber { "renumber" } else { "keep" })
        .set("leader", &setup.leader.to_string())
        .set("trailer", &setup.trailer.to_string())
}

/// What is to be sent, written the plain way.
fn expected(setup: &Setup, blocks: &[String]) -> Vec<u8> {
    let eob = if setup.lfcrcr { "\n\r\r" } else { "\n" };
    let mut tape = vec!["%".to_owned()];
    let mut number = 0;
    for block in blocks {
        let (slash, rest) = block.strip_prefix('/').map_or(("", &block[..]), |rest| ("/", rest));
        let digits = rest.strip_prefix('N').unwrap_or_default();
        let words = digits.trim_start_matches(|character: char| character.is_ascii_digit());
        if setup.renumber && words.len() < digits.len() {
            number += 10;
            tape.push(format!("{slash}N{number}{words}"));
        } else {
            tape.push(block.clone());
        }
    }
    tape.push("%".to_owned());
    [&vec![0; setup.leader][..], tape.join(eob).as_bytes(), &vec![0; setup.trailer]].concat()
}

type Seen = (Micros, Observed);

/// The transfer with all that was seen but state names, and what the control
/// said when.
fn transfer(setup: &Setup, program: &[u8], how: How) -> (Vec<Seen>, Vec<(i64, Vec<u8>)>) {
    let mut bench = options(setup).open();
    bench.send(program);
    let mut told = Vec::new();
    for (wait, said) in setup.control.iter().chain([&(20_000, vec![DC1])]) {
        bench.run_until(bench.now() + Micros(*wait));
        if how == How::Cut {
            bench.host(|link, now, host| {
                said.chunks(1).try_for_each(|byte| link.received(now, byte, host))
            });
        } else {
            bench.receive(said);
        }
        told.push((bench.now().0, said.clone()));
        if how == How::Swapped {
            bench.swap();
        }
    }
    bench.run_for_millis(10_000);
    let names = |(_, seen): &Seen| !matches!(seen, Observed::State(_));
    (bench.observed().iter().filter(|seen| names(seen)).cloned().collect(), told)
}

fn wire(observed: &[Seen]) -> Vec<(i64, u8)> {
    let byte = |(at, seen): &Seen| match seen {
        Observed::Byte(byte) => Some((at.0, *byte)),
        _ => None,
    };
    observed.iter().filter_map(byte).collect()
}

fn ends(observed: &[Seen]) -> Vec<&Seen> {
    let is_end = |seen: &&Seen| matches!(seen.1, Observed::Done { .. } | Observed::Failed { .. });
    observed.iter().filter(is_end).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn the_program_reaches_the_wire_when_the_control_reads(
        setup in setup(),
        blocks in program(),
    ) {
        let text = format!("%\n{}\n", blocks.join("\n"));
        let text = if blocks.is_empty() { "%\n".to_owned() } else { text };
        let (observed, told) = transfer(&setup, text.as_bytes(), How::Plain);
        let wire = wire(&observed);
        let bytes: Vec<u8> = wire.iter().map(|(_, byte)| *byte).collect();
        let expected = expected(&setup, &blocks);

        // Done once: with the last character, or by the final DC3 in the trailer.
        let sent = bytes.len() as u64;
        let ends = ends(&observed);
        prop_assert_eq!(ends.len(), 1);
        prop_assert_eq!(&ends[0].1, &Observed::Done { job: JobId(1), sent });
        let left = wire.last().map_or(0, |(at, _)| at + CHARACTER);
        let read = expected.len() - setup.trailer;
        prop_assert!(bytes.len() >= read && expected.starts_with(&bytes));
        if bytes.len() == expected.len() {
            prop_assert!(ends[0].0.0 <= left);
        } else {
            let percent = wire[read - 1].0 + CHARACTER;
            let end = ends[0].0.0;
            let mut said = told.iter().filter(|(at, _)| *at == end).flat_map(|(_, said)| said);
            prop_assert!(end >= percent && said.any(|code| *code != DC1));
        }

        // Nothing before DC1; after a DC3 only what the port holds, until DC1.
        let mut held_since = Some(-1);
        for (at, said) in told {
            let is_dc3 = said.last() != Some(&DC1);
            if let Some(since) = held_since {
                let late = wire.iter().filter(|(start, _)| *start > since && *start < at).count();
                let most = if since < 0 { 0 } else { setup.depth };
                prop_assert!(late <= most, "{late} from {since} to {at}");
            }
            held_since = match (is_dc3, held_since) {
                (true, None) => Some(at),
                (true, since) => since,
                (false, _) => None,
            };
        }
    }

    #[test]
    fn cuts_and_swaps_change_nothing(setup in setup(), blocks in program()) {
        let text = blocks.join("\r\n");
        let (plain, _) = transfer(&setup, text.as_bytes(), How::Plain);
        for how in [How::Cut, How::Swapped] {
            let (other, _) = transfer(&setup, text.as_bytes(), how);
            prop_assert_eq!(&other, &plain, "{:?}", how);
        }
    }
}

#[test]
fn no_more_is_asked_for_than_has_room_however_slowly_it_comes() {
    let blocks = vec!["G1X1000".to_owned(); 1_750];
    let setup = Setup {
        lfcrcr: false,
        renumber: false,
        leader: 0,
        trailer: 0,
        depth: 1,
        room: 2_048,
        rate: Some(1),
        // It reads from the beginning, as fast as data comes, then holds for longer than
        // it takes until there is no room.
        control: vec![(1_000_000, vec![DC1]), (20_000_000, vec![DC3]), (10_000_000, vec![DC1])],
    };
    let text = format!("%\n{}\n", blocks.join("\n"));
    let (observed, _) = transfer(&setup, text.as_bytes(), How::Plain);
    let sent: Vec<u8> = wire(&observed).iter().map(|(_, byte)| *byte).collect();
    assert_eq!(
        sent.escape_ascii().to_string(),
        expected(&setup, &blocks).escape_ascii().to_string()
    );
}

/// A field of a job as a value record.
fn field(index: u8, kind: u8, payload: &[u8]) -> Vec<u8> {
    let length = (payload.len() as u16).to_le_bytes();
    [&[index, 0, kind, 0], &length[..], payload].concat()
}

#[test]
fn a_restart_with_the_longest_preamble_fits_the_smallest_room() {
    let preamble = "G0\n".repeat(133);
    let skipped = "N10 G1 X1000\n".repeat(500);
    let program = format!("O1234\n{skipped}N20 M30\n");
    let expected = format!("%\r\nO1234\r\n{}N20 M30\r\n%", preamble.replace('\n', "\r\n"));
    let sequence = field(1, 2, &20_i64.to_le_bytes());
    let fields = [sequence, field(2, 3, preamble.as_bytes())].concat();
    for room in [1, 2, 31, 64, 200, 4_096, 1 << 20] {
        let mut bench = Bench::<FanucRs232>::new()
            .line(LineParameters::new(115_200))
            .room(room, 4_096)
            .set("eob", "crlf")
            .open();
        bench.begin_job(0, fields.clone(), program.as_bytes());
        bench.receive(&[DC1]);
        for _ in 0..2_000 {
            bench.run_until(bench.now() + Micros(100));
            bench.swap();
        }
        assert_eq!(String::from_utf8(bench.sent()).unwrap(), expected, "room {room}");
        let sent = expected.len() as u64;
        assert_eq!(ends(bench.observed())[0].1, Observed::Done { job: JobId(1), sent });
    }
}

#[test]
fn the_largest_leader_and_trailer_fit_any_room() {
    for room in [1, 100, 4_096, 1 << 20] {
        let mut bench = Bench::<FanucRs232>::new()
            .line(LineParameters::new(115_200))
            .room(room, 4_096)
            .set("leader", "2000")
            .set("trailer", "2000")
            .open();
        let program = "G1X1Y1\n".repeat(1_000);
        bench.send(program.as_bytes());
        bench.receive(&[DC1]);
        bench.run_for_millis(2_000);
        let nuls = [0; 2_000];
        let expected = [&nuls[..], b"%\n", program.as_bytes(), b"%", &nuls].concat();
        assert!(bench.sent() == expected, "room {room}");
        let sent = expected.len() as u64;
        assert_eq!(ends(bench.observed())[0].1, Observed::Done { job: JobId(1), sent });
    }
}

#[test]
fn an_abort_anywhere_drops_what_has_not_left_and_starts_nothing_else() {
    for step in 0..40 {
        let mut bench = Bench::<FanucRs232>::new()
            .line(LineParameters::new(10_000))
            .depth(3)
            .set("parity", "none")
            .set("leader", "3")
            .set("trailer", "3")
            .set("end_wait", "5")
            .open();
        bench.send(b"O1\nG1X1\nM30");
        bench.receive(&[DC1]);
        bench.run_until(Micros(step * 500));
        bench.host(|link, now, host| link.abort(now, JobId(1), host));
        let second = bench.send(b"O2");
        bench.run_for_millis(50);
        let first = b"\0\0\0%\nO1\nG1X1\nM30\n%\0\0\0";
        let sent = bench.sent();
        assert!(first.starts_with(&sent));
        let failed = Observed::Failed {
            job: JobId(1),
            failure: Failure::Aborted,
            status: 0,
            sent: sent.len() as u64,
        };
        assert_eq!(ends(bench.observed())[0].1, failed);
        bench.receive(&[DC1]);
        bench.run_for_millis(50);
        assert_eq!(&bench.sent()[sent.len()..], b"\0\0\0%\nO2\n%\0\0\0");
        let done = Observed::Done { job: second, sent: 12 };
        assert_eq!(ends(bench.observed())[1].1, done);
    }
}
