//! Drip feeds: a program longer than any memory, executed while it comes.

use crate::common::fanuc::resolve;
use sha2::{Digest, Sha256};
use softplug_abi::{Action, Failure, JobId, Micros};
use softplug_link::{Job, LinkHost, LinkOptions, Supply, WireHost};
use softplug_machines::fanuc::{
    Control, FeedHold, Feeding, Options, Press, Report, seven_even_two,
};
use softplug_machines::kept::{Keep, Received};
use softplug_native::NativePlugin;
use softplug_trial::ClosedLoop;
use std::fmt::Write;
use std::time::Instant;

/// Computes a program block by block while it is fed, and keeps its digest.
struct Host {
    blocks: u64,
    next: u64,
    /// The block that is being supplied, and how much of it was.
    block: String,
    at: usize,
    supplied: u64,
    digest: Sha256,
    end: Option<Result<u64, Failure>>,
}

impl Host {
    fn new(blocks: u64) -> Self {
        let mut host = Self {
            blocks,
            next: 0,
            block: String::new(),
            at: 0,
            supplied: 0,
            digest: Sha256::new(),
            end: None,
        };
        host.rewind(JobId::NONE);
        host
    }

    /// Moves over a surface: blocks of 12 to 40 characters.
    fn compute_block(&mut self) -> bool {
        self.block.clear();
        self.at = 0;
        let n = self.next;
        self.next += 1;
        if n >= self.blocks {
            let is_last = n == self.blocks;
            self.block.push_str(if is_last { "M30\n%" } else { "" });
            return is_last;
        }
        let (x, y, z) = (n % 1_000, n / 7 % 1_000, n * n % 9_973);
        let block = &mut self.block;
        match n % 4 {
            0 => writeln!(block, "N{} G1 X{x}.{y:03} Y-{y}.{x:03} Z{}.{z:04}", n % 100_000, n % 9),
            1 => writeln!(block, "X{x}.{y:03} Z-{z}."),
            2 => writeln!(block, "X{x}.{z:04} Y{y}.5 (PASS {})", n % 77),
            _ => writeln!(block, "Y-{y}.{x:03} F{}", 100 + n % 900),
        }
        .expect("a string takes all");
        true
    }

    /// The digest of all behind the first line, as a control keeps it.
    fn received(&self) -> Received {
        Received::Digest { count: self.supplied, sha256: self.digest.clone().finalize().into() }
    }
}

impl LinkHost for Host {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::JobDone { sent, .. } => self.end = Some(Ok(*sent)),
            Action::JobFailed { failure, .. }
            | Action::CheckResult { failure: Some(failure), .. } => {
                self.end = Some(Err(*failure));
            }
            _ => {}
        }
    }

    fn supply(&mut self, _job: JobId, buffer: &mut [u8]) -> Supply {
        let mut count = 0;
        while count < buffer.len() {
            if self.at == self.block.len() && !self.compute_block() {
                break;
            }
            let piece = (self.block.len() - self.at).min(buffer.len() - count);
            let bytes = &self.block.as_bytes()[self.at..self.at + piece];
            buffer[count..count + piece].copy_from_slice(bytes);
            self.at += piece;
            count += piece;
        }
        if count == 0 {
            return Supply::End;
        }
        // The label, "%" and its end of block, is the first piece of all.
        let skipped = if self.supplied == 0 { LABEL.len() } else { 0 };
        self.digest.update(&buffer[skipped..count]);
        self.supplied += (count - skipped) as u64;
        Supply::Bytes(count)
    }

    fn rewind(&mut self, _job: JobId) {
        self.next = 0;
        LABEL.clone_into(&mut self.block);
        self.at = 0;
        self.supplied = 0;
        self.digest = Sha256::new();
    }
}

impl WireHost for Host {}

const LABEL: &str = "%\n";

struct Feed {
    report: Report,
    host: Host,
    /// Time on the line at the job's end.
    end: Micros,
}

