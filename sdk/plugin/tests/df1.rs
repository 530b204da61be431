//! The DF1 plug-in that is made of parts: how long it is, and that it talks to a partner that knows nothing of
//! it, natively and as a module.

#[path = "../examples/df1/main.rs"]
#[allow(unreachable_pub, dead_code, reason = "it is a crate of its own as well")]
mod example;

use example::Df1;
use proptest::prelude::*;
use softplug_abi::manifest::Manifest;
use softplug_abi::{Failure, Instance, LineParameters, Micros};
use softplug_interpreter::{Module, Room, Session};
use softplug_link::{Job, LinkOptions, Observed, Recorder, VirtualLine};
use softplug_plugin::{Converter, JobId, Native};
use std::path::Path;
use std::process::Command;
use std::sync::{Arc, OnceLock};

const DLE: u8 = 0x10;
const ACK: [u8; 2] = [DLE, 0x06];
const NAK: [u8; 2] = [DLE, 0x0F];
const ENQ: [u8; 2] = [DLE, 0x05];

#[test]
fn it_has_500_lines_at_most() {
    let files = [include_str!("../examples/df1/main.rs"), include_str!("../examples/df1/frame.rs")];
    let lines: usize = files.iter().map(|text| text.lines().count()).sum();
    assert!(lines <= 500, "{lines} lines");
}

/// The other end of the line, written from the publication: what it has heard, and what it says.
#[derive(Default)]
struct Partner {
    with_crc: bool,
    /// Answers to the next messages; ACK after them.
    answers: Vec<Answer>,
    /// What it says once more after DLE ENQ.
    last: Option<[u8; 2]>,
    heard: Vec<u8>,
    read: usize,
    messages: Vec<Vec<u8>>,
    /// DLE ACK, DLE NAK and DLE ENQ that it has heard.
    symbols: Vec<u8>,
}

#[derive(Copy, Clone, PartialEq, Eq, Debug)]
enum Answer {
    Ack,
    Nak,
    /// The answer is lost; asked for by DLE ENQ it comes.
    Lost,
    /// Neither comes.
    Silence,
}

impl Partner {
    fn frame(&self, message: &[u8]) -> Vec<u8> {
        let mut frame = vec![DLE, 0x02];
        for byte in message {
            frame.push(*byte);
            if *byte == DLE {
                frame.push(DLE);
            }
        }
        frame.extend([DLE, 0x03]);
        frame.extend(self.check(message));
        frame
    }

    fn check(&self, message: &[u8]) -> Vec<u8> {
        if !self.with_crc {
            let sum = message.iter().map(|byte| u32::from(*byte)).sum::<u32>();
            return vec![(256 - sum % 256) as u8];
        }
        let mut crc = 0_u16;
        for byte in message.iter().chain(&[0x03]) {
            crc ^= u16::from(*byte);
            for _ in 0..8 {
                crc = if crc & 1 == 1 { crc >> 1 ^ 0xA001 } else { crc >> 1 };
            }
        }
        crc.to_le_bytes().to_vec()
    }

    /// Hears, and tells what it says to that. Symbols stand between symbols, also inside of a message.
    fn hear(&mut self, bytes: &[u8]) -> Vec<u8> {
        self.heard.extend(bytes);
        let mut said = Vec::new();
        while let Some(used) = self.symbol(&mut said) {
            self.read += used;
        }
        said
    }

    /// The symbol, or the message, at the place that is read: its length, once it is there as a whole.
    fn symbol(&mut self, said: &mut Vec<u8>) -> Option<usize> {
        let rest = &self.heard[self.read..];
        let code = *rest.get(1)?;
        assert_eq!(rest[0], DLE, "outside of a message only symbols stand: {rest:02X?}");
        match code {
            0x02 => return self.message(said),
            0x05 => said.extend(self.last.into_iter().flatten()),
            _ => {}
        }
        self.symbols.push(code);
        Some(2)
    }

