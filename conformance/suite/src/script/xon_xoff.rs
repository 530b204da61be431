//! XON/XOFF: a feed against a control that cannot keep up, and a control that sends to a
//! host that cannot.

use super::case::Script;
use super::failure::Outcome;
use super::play::Play;
use super::setup::Setup;
use softplug_abi::{Failure, LineParameters, Micros};
use softplug_machines::Signal;
use softplug_machines::script::{Line, Script as Machine};
use softplug_machines::xon_xoff::{Control, ControlOptions};
use std::fmt::Write as _;

const DAY: Micros = Micros::from_secs(86_400);

/// What a feed goes over.
#[derive(Copy, Clone)]
struct Feed {
    slug: &'static str,
    baud: u32,
    /// Characters that the port holds.
    depth: usize,
    /// From the end of XOFF until the plug-in is told, in characters.
    reaction: u64,
    bytes: usize,
}

const FEEDS: [Feed; 4] = [
    Feed { slug: "slow-line", baud: 300, depth: 1, reaction: 0, bytes: 1_200 },
    Feed { slug: "depth-1", baud: 9_600, depth: 1, reaction: 0, bytes: 2_000 },
    Feed { slug: "late-reaction", baud: 9_600, depth: 1, reaction: 3, bytes: 2_000 },
    Feed { slug: "deep-port", baud: 115_200, depth: 16, reaction: 4, bytes: 4_000 },
];

pub(super) fn scripts() -> Vec<Script> {
    let mut all: Vec<Script> = FEEDS.into_iter().map(feed).collect();
    all.push(many_jobs());
    all.push(late());
    all.push(late_behind_a_hold());
    all.push(swapped());
    all.push(punch());
    all
}

fn feed(feed: Feed) -> Script {
    let Feed { slug, baud, depth, reaction, bytes } = feed;
    let title = format!(
        "A slow control at {baud} baud, depth {depth}: never more after XOFF, everything arrives"
    );
    let clauses =
        ["xon-xoff.tx.obey-xoff", "xon-xoff.tx.resume-on-xon", "xon-xoff.tx.done-when-left"];
    Script::new("xon-xoff", format!("xon-xoff.loop.feed-{slug}"), title, &clauses, move |context| {
        let line = LineParameters::new(baud);
        let control = ControlOptions {
            line,
            buffer: 256,
            low: 96,
            high: 128,
            rate: baud / 20,
            ..ControlOptions::default()
        };
        let control = Control::new(control).expect("the scenario's control is sound");
        let setup = Setup { depth, reaction: line.characters(reaction), ..Setup::new(line, &[]) };
        let most = depth as u32 + reaction as u32;
        context.play(&setup, control, |play| fed(play, &program(bytes), most))
    })
}

fn fed(play: &mut Play<'_, Control>, program: &[u8], most: u32) -> Outcome {
    let job = play.send(program)?;
    let end = play.end_of(job, DAY)?;
    play.equal("the job's end", Ok(program.len() as u64), end)?;
    play.run(Micros::from_secs(120))?;
    let report = play.partner().report();
    let sent = play.host.sent();
    play.same_bytes("what was sent", program, &sent)?;
    play.demand("the control has all of it", report.received.matches(program), report.arrived)?;
    play.demand("nothing is lost in the control", report.alarms.is_empty(), &report.alarms)?;
    play.demand("the control held the line again and again", report.holds > 5, report.holds)?;
    let after = report.characters_after_xoff.max();
    play.demand(&format!("at most {most} characters after XOFF"), after <= most, after)
}

/// More than 16 bits count.
fn many_jobs() -> Script {
    let title = "65,600 jobs on one open link: each is done";
    let clauses = ["xon-xoff.tx.done-when-left"];
    Script::new("xon-xoff", "xon-xoff.loop.many-jobs", title, &clauses, |context| {
        let options = ControlOptions { line: LineParameters::new(115_200), ..Default::default() };
        let setup = Setup::new(options.line, &[]);
        let control = Control::new(options).expect("the scenario's control is sound");
        context.play(&setup, control, |play| {
            for _ in 0..65_600 {
                let job = play.send(b"G")?;
                let end = play.end_of(job, DAY)?;
                play.equal("the job's end", Ok(1), end)?;
                play.forget();
            }
            Ok(())
        })
    })
}

/// As from a slow disk or over a network.
const PIECE: usize = 30;
const EVERY: Micros = Micros::from_millis(40);

fn late() -> Script {
    let title = "A feed whose data comes late, in pieces: everything arrives";
    let clauses = ["xon-xoff.tx.obey-xoff", "xon-xoff.tx.done-when-left"];
    Script::new("xon-xoff", "xon-xoff.loop.feed-late", title, &clauses, |context| {
        let options =
            ControlOptions { buffer: 256, low: 96, high: 128, rate: 400, ..Default::default() };
        let setup = Setup::new(options.line, &[]);
        let control = Control::new(options).expect("the scenario's control is sound");
        context.play(&setup, control, |play| {
            let program = program(2_000);
            let job = play.late_job("send", &[], &program)?;
            let end = play.end_of_late(job, PIECE, EVERY)?;
            play.equal("the job's end", Ok(program.len() as u64), end)?;
            play.run(Micros::from_secs(120))?;
            let report = play.partner().report();
            let sent = play.host.sent();
            play.same_bytes("what was sent", &program, &sent)?;
            play.demand("the control held the line", report.holds > 2, report.holds)
        })
    })
}

