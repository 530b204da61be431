//! Parts of protocols: what is gathered, what waits, and what leaves.

use proptest::prelude::*;
use softplug_link::Observed;
use softplug_plugin::bench::Bench;
use softplug_plugin::parts::{Answers, Block, BlockSender};
use softplug_plugin::{
    Context, Converter, Failure, JobId, JobStart, LineParameters, LinkDownReason, Micros, State,
    parts, state_format,
};

const DLE: u8 = 0x10;
const STX: u8 = 0x02;
const ETX: u8 = 0x03;
const ACK: u8 = 0x06;
const ENQ: u8 = 0x05;
/// Bytes of the job in a frame.
const DATA: usize = 64;

/// Sends the job in frames with DLE STX and DLE ETX, each DLE of it twice, one after the other; answers each
/// ENQ at once by DLE ACK.
#[derive(State)]
struct Frames {
    sender: BlockSender<DATA>,
    answers: Answers<250>,
    frame: Block<{ 2 * DATA + 4 }>,
}

impl Converter for Frames {
    type Settings = ();
    const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "frames", "version": "1", "licence": "MIT",
        "protocol": "p", "description": "d", "jobs": [{"name": "send", "text": "t"}],
        "state": {"saves": 1, "accepts": [1]}}"#;

    fn new((): ()) -> Self {
        Self { sender: BlockSender::new(), answers: Answers::new(), frame: Block::new() }
    }

    parts!(answers, sender);

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        self.sender.begin(link, job.job);
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        for byte in bytes {
            if *byte == ENQ {
                assert!(self.answers.say(link, &[DLE, ACK]));
            }
        }
    }

    fn abort(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.sender.cut(link, Failure::Aborted);
    }

    fn after(&mut self, link: &mut Context<'_>) {
        while self.sender.is_active() && self.answers.owes_nothing() {
            let data = *self.sender.data();
            if self.frame.is_empty() {
                if data.room() > 0 && !self.sender.has_ended() {
                    return self.sender.want(link, data.room());
                }
                if data.is_empty() {
                    return self.sender.done(link);
                }
                self.frame.extend(&[DLE, STX]);
                for byte in data.as_slice() {
                    let twin: &[u8] = if *byte == DLE { &[DLE] } else { &[] };
                    self.frame.extend(&[*byte]);
                    self.frame.extend(twin);
                }
                self.frame.extend(&[DLE, ETX]);
            }
            let frame = self.frame;
            let byte = |at: usize| frame.as_slice()[at];
            let symbol = |at: usize| if byte(at) == DLE { 2 } else { 1 };
            if !self.sender.give_symbols(link, frame.len(), byte, symbol) {
                return;
            }
            self.frame.clear();
            self.sender.acknowledged(data.len());
        }
    }

    state_format!(1);
}

/// What stands on the line: the data of whole frames, the bytes of one that is not, and how many answers. Fails for
/// anything else.
fn read(line: &[u8]) -> (Vec<u8>, usize, usize) {
    let (mut data, mut part, mut answers) = (Vec::new(), None::<Vec<u8>>, 0);
    let mut rest = line.iter();
    while let Some(byte) = rest.next() {
        if *byte != DLE {
            part.as_mut().expect("inside").push(*byte);
            continue;
        }
        match *rest.next().expect("a DLE does not stand alone") {
            ACK => answers += 1,
            STX => assert!(part.replace(Vec::new()).is_none()),
            ETX => data.extend(part.take().expect("inside")),
            DLE => part.as_mut().expect("inside").push(DLE),
            other => panic!("DLE {other:02X} in {line:02X?}"),
        }
    }
    (data, part.map_or(0, |part| part.len()), answers)
}

fn job_end(bench: &Bench<Frames>) -> Option<Observed> {
    let end = |seen: &Observed| matches!(seen, Observed::Done { .. } | Observed::Failed { .. });
    bench.observed().iter().map(|(_, seen)| seen.clone()).find(end)
}