    fn message(&mut self, said: &mut Vec<u8>) -> Option<usize> {
        let rest = &self.heard[self.read..];
        let (mut at, mut message, mut inside) = (2, Vec::new(), Vec::new());
        loop {
            let byte = *rest.get(at)?;
            if byte != DLE {
                message.push(byte);
                at += 1;
                continue;
            }
            match *rest.get(at + 1)? {
                DLE => message.push(DLE),
                0x03 => break,
                // The frame before was cut: this one begins.
                0x02 => message.clear(),
                code @ (0x05 | 0x06 | 0x0F) => inside.push(code),
                code => panic!("DLE {code:02X} inside of a message: {rest:02X?}"),
            }
            at += 2;
        }
        let check = self.check(&message);
        assert_eq!(rest.get(at + 2..at + 2 + check.len())?, check);
        self.symbols.extend(inside);
        self.messages.push(message);
        let answer = if self.answers.is_empty() { Answer::Ack } else { self.answers.remove(0) };
        self.last = match answer {
            Answer::Ack | Answer::Lost => Some(ACK),
            Answer::Nak => Some(NAK),
            Answer::Silence => None,
        };
        if matches!(answer, Answer::Ack | Answer::Nak) {
            said.extend(self.last.into_iter().flatten());
        }
        Some(at + 2 + check.len())
    }
}

/// Plug-in and partner on one line.
struct Talk<I: Instance> {
    line: VirtualLine<I>,
    recorder: Recorder,
    now: Micros,
    partner: Partner,
    sent: usize,
    /// What the partner says, and when.
    said: Vec<(Micros, Vec<u8>)>,
}

/// A partner answers when it has heard all: what the transmitter has leaves meanwhile.
const DELAY: Micros = Micros::from_millis(12);

impl<I: Instance> Talk<I> {
    fn new(instance: I, settings: &[(&str, &str)]) -> Self {
        let manifest = Manifest::parse(Df1::MANIFEST.as_bytes()).unwrap();
        let options = LinkOptions {
            settings: manifest.resolve_settings(settings.iter().copied()).unwrap(),
            line: LineParameters::new(19_200),
            transmit_room: 64,
            delivery_room: 600,
            ..LinkOptions::default()
        };
        let with_crc = settings.contains(&("check", "crc"));
        let mut talk = Self {
            line: VirtualLine::new(instance, options, 16),
            recorder: Recorder::default(),
            now: Micros::ZERO,
            partner: Partner { with_crc, ..Partner::default() },
            sent: 0,
            said: Vec::new(),
        };
        talk.line.link.open(talk.now, &mut talk.recorder).map_err(|_| "the link opens").unwrap();
        talk.run(1);
        talk
    }

    fn send(&mut self, job: JobId, message: &[u8]) {
        self.recorder.add_source(job, message.to_vec());
        let size = Some(message.len() as u64);
        let job = Job { id: job, kind: 0, size, fields: Vec::new(), check: false };
        self.line
            .link
            .begin_job(self.now, job, &mut self.recorder)
            .map_err(|_| "it begins")
            .unwrap();
        self.run(0);
    }

    fn say(&mut self, bytes: &[u8]) {
        self.hears(bytes);
        self.run(0);
    }

    fn hears(&mut self, bytes: &[u8]) {
        self.line
            .link
            .received(self.now, bytes, &mut self.recorder)
            .map_err(|_| "it hears")
            .unwrap();
    }

    /// Lets so many ms go by.
    fn run(&mut self, millis: i64) {
        let end = self.now + Micros::from_millis(millis);
        loop {
            self.line.transmit(self.now, &mut self.recorder).map_err(|_| "it goes on").unwrap();
            let sent = self.recorder.sent();
            let said = self.partner.hear(&sent[self.sent..]);
            self.sent = sent.len();
            self.said.push((self.now + DELAY, said));
            let due = self.said.partition_point(|(at, _)| *at <= self.now);
            let due: Vec<u8> = self.said.drain(..due).flat_map(|(_, said)| said).collect();
            if !due.is_empty() {
                self.hears(&due);
            }
            if self.now >= end {
                return;
            }
            let next = self.now + Micros::from_millis(1);
            self.line.run_until(next, &mut self.recorder).map_err(|_| "it goes on").unwrap();
            self.now = next;
        }
    }

    fn ends(&self) -> Vec<Option<Failure>> {
        let end = |seen: &Observed| match seen {
            Observed::Done { .. } => Some(None),
            Observed::Failed { failure, .. } => Some(Some(*failure)),
            _ => None,
        };
        self.recorder.observed.iter().filter_map(|(_, seen)| end(seen)).collect()
    }

    fn delivered(&self) -> Vec<Vec<u8>> {
        self.recorder.deliveries().iter().map(|delivery| delivery.bytes.clone()).collect()
    }
}

