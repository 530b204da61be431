//! Two plug-ins on one line, good or bad: what is told as done has come, once and whole.

use kermit::Kermit;
use softplug_plugin::Failure;
use softplug_plugin::bench::{Bench, BenchOptions, Observed};

/// Makes the same faults for the same seed.
struct Chance(u64);

impl Chance {
    fn below(&mut self, most: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
        (self.0 >> 33) % most
    }
}

/// What came, and how its delivery ended.
type Came = (Vec<u8>, Option<Failure>);

/// One end, and how much of what it sent has been passed on.
struct End {
    bench: Bench<Kermit>,
    passed: usize,
}

impl End {
    fn new(options: BenchOptions<Kermit>) -> Self {
        Self { bench: options.open(), passed: 0 }
    }

    fn says(&mut self) -> Vec<u8> {
        let sent = self.bench.sent();
        let new = sent[self.passed..].to_vec();
        self.passed = sent.len();
        new
    }

    fn job_end(&self) -> Option<Result<(), Failure>> {
        self.bench.observed().iter().rev().find_map(|(_, observed)| match observed {
            Observed::Done { .. } => Some(Ok(())),
            Observed::Failed { failure, .. } => Some(Err(*failure)),
            _ => None,
        })
    }
}

/// Flips, drops and doubles a byte in so many, by chance; 0 is none.
fn spoilt(bytes: &[u8], one_in: u64, chance: &mut Chance) -> Vec<u8> {
    let mut spoilt = Vec::new();
    for byte in bytes {
        let kind = if one_in > 0 && chance.below(one_in) == 0 { chance.below(3) } else { 3 };
        match kind {
            0 => spoilt.push(byte ^ 1 << chance.below(8)),
            1 => {}
            2 => spoilt.extend([*byte, *byte]),
            _ => spoilt.push(*byte),
        }
    }
    spoilt
}

/// Sends the data from one to the other until the job has ended. How it ended, and what came.
fn meet(
    sender: BenchOptions<Kermit>,
    receiver: BenchOptions<Kermit>,
    data: &[u8],
    one_in: u64,
    seed: u64,
) -> (Result<(), Failure>, Vec<Came>) {
    let mut chance = Chance(seed);
    let (mut sender, mut receiver) = (End::new(sender), End::new(receiver));
    sender.bench.send(data);
    let mut rest = 0;
    for _ in 0..400_000 {
        sender.bench.run_for_millis(10);
        let there = spoilt(&sender.says(), one_in, &mut chance);
        if !there.is_empty() {
            receiver.bench.receive(&there);
        }
        receiver.bench.run_for_millis(10);
        let back = spoilt(&receiver.says(), one_in, &mut chance);
        if !back.is_empty() {
            sender.bench.receive(&back);
        }
        if one_in > 0 && chance.below(50) == 0 {
            sender.bench.swap();
            receiver.bench.swap();
        }
        // What follows the end of the job may still come.
        rest += u32::from(sender.job_end().is_some());
        if rest > 4_000 {
            break;
        }
    }
    let ends = receiver.bench.deliveries();
    let came = ends.iter().map(|one| (one.bytes.clone(), one.failure)).collect();
    (sender.job_end().expect("the job ends"), came)
}

fn data(length: usize) -> Vec<u8> {
    let mut chance = Chance(5);
    let mut data: Vec<u8> = (0..length).map(|_| chance.below(256) as u8).collect();
    data.extend([0; 300]);
    data.extend(b"\r\n%\n");
    data
}

const FORMS: [&[(&str, &str)]; 5] = [
    &[],
    &[("check", "2"), ("eighth_bit", "prefix")],
    &[("packet_length", "94")],
    &[("packet_length", "20"), ("repeat_prefix", "off")],
    &[("packet_length", "300"), ("eighth_bit", "prefix"), ("repeat_prefix", "off")],
];

#[test]
fn a_file_passes_in_all_forms() {
    for own in FORMS {
        for other in FORMS {
            let (sender, receiver) = (Bench::new().set_all(own), Bench::new().set_all(other));
            let data = data(3_000);
            let (end, came) = meet(sender, receiver, &data, 0, 1);
            assert_eq!(end, Ok(()), "{own:?} {other:?}");
            assert!(came == [(data, None)], "{own:?} {other:?}");
        }
    }
}

#[test]
fn what_is_done_has_come_whole_and_once_over_a_bad_line() {
    let times: &[(&str, &str)] =
        &[("answer_time", "3000"), ("packet_time", "4000"), ("character_time", "200")];
    let data = data(2_000);
    let mut done = 0;
    for seed in 0..40 {
        let one_in = [3_000, 1_000, 300, 100][seed as usize % 4];
        let options = || Bench::new().set_all(times).set_all(&[("packet_length", "200")]);
        let (end, came) = meet(options(), options(), &data, one_in, seed);
        let whole: Vec<_> = came.iter().filter(|(_, failure)| failure.is_none()).collect();
        assert!(whole.len() <= 1, "seed {seed}: {} files are complete", whole.len());
        assert!(whole.iter().all(|(bytes, _)| *bytes == data), "seed {seed}: other bytes came");
        if end.is_ok() {
            assert_eq!(whole.len(), 1, "seed {seed}: done, and nothing came");
            done += 1;
        }
    }
    assert!(done > 25, "only {done} of 40 were done");
}

#[test]
fn a_text_keeps_its_lines() {
    let text = Bench::new().set("mode", "text");
    let lines = b"%\nO1\r\nM30\n\n\r%\n\r";
    let (end, came) = meet(text, Bench::new(), lines, 0, 1);
    assert_eq!(end, Ok(()));
    assert_eq!(came[0].0, b"%\r\nO1\r\nM30\r\n\r\n\r%\r\n\r");
    let both = || Bench::new().set("mode", "text");
    let (_, came) = meet(both(), both(), lines, 0, 1);
    assert_eq!(came[0].0, b"%\nO1\nM30\n\n\r%\n\r");
}