fn bytes() -> impl Strategy<Value = Vec<u8>> {
    let byte = prop_oneof![Just(DLE), Just(ACK), Just(STX), any::<u8>()];
    proptest::collection::vec(byte, 0..300)
}

fn bench(baud: u32, depth: usize, room: u32) -> Bench<Frames> {
    Bench::new().line(LineParameters::new(baud)).depth(depth).room(room, 64).open()
}

proptest! {
    #[test]
    fn an_answer_stands_between_two_symbols(
        data in bytes(),
        pauses in proptest::collection::vec(1..60_i64, 0..20),
        depth in 1..40_usize,
        room in 64..300_u32,
    ) {
        let mut bench = bench(9_600, depth, room);
        bench.send(&data);
        for pause in &pauses {
            bench.run_for_millis(*pause);
            bench.receive(&[ENQ]);
            bench.swap();
        }
        bench.run_for_millis(2_000);
        let line = bench.sent();
        let (whole, part, answers) = read(&line);
        prop_assert_eq!((whole, part, answers), (data, 0, pauses.len()));
        let sent = (line.len() - 2 * answers) as u64;
        prop_assert_eq!(job_end(&bench), Some(Observed::Done { job: JobId(1), sent }));
    }

    #[test]
    fn an_answer_waits_for_two_pieces_at_most(data in bytes(), pause in 1..60_i64) {
        // Between line and link: the transmitter's own characters.
        let depth = 4;
        let mut bench = bench(9_600, depth, 300);
        bench.send(&data);
        bench.run_for_millis(pause);
        let before = bench.sent().len();
        bench.receive(&[ENQ]);
        bench.run_for_millis(2_000);
        let line = bench.sent();
        let symbols: Vec<usize> = (before.saturating_sub(1)..line.len() - 1)
            .filter(|at| line[*at..*at + 2] == [DLE, ACK])
            .collect();
        let first = symbols.first().copied();
        prop_assert!(first.is_some_and(|at| at <= before + depth + 48 + 1), "{first:?} {before}");
    }

    #[test]
    fn what_is_cut_ends_between_two_symbols_and_spares_answers(
        data in bytes(),
        pause in 1..100_i64,
        asked in 0..5_usize,
    ) {
        let mut bench = bench(9_600, 16, 128);
        bench.send(&data);
        bench.run_for_millis(pause);
        bench.receive(&vec![ENQ; asked]);
        bench.host(|link, now, host| link.abort(now, JobId(1), host));
        bench.run_for_millis(2_000);
        let line = bench.sent();
        // It can be read, whatever was cut.
        let (_, _, answers) = read(&line);
        prop_assert_eq!(answers, asked);
        let sent = (line.len() - 2 * answers) as u64;
        let end = job_end(&bench);
        let aborted = Observed::Failed { job: JobId(1), failure: Failure::Aborted, status: 0, sent };
        prop_assert!(end == Some(aborted) || end == Some(Observed::Done { job: JobId(1), sent }), "{end:?} {sent}");
    }

    #[test]
    fn a_cable_that_is_pulled_ends_what_is_cut_and_nothing_of_it_leaves_later(
        data in bytes(),
        pause in 1..100_i64,
        wait in 0..20_i64,
    ) {
        let mut bench = bench(9_600, 16, 128);
        bench.send(&data);
        bench.run_for_millis(pause);
        bench.host(|link, now, host| link.abort(now, JobId(1), host));
        bench.run_for_millis(wait);
        bench.host(|link, now, host| link.link_down(now, LinkDownReason::Unplugged, host));
        bench.run_for_millis(100);
        let end = job_end(&bench);
        bench.host(|link, now, host| link.link_up(now, host));
        bench.run_for_millis(2_000);
        // What the port had leaves, and was counted.
        let sent = bench.sent().len() as u64;
        let aborted = Observed::Failed { job: JobId(1), failure: Failure::Aborted, status: 0, sent };
        prop_assert!(end == Some(aborted) || end == Some(Observed::Done { job: JobId(1), sent }), "{end:?} {sent}");
    }

    #[test]
    fn what_is_cut_while_the_cable_is_pulled_ends_at_once(
        data in bytes(),
        pause in 1..100_i64,
        is_opened_anew in any::<bool>(),
    ) {
        let mut bench = bench(9_600, 16, 128);
        if is_opened_anew {
            // Without its cable when it was closed: it is there again when the link is opened.
            bench.host(|link, now, host| link.link_down(now, LinkDownReason::Unplugged, host));
            bench.host(|link, now, host| link.close(now, host));
            bench.run_for_millis(10);
            bench.host(|link, now, host| link.open(now, host));
        }
        bench.send(&data);
        bench.run_for_millis(pause);
        if is_opened_anew {
            bench.receive(&[ENQ; 3]);
            bench.host(|link, now, host| link.abort(now, JobId(1), host));
            bench.run_for_millis(2_000);
            prop_assert_eq!(read(&bench.sent()).2, 3, "answers are spared");
            return Ok(());
        }
        bench.host(|link, now, host| link.link_down(now, LinkDownReason::Unplugged, host));
        bench.swap();
        bench.host(|link, now, host| link.abort(now, JobId(1), host));
        bench.run_for_millis(100);
        let end = job_end(&bench);
        bench.host(|link, now, host| link.link_up(now, host));
        bench.run_for_millis(2_000);
        let sent = bench.sent().len() as u64;
        let aborted = Observed::Failed { job: JobId(1), failure: Failure::Aborted, status: 0, sent };
        prop_assert!(end == Some(aborted) || end == Some(Observed::Done { job: JobId(1), sent }), "{end:?} {sent}");
    }

    #[test]
    fn frames_and_answers_are_the_same_in_every_room(
        data in bytes(),
        pauses in proptest::collection::vec(1..60_i64, 0..10),
        abort in 0..300_i64,
        room in 64..300_u32,
    ) {
        let seen = [room, 4_096].map(|room| {
            let mut bench = bench(9_600, 8, room);
            bench.send(&data);
            for pause in &pauses {
                bench.run_for_millis(*pause);
                bench.receive(&[ENQ; 3]);
            }
            bench.run_for_millis(abort);
            bench.host(|link, now, host| link.abort(now, JobId(1), host));
            bench.run_for_millis(2_000);
            // It can be read in any room, and no answer is lost.
            prop_assert_eq!(read(&bench.sent()).2, 3 * pauses.len());
            Ok(bench.observed().to_vec())
        });
        let [small, large] = seen;
        let (small, large) = (small?, large?);
        // Where more answers wait than fit beside two pieces, the frame waits for them.
        if 48 + 3 * 2 * pauses.len() <= room as usize {
            prop_assert_eq!(small, large);
        }
    }

    #[test]
    fn a_block_is_a_short_vector(steps in proptest::collection::vec((0..5_u8, bytes()), 0..40)) {
        let (mut block, mut model) = (Block::<100>::new(), Vec::new());
        for (step, bytes) in steps {
            match step {
                0 => {
                    let fits = bytes.len().min(100 - model.len());
                    prop_assert_eq!(block.extend(&bytes), fits);
                    model.extend(&bytes[..fits]);
                }
                1 => {
                    prop_assert_eq!(block.push(7), model.len() < 100);
                    if model.len() < 100 {
                        model.push(7);
                    }
                }
                2 => {
                    block.drop_first(bytes.len());
                    model.drain(..bytes.len().min(model.len()));
                }
                3 => {
                    block.drop_last();
                    model.pop();
                }
                _ if bytes.len() < 30 => {
                    block.clear();
                    model.clear();
                }
                _ => {}
            }
            prop_assert_eq!(block.as_slice(), &model[..]);
            prop_assert_eq!((block.len(), block.room()), (model.len(), 100 - model.len()));
        }
    }
}