/// The module, as cargo builds it.
fn module() -> Arc<Module<Vec<u8>>> {
    static MODULE: OnceLock<Arc<Module<Vec<u8>>>> = OnceLock::new();
    let build = || {
        let built = Command::new(env!("CARGO"))
            .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("../.."))
            .args(["build", "--quiet", "-p", "softplug-plugin", "--example", "df1"])
            .args(["--profile", "plugin", "--target", "wasm32v1-none", "--message-format", "json"])
            .output()
            .expect("cargo runs these tests, so it can be started");
        let messages = String::from_utf8_lossy(&built.stdout);
        assert!(built.status.success(), "{}{messages}", String::from_utf8_lossy(&built.stderr));
        let place = messages.split('"').find(|word| word.ends_with("df1.wasm"));
        let module =
            std::fs::read(place.expect("cargo names what it built")).expect("it was built");
        assert!(module.len() <= 40 * 1024, "{} bytes", module.len());
        Arc::new(Module::load(module).expect("it is a module"))
    };
    Arc::clone(MODULE.get_or_init(build))
}

/// Natively, and as a module.
fn both(settings: &[(&str, &str)], play: impl Fn(&mut dyn Play)) {
    play(&mut Talk::new(Native::<Df1>::new(), settings));
    let session = Session::start(module(), Room::default()).expect("it starts");
    play(&mut Talk::new(session, settings));
}

/// What a test does with a talk of either kind.
trait Play {
    fn send(&mut self, job: JobId, message: &[u8]);
    fn say(&mut self, bytes: &[u8]);
    fn run(&mut self, millis: i64);
    fn partner(&mut self) -> &mut Partner;
    fn ends(&self) -> Vec<Option<Failure>>;
    fn delivered(&self) -> Vec<Vec<u8>>;
}

impl<I: Instance> Play for Talk<I> {
    fn send(&mut self, job: JobId, message: &[u8]) {
        self.send(job, message);
    }
    fn say(&mut self, bytes: &[u8]) {
        self.say(bytes);
    }
    fn run(&mut self, millis: i64) {
        self.run(millis);
    }
    fn partner(&mut self) -> &mut Partner {
        &mut self.partner
    }
    fn ends(&self) -> Vec<Option<Failure>> {
        self.ends()
    }
    fn delivered(&self) -> Vec<Vec<u8>> {
        self.delivered()
    }
}

/// A message with every byte that a frame could stumble over.
fn message(number: u8) -> Vec<u8> {
    [&[1, 0, 0x0F, 0, number, 0x10], [0x10, 0x03, 0x10, 0x10, 0x02, 0x06].repeat(20).as_slice()]
        .concat()
}

#[test]
fn the_frame_of_the_publication() {
    // The example of a BCC there.
    let partner = Partner::default();
    assert_eq!(partner.check(&[0x08, 0x09, 0x06, 0x00, 0x02, 0x04, 0x03]), [0xE0]);
    both(&[], |talk| {
        talk.send(JobId(1), &[0x08, 0x09, 0x06, 0x00, 0x02, 0x04, 0x03]);
        talk.run(100);
        let sent = [0x10, 0x02, 0x08, 0x09, 0x06, 0x00, 0x02, 0x04, 0x03, 0x10, 0x03, 0xE0];
        assert_eq!(talk.partner().heard, sent);
        assert_eq!(talk.ends(), [None]);
    });
}

#[test]
fn messages_go_and_come() {
    for check in ["bcc", "crc"] {
        both(&[("check", check)], |talk| {
            for number in 1..=3 {
                talk.send(JobId(u32::from(number)), &message(number));
                let frame = talk.partner().frame(&message(number));
                talk.say(&frame);
                talk.run(300);
            }
            let all: Vec<_> = (1..=3).map(message).collect();
            assert_eq!(talk.ends(), [None; 3]);
            assert_eq!(talk.delivered(), all);
            assert_eq!(talk.partner().messages, all);
            assert_eq!(talk.partner().symbols, [0x06; 3]);
        });
    }
}

#[test]
fn what_is_refused_goes_again_and_what_is_not_answered_is_asked_for() {
    use Answer::{Ack, Lost, Nak, Silence};
    let failed = Failure::AttemptsUsedUp;
    let cases: [(&[Answer], usize, usize, Option<Failure>); 6] = [
        (&[Nak, Ack], 2, 0, None),
        (&[Nak, Nak, Nak, Ack], 4, 0, None),
        (&[Nak, Nak, Nak, Nak], 4, 0, Some(failed)),
        (&[Lost], 1, 1, None),
        (&[Nak, Lost], 2, 1, None),
        (&[Silence], 1, 3, Some(Failure::NoAnswer)),
    ];
    for (answers, frames, enquiries, end) in cases {
        both(&[("ack_time", "100")], |talk| {
            talk.partner().answers = answers.to_vec();
            talk.send(JobId(1), &message(1));
            talk.run(2_000);
            assert_eq!(talk.partner().messages.len(), frames, "{answers:?}");
            assert_eq!(talk.partner().symbols, vec![0x05; enquiries], "{answers:?}");
            assert_eq!(talk.ends(), [end], "{answers:?}");
        });
    }
}

