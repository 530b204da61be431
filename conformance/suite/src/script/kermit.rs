//! Kermit: files to and from a machine, over a line that damages packets and loses answers.

use super::case::Script;
use super::failure::Outcome;
use super::play::Play;
use super::setup::Setup;
use super::xon_xoff::program;
use softplug_abi::{Failure, LineParameters, Micros};
use softplug_machines::kermit::{Machine, Options};

const DAY: Micros = Micros::from_secs(86_400);

pub(super) fn scripts() -> Vec<Script> {
    vec![
        sends("check-1", &[("check", "1")], || Options { check: 1, repeat: None, ..bad_line() }),
        sends("check-2", &[("check", "2")], || Options { check: 2, ..bad_line() }),
        sends("eighth", &[("eighth_bit", "prefix")], || Options {
            eighth: Some(b'&'),
            ..bad_line()
        }),
        sends("long", &[], || Options { long: Some(1_000), ..bad_line() }),
        receives("check-1", || Options { check: 1, repeat: None, ..bad_line() }),
        receives("check-2", || Options { check: 2, ..bad_line() }),
        receives("eighth", || Options { eighth: Some(b'&'), ..bad_line() }),
        receives("long", || Options { long: Some(1_000), ..bad_line() }),
        late(),
        interrupted(),
        slow_host(),
    ]
}

/// A line on which a machine has trouble with some packets, and with some answers.
fn bad_line() -> Options {
    let line = LineParameters::new(19_200);
    Options { line, damaged: vec![3, 5, 8, 9], lost: vec![2, 7], ..Options::default() }
}

/// A program, and every byte.
fn file() -> Vec<u8> {
    [program(6_000), (0..=255).collect(), vec![0; 300]].concat()
}

fn sends(
    slug: &str,
    settings: &'static [(&'static str, &'static str)],
    options: fn() -> Options,
) -> Script {
    let title = format!("A machine takes a file over a bad line ({slug})");
    let clauses = ["kermit.tx.begin", "kermit.tx.repeat", "kermit.tx.confirmed"];
    let id = format!("kermit.loop.send-{slug}");
    Script::new("kermit", id, title, &clauses, move |context| {
        let options = options();
        let setup = Setup::new(options.line, settings);
        context.play(&setup, Machine::new(options), |play| {
            let job = play.send(&file())?;
            let end = play.end_of(job, DAY)?;
            play.demand("the job is done", end.is_ok(), end)?;
            let report = play.partner().report().clone();
            play.demand("the machine has a whole file", report.is_done && report.is_kept, &report)?;
            play.equal("its name", "PROGRAM".to_owned(), report.name)?;
            play.same_bytes("the file", &file(), &report.came)
        })
    })
}

fn receives(slug: &str, options: fn() -> Options) -> Script {
    let title = format!("A machine sends a file over a bad line ({slug})");
    let clauses = ["kermit.rx.begin", "kermit.rx.bad", "kermit.rx.again", "kermit.rx.file"];
    let id = format!("kermit.loop.receive-{slug}");
    Script::new("kermit", id, title, &clauses, move |context| {
        let options = Options { file: Some(("NC/O1.NC".to_owned(), file())), ..options() };
        let setup = Setup::new(options.line, &[]);
        context.play(&setup, Machine::new(options), |play| {
            play.run(Micros::from_secs(300))?;
            is_delivered(play)
        })
    })
}

fn is_delivered(play: &mut Play<'_, Machine>) -> Outcome {
    let report = play.partner().report().clone();
    play.demand("the machine has sent all of it", report.is_done, report)?;
    let ends: Vec<_> = play.deliveries().into_iter().map(|(_, one)| one).collect();
    let failures: Vec<_> = ends.iter().map(|one| one.failure).collect();
    play.equal("failures of deliveries", vec![None], failures)?;
    play.equal("the name", Some("O1.NC".to_owned()), ends[0].name.clone())?;
    play.same_bytes("what was delivered", &file(), &ends[0].bytes)
}

/// As from a slow disk or over a network.
fn late() -> Script {
    let title = "A file whose data comes late, in pieces, arrives as it is";
    let clauses = ["kermit.tx.begin", "kermit.tx.confirmed"];
    Script::new("kermit", "kermit.loop.late", title, &clauses, |context| {
        let setup = Setup::new(Options::default().line, &[]);
        context.play(&setup, Machine::new(Options::default()), |play| {
            let job = play.late_job("send", &[], &file())?;
            let end = play.end_of_late(job, 37, Micros::from_millis(40))?;
            play.demand("the job is done", end.is_ok(), end)?;
            let report = play.partner().report().clone();
            play.demand("the machine has a whole file", report.is_done && report.is_kept, &report)?;
            play.same_bytes("the file", &file(), &report.came)
        })
    })
}

/// The machine wants no more of the file behind its second packet of data.
fn interrupted() -> Script {
    let title = "A machine wants no more of a file: it is told to discard it, and the job fails";
    let clauses = ["kermit.tx.interrupted"];
    Script::new("kermit", "kermit.loop.interrupted", title, &clauses, |context| {
        let options = Options { interrupts: Some(2), ..Options::default() };
        let setup = Setup::new(options.line, &[]);
        context.play(&setup, Machine::new(options), |play| {
            let job = play.send(&file())?;
            let end = play.end_of(job, DAY)?;
            play.demand("the job is refused", end == Err((Failure::Refused, 0)), end)?;
            let report = play.partner().report().clone();
            play.demand("it is discarded", report.is_done && !report.is_kept, report)
        })
    })
}

/// The host puts 100 bytes away five times a second, of a file that comes at 960.
fn slow_host() -> Script {
    let title = "A file to a slow host: the machine waits for its answers, all is delivered";
    let clauses = ["kermit.rx.room", "kermit.rx.file"];
    Script::new("kermit", "kermit.loop.slow-host", title, &clauses, |context| {
        let file = Some(("O1.NC".to_owned(), file()));
        let options = Options { file, long: Some(900), ..Options::default() };
        let setup = Setup { delivery_room: 512, ..Setup::new(options.line, &[]) };
        context.play(&setup, Machine::new(options), |play| {
            play.host.drain_by_hand = true;
            for _ in 0..1_000 {
                play.run(Micros::from_millis(200))?;
                play.host.drain(100);
                play.settle()?;
            }
            is_delivered(play)
        })
    })
}