/// Sends the job in blocks of 40 bytes as they are, each when the one before can have left.
#[derive(State)]
struct Plain {
    sender: BlockSender<40>,
    is_given: bool,
}

impl Converter for Plain {
    type Settings = ();
    const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "plain", "version": "1", "licence": "MIT",
        "protocol": "p", "description": "d", "jobs": [{"name": "send", "text": "t"}],
        "state": {"saves": 1, "accepts": [1]}}"#;

    fn new((): ()) -> Self {
        Self { sender: BlockSender::new(), is_given: false }
    }

    parts!(sender);

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        self.sender.begin(link, job.job);
        self.is_given = false;
    }

    fn abort(&mut self, link: &mut Context<'_>, _job: JobId) {
        self.sender.stop(link, Failure::Aborted);
    }

    fn after(&mut self, link: &mut Context<'_>) {
        if self.is_given && self.sender.has_left() {
            self.is_given = false;
            self.sender.acknowledged(40);
        }
        if self.is_given || !self.sender.is_active() || self.sender.is_paused() {
            return;
        }
        let data = *self.sender.data();
        if data.room() > 0 && !self.sender.has_ended() {
            self.sender.want(link, data.room());
        } else if data.is_empty() {
            self.sender.done(link);
        } else {
            self.is_given = self.sender.give(link, &[data.as_slice()]);
        }
    }

    state_format!(1);
}