#[test]
fn a_partner_that_asks_gets_the_last_answer() {
    both(&[], |talk| {
        let good = talk.partner().frame(&message(1));
        let mut bad = talk.partner().frame(&message(2));
        bad[5] ^= 1;
        // Before anything has come it is NAK; so it is after something that was no message.
        for heard in [&ENQ[..], &good, &ENQ, &good, &bad, &ENQ, &good, b"x", &ENQ] {
            talk.say(heard);
            talk.run(20);
        }
        let answers = [0x0F, 0x06, 0x06, 0x06, 0x0F, 0x0F, 0x06, 0x0F];
        assert_eq!(talk.partner().symbols, answers);
        // What came again was not delivered again.
        assert_eq!(talk.delivered(), [message(1)]);
    });
}

#[test]
fn jobs_that_are_no_message_fail() {
    for (length, end) in [
        (5, Some(Failure::BadJob)),
        (6, None),
        (250, None),
        (251, Some(Failure::TooLong)),
        (9_000, Some(Failure::TooLong)),
    ] {
        both(&[], |talk| {
            talk.send(JobId(1), &vec![DLE; length]);
            talk.run(400);
            assert_eq!(talk.ends(), [end], "{length}");
        });
    }
}

proptest! {
    #[test]
    fn both_sides_speak_at_once(
        ours in proptest::collection::vec(6..250_usize, 1..4),
        theirs in proptest::collection::vec((6..120_usize, 0..200_i64), 0..8),
        dle in any::<bool>(),
    ) {
        let byte = |at: usize| if dle { DLE } else { (at * 7) as u8 };
        let text = |number: usize, length: usize| {
            let mut text: Vec<u8> = (0..length).map(byte).collect();
            text[5] = number as u8;
            text
        };
        let mut talk = Talk::new(Native::<Df1>::new(), &[]);
        let mut waiting = ours.iter().enumerate();
        for (number, (length, pause)) in theirs.iter().enumerate() {
            if number % 2 == 0
                && talk.ends().len() == ours.len() - waiting.len()
                && let Some((own, length)) = waiting.next()
            {
                talk.send(JobId(own as u32 + 1), &text(own, *length));
            }
            talk.run(*pause);
            let frame = talk.partner.frame(&text(number, *length));
            talk.say(&frame);
        }
        for (own, length) in waiting {
            talk.run(500);
            talk.send(JobId(own as u32 + 1), &text(own, *length));
        }
        talk.run(500);
        prop_assert_eq!(talk.ends(), vec![None; ours.len()]);
        prop_assert_eq!(talk.partner.messages.len(), ours.len());
        prop_assert_eq!(talk.delivered().len(), theirs.len());
        prop_assert_eq!(&talk.partner.symbols, &vec![0x06; theirs.len()]);
    }

    #[test]
    fn no_noise_brings_it_down(noise in proptest::collection::vec(any::<u8>(), 0..2_000), is_dle in any::<bool>()) {
        let mut talk = Talk::new(Native::<Df1>::new(), &[]);
        let noise: Vec<u8> = noise
            .iter()
            .flat_map(|byte| if is_dle { vec![DLE, byte % 0x11] } else { vec![*byte] })
            .collect();
        for piece in noise.chunks(700) {
            talk.line.link.received(talk.now, piece, &mut talk.recorder).map_err(|_| "it hears").unwrap();
        }
        talk.line.run_until(Micros::from_secs(2), &mut talk.recorder).map_err(|_| "it goes on").unwrap();
        // It hears a message behind it. Whatever was under way, a DLE stands before DLE STX at most.
        talk.now = Micros::from_secs(2);
        let frame = talk.partner.frame(&message(9));
        talk.sent = talk.recorder.sent().len();
        talk.line.link.received(talk.now, &frame, &mut talk.recorder).map_err(|_| "it hears").unwrap();
        talk.line.link.received(talk.now, &frame, &mut talk.recorder).map_err(|_| "it hears").unwrap();
        prop_assert!(talk.delivered().contains(&message(9)));
    }
}