fn feed(blocks: u64, control: Options, depth: usize, reaction: Micros) -> Feed {
    let options =
        LinkOptions { line: control.line, settings: resolve(&[]), ..LinkOptions::default() };
    let control = Control::new(control).unwrap();
    let instance = NativePlugin::FanucRs232.instantiate();
    let mut line = ClosedLoop::new(instance, options, depth, control);
    line.reaction = reaction;
    let mut host = Host::new(blocks);
    line.line.link.open(Micros::ZERO, &mut host).unwrap();
    let job = Job { id: JobId(1), kind: 0, size: None, fields: Vec::new(), check: true };
    line.line.link.begin_job(Micros::ZERO, job, &mut host).unwrap();
    line.settle(&mut host).unwrap();
    line.partner.press(Micros::ZERO, Press::Read);
    line.run_until(Micros::from_secs(7 * 86_400), &mut host, |host| host.end.is_some()).unwrap();
    let end = line.now();
    // What is still in the control's buffer is executed.
    line.partner.advance(end + Micros::from_secs(4 * 3_600));
    Feed { report: line.partner.report(), host, end }
}

fn assert_fed(feed: &Feed, what: &str) {
    let Feed { report, host, .. } = feed;
    assert!(matches!(host.end, Some(Ok(_))), "{what}: {:?}", host.end);
    assert_eq!(report.alarms, [], "{what}");
    assert_eq!((report.starved, report.starved_for), (0, Micros::ZERO), "{what}");
    assert_eq!(report.received, host.received(), "{what}");
    assert_eq!((report.programs, report.blocks), (1, host.blocks + 1), "{what}");
    let most = report.characters_after_dc3.max();
    assert!(most <= 10, "{what}: {most} characters after DC3");
}

#[test]
fn ten_hours_of_drip_feed_at_19_200_baud() {
    const BLOCKS: u64 = 1_100_000;
    let hold = |(share, minutes): (u64, i64)| FeedHold {
        after: BLOCKS * share / 100,
        span: Micros::from_secs(minutes * 60),
    };
    let control = Options {
        line: seven_even_two(19_200),
        buffer: 2_048,
        reserve: 64,
        resume: 320,
        // The mean block has 24 characters: 82 percent of what the line carries.
        block_time: Micros(16_500),
        feeding: Feeding::Drip {
            cycle_start: 1_500,
            feed_holds: [(10, 120), (35, 30), (50, 90), (80, 60), (99, 1)].map(hold).into(),
        },
        keep: Keep::Digest,
        ..Options::default()
    };
    let started = Instant::now();
    let fed = feed(BLOCKS, control, 1, Micros::ZERO);
    let wall = started.elapsed().as_secs_f64();
    let (report, hours) = (&fed.report, fed.end.as_secs_f64() / 3_600.0);
    println!(
        "{} characters in {hours:.2} h, {} holds, {:.2} h held, at most {} after DC3: {wall:.1} s, {:.0} a second",
        report.arrived,
        report.holds,
        report.held.as_secs_f64() / 3_600.0,
        report.characters_after_dc3.max(),
        report.arrived as f64 / wall,
    );
    assert_fed(&fed, "19,200 baud");
    assert!(report.arrived > 20_000_000, "{} characters", report.arrived);
    assert!(fed.end >= Micros::from_secs(36_000), "{hours} h");
    assert!(report.holds > 10_000, "{} holds", report.holds);
}

#[test]
fn at_most_ten_characters_after_dc3_at_every_baud_with_a_host_that_reacts_in_half_a_millisecond() {
    let bauds: [(u32, usize); 10] = [
        (300, 1),
        (600, 1),
        (1_200, 1),
        (2_400, 1),
        (4_800, 1),
        (9_600, 1),
        (19_200, 1),
        (38_400, 2),
        (57_600, 2),
        (115_200, 4),
    ];
    for (baud, depth) in bauds {
        let line = seven_even_two(baud);
        let control = Options {
            line,
            buffer: 512,
            reserve: 32,
            resume: 256,
            // The mean block has 24 characters: 86 percent of the line.
            block_time: Micros(line.characters(22).0 * 5 / 4),
            feeding: Feeding::Drip {
                cycle_start: 400,
                feed_holds: vec![FeedHold { after: 1_000, span: Micros::from_secs(600) }],
            },
            keep: Keep::Digest,
            ..Options::default()
        };
        let fed = feed(5_000, control, depth, Micros(500));
        let report = &fed.report;
        println!(
            "{baud} baud, depth {depth}: {} holds, at most {} after DC3",
            report.holds,
            report.characters_after_dc3.max()
        );
        assert_fed(&fed, &format!("{baud} baud"));
        assert!(report.holds > 50, "{baud} baud: {} holds", report.holds);
    }
}