proptest! {
    #[test]
    fn blocks_leave_as_they_are_and_what_has_left_is_counted(
        data in bytes(),
        depth in 1..40_usize,
        room in 1..100_u32,
        pauses in proptest::collection::vec(1..50_i64, 0..6),
        is_aborted in any::<bool>(),
    ) {
        let mut bench = Bench::<Plain>::new().depth(depth).room(room, 64).open();
        bench.send(&data);
        for pause in pauses {
            bench.run_for_millis(pause);
            bench.swap();
        }
        if is_aborted {
            bench.host(|link, now, host| link.abort(now, JobId(1), host));
        }
        bench.run_for_millis(1_000);
        let line = bench.sent();
        prop_assert_eq!(&line[..], &data[..line.len()]);
        let sent = line.len() as u64;
        let ends: Vec<_> = bench.observed().iter().map(|(_, seen)| seen.clone()).collect();
        let failed = Observed::Failed { job: JobId(1), failure: Failure::Aborted, status: 0, sent };
        let done = Observed::Done { job: JobId(1), sent };
        let is_done = ends.contains(&done) && line.len() == data.len();
        prop_assert!(is_done || (is_aborted && ends.contains(&failed)), "{ends:?}");
    }
}

/// Says what comes, as an answer each, while there is room for it here.
struct Parrot {
    answers: Answers<6>,
    lost: usize,
}

impl Converter for Parrot {
    type Settings = ();
    const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "parrot", "version": "1", "licence": "MIT",
        "protocol": "p", "description": "d"}"#;

    fn new((): ()) -> Self {
        Self { answers: Answers::new(), lost: 0 }
    }

    parts!(answers);

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        self.lost += usize::from(!self.answers.say(link, bytes));
    }

    fn after(&mut self, link: &mut Context<'_>) {
        link.state(if self.lost > 0 { "lost" } else { "well" });
    }
}

#[test]
fn an_answer_that_cannot_wait_as_a_whole_is_not_sent() {
    let mut bench = Bench::<Parrot>::new().room(4, 64).depth(1).open();
    for answer in ["abcdef", "ghi", "jkl", "m"] {
        bench.receive(answer.as_bytes());
    }
    let lost = Observed::State("lost".into());
    let seen: Vec<bool> = bench.observed().iter().map(|(_, seen)| *seen == lost).collect();
    // Once for the opening, and twice for the room.
    assert_eq!(seen, [false, false, false, false, false, true, true]);
    bench.run_for_millis(100);
    assert_eq!(bench.sent(), b"abcdefghim");
}

#[test]
fn jobs_go_one_after_the_other() {
    let mut bench = bench(9_600, 16, 128);
    bench.send(b"one");
    bench.send(b"two");
    bench.run_until(Micros::from_secs(1));
    assert_eq!(read(&bench.sent()).0, b"onetwo");
}