/// The time of a hold ends with its job: it does not fail the next one, which waits for its data just then.
fn late_behind_a_hold() -> Script {
    let title =
        "A hold of an aborted job has nothing to do with the next one, whose data comes late";
    let clauses = ["xon-xoff.tx.held-timeout", "xon-xoff.link.swap"];
    let id = "xon-xoff.loop.late-behind-a-hold";
    Script::new("xon-xoff", id, title, &clauses, |context| {
        // XOFF at once, XON at 8.7 s.
        let (behind, apart) = (0, Micros::ZERO);
        let says =
            |signal, gap| Line { behind, gap, apart, signals: vec![Signal::Character(signal)] };
        let lines = vec![says(0x13, Micros(0)), says(0x11, Micros::from_millis(8_700))];
        let mut machine = Machine::new(b"G1 X1\n".to_vec(), lines);
        machine.begin(Micros::ZERO);
        let setup = Setup::new(LineParameters::new(9_600), &[("held_timeout", "5000")]);
        context.play(&setup, machine, |play| {
            let until = |seconds| Micros::from_secs(seconds);
            play.run_until(until(1))?;
            let first = play.send(b"AB")?;
            play.run_until(until(2))?;
            play.abort(first)?;
            play.equal("the first job's end", Some(Err((Failure::Aborted, 0))), play.ended(first))?;
            play.swap()?;
            let second = play.late_job("send", &[], b"G1 X1\n")?;
            // The first one would have been held for too long at 6 s.
            play.run_until(until(8))?;
            play.equal("the second job's end", None, play.ended(second))?;
            let end = play.end_of_late(second, PIECE, EVERY)?;
            play.equal("the second job's end", Ok(6), end)?;
            let report = play.partner().report().clone();
            play.demand("the machine has it", report.is_over, report)
        })
    })
}

/// A fresh instance takes over ten times a second, also while the line is held.
fn swapped() -> Script {
    let title = "A fed control does not notice that the plug-in is replaced ten times a second";
    let clauses = ["xon-xoff.link.swap", "xon-xoff.tx.obey-xoff"];
    Script::new("xon-xoff", "xon-xoff.loop.feed-swapped", title, &clauses, |context| {
        let options =
            ControlOptions { buffer: 256, low: 96, high: 128, rate: 480, ..Default::default() };
        let setup = Setup::new(options.line, &[]);
        let control = Control::new(options).expect("the scenario's control is sound");
        context.play(&setup, control, |play| {
            let program = program(1_000);
            let job = play.send(&program)?;
            while play.ended(job).is_none() && play.now() < Micros::from_secs(60) {
                play.run(Micros::from_millis(100))?;
                play.swap()?;
            }
            play.equal("the job's end", Some(Ok(program.len() as u64)), play.ended(job))?;
            play.run(Micros::from_secs(1))?;
            let report = play.partner().report();
            let has_all = report.received.matches(&program);
            play.demand("the control has all of it", has_all, report.arrived)?;
            play.demand("the control held the line", report.holds > 2, report.holds)?;
            let after = report.characters_after_xoff.max();
            play.demand("at most 1 character after XOFF", after <= 1, after)
        })
    })
}

/// The host puts 50 bytes away five times a second, of a program that comes at 960.
fn punch() -> Script {
    let title =
        "A program to a slow host: the control is held, nothing overflows, all is delivered";
    let clauses = ["xon-xoff.rx.low-mark", "xon-xoff.rx.high-mark", "xon-xoff.rx.deliver"];
    Script::new("xon-xoff", "xon-xoff.loop.slow-host", title, &clauses, |context| {
        let options = ControlOptions::default();
        let line = options.line;
        let control = Control::new(options).expect("the scenario's control is sound");
        let setup = Setup {
            delivery_room: 512,
            ..Setup::new(line, &[("low_mark", "128"), ("high_mark", "256")])
        };
        context.play(&setup, control, |play| {
            let program = program(2_000);
            play.host.drain_by_hand = true;
            play.partner().punch(Micros::ZERO, program.clone());
            for _ in 0..400 {
                play.run(Micros::from_millis(200))?;
                play.host.drain(50);
                play.settle()?;
            }
            let report = play.partner().report();
            play.equal("bytes that the control has sent", program.len() as u64, report.punched)?;
            let holds = report.punched_after_xoff.0.len();
            play.demand("the control was held again and again", holds > 3, holds)?;
            let ends: Vec<_> = play.deliveries().into_iter().map(|(_, one)| one).collect();
            play.equal(
                "failures of deliveries",
                vec![None; ends.len()],
                ends.iter().map(|one| one.failure).collect(),
            )?;
            let delivered: Vec<u8> = ends.into_iter().flat_map(|one| one.bytes).collect();
            play.same_bytes("what was delivered", &program, &delivered)
        })
    })
}

/// A program of so many bytes, which ends in the middle of a block.
pub(super) fn program(bytes: usize) -> Vec<u8> {
    let mut text = String::new();
    for n in 0.. {
        if text.len() >= bytes {
            break;
        }
        let _ = writeln!(text, "N{n:04} G1 X{}.{:03} Y-{}", n % 90, n * 7 % 1_000, n % 70);
    }
    text.truncate(bytes);
    text.into_bytes()
}
