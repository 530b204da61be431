//! A block that goes in pieces: cut by room and output, with answers behind it, and cut short.

use softplug_plugin::bench::{Bench, Observed};
use softplug_plugin::parts::{Answers, BlockSender};
use softplug_plugin::{Context, Converter, Failure, JobId, JobStart, State, parts, state_format};

/// Sends all of a job as one block, and answers each character that comes with ACK, but not inside the block. ETX
/// cuts the block.
#[derive(State)]
struct Whole {
    sender: BlockSender<6_000>,
    answers: Answers<8>,
    is_given: bool,
}

const ACK: u8 = 0x06;
const ETX: u8 = 0x03;

impl Converter for Whole {
    type Settings = ();
    const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "whole", "version": "1", "licence": "MIT",
        "protocol": "p", "description": "d", "jobs": [{"name": "send", "text": "t"}],
        "state": {"saves": 1, "accepts": [1]}}"#;
    const STATE_CAPACITY: usize = 8_192;

    fn new((): ()) -> Self {
        Self { sender: BlockSender::new(), answers: Answers::new(), is_given: false }
    }

    parts!(sender);

    fn job_begin(&mut self, link: &mut Context<'_>, job: JobStart<'_>) {
        self.sender.begin(link, job.job);
        self.is_given = false;
    }

    fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
        for byte in bytes {
            if *byte == ETX {
                self.sender.cut(link, Failure::Refused);
            } else {
                self.answers.keep(&[ACK]);
            }
        }
    }

    fn after(&mut self, link: &mut Context<'_>) {
        if !self.sender.is_given_in_part() {
            self.answers.pay(link);
        }
        if !self.sender.is_active() {
            return;
        }
        if self.is_given {
            if self.sender.has_left() {
                self.sender.done(link);
            }
        } else if self.sender.has_ended() {
            let data = *self.sender.data();
            self.is_given = self.sender.give(link, &[b"<", data.as_slice(), b">"]);
        } else {
            self.sender.want(link, self.sender.data().room());
        }
    }

    state_format!(1);
}

fn data(length: usize) -> Vec<u8> {
    (0..length).map(|at| b'a' + (at % 26) as u8).collect()
}

fn framed(data: &[u8]) -> Vec<u8> {
    [b"<", data, b">"].concat()
}

#[test]
fn a_block_is_longer_than_the_output_of_an_event() {
    for room in [1, 100, 4_000, 4_096, 5_000, 65_535] {
        let mut bench = Bench::<Whole>::new().room(room, 64).open();
        let data = data(5_900);
        bench.send(&data);
        bench.run_for_millis(9_000);
        assert_eq!(bench.sent(), framed(&data), "room {room}");
        let done = Observed::Done { job: JobId(1), sent: 5_902 };
        assert!(bench.observed().iter().any(|(_, seen)| *seen == done), "room {room}");
    }
}

#[test]
fn an_answer_that_is_kept_stands_behind_the_block() {
    for room in [1, 16, 64, 130, 4_096] {
        for swaps in [false, true] {
            let mut bench = Bench::<Whole>::new().room(room, 64).open();
            let data = data(128);
            bench.send(&data);
            for _ in 0..4 {
                bench.run_for_millis(10);
                bench.receive(b"x");
                if swaps {
                    bench.swap();
                }
            }
            bench.run_for_millis(500);
            let mut sent = bench.sent();
            let answers = sent.split_off(130);
            assert_eq!((sent, answers), (framed(&data), vec![ACK; 4]), "room {room}");
        }
    }
}

#[test]
fn a_block_that_is_cut_fails_when_what_was_given_has_left() {
    for room in [1, 16, 100, 4_096] {
        let mut bench = Bench::<Whole>::new().room(room, 64).open();
        let data = data(300);
        bench.send(&data);
        bench.run_for_millis(50);
        bench.receive(&[ETX]);
        bench.run_for_millis(1_000);
        let sent = bench.sent();
        assert!(framed(&data).starts_with(&sent), "room {room}");
        let failed = Observed::Failed {
            job: JobId(1),
            failure: Failure::Refused,
            status: 0,
            sent: sent.len() as u64,
        };
        let at = bench.observed().iter().find(|(_, seen)| *seen == failed).map(|(at, _)| *at);
        let last = bench.observed().iter().rev();
        let last = last.clone().find(|(_, seen)| matches!(seen, Observed::Byte(_))).unwrap().0;
        assert!(
            at.is_some_and(|at| at > last),
            "room {room}: {at:?}, and the last byte began at {last}"
        );
    }
}

#[test]
fn what_the_port_holds_is_not_on_the_wire() {
    let mut bench = Bench::<Whole>::new().depth(16).open();
    bench.send(&data(100));
    bench.run_for_millis(1);
    // 9,600 baud: a character takes 1,042 µs.
    assert_eq!(bench.sent(), b"<");
    bench.run_for_millis(2);
    assert_eq!(bench.sent(), b"<ab");
}

/// Saves what its manifest does not say, though that accepts it.
#[derive(State)]
struct Liar {
    count: u8,
}

impl Converter for Liar {
    type Settings = ();
    const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "liar", "version": "1", "licence": "MIT",
        "protocol": "p", "description": "d", "state": {"saves": 2, "accepts": [1, 2]}}"#;

    fn new((): ()) -> Self {
        Self { count: 0 }
    }

    state_format!(1);
}

#[test]
#[should_panic(expected = "a state of format 1, which its manifest does not say")]
fn a_state_of_another_format_than_the_manifest_says_is_found() {
    Bench::<Liar>::new().open().swap();
}
