//! XMODEM: files to and from a control, over a line that damages blocks and loses answers.

use super::case::Script;
use super::failure::Outcome;
use super::play::{End, Play};
use super::setup::Setup;
use super::xon_xoff::program;
use softplug_abi::{LineParameters, Micros};
use softplug_machines::xmodem::{Control, Options};

const DAY: Micros = Micros::from_secs(86_400);

pub(super) fn scripts() -> Vec<Script> {
    vec![
        sends("checksum", &[], false),
        sends("crc", &[("mode", "crc")], true),
        sends("long", &[("mode", "1k")], true),
        receives("checksum", &[("mode", "checksum")], false),
        receives("crc", &[], false),
        receives("long", &[], true),
        late(),
        slow_host(),
    ]
}

/// A line on which a control has trouble with some blocks, and with some answers.
fn bad_line(options: Options) -> Options {
    let line = LineParameters::new(19_200);
    Options { line, damaged: vec![1, 5, 6, 9], lost: vec![2, 8], ..options }
}

fn sends(slug: &str, settings: &'static [(&'static str, &'static str)], is_crc: bool) -> Script {
    let title = format!("A control takes a file over a bad line ({slug})");
    let clauses = ["xmodem.tx.on-call", "xmodem.tx.repeat", "xmodem.tx.end"];
    let id = format!("xmodem.loop.send-{slug}");
    Script::new("xmodem", id, title, &clauses, move |context| {
        let begins = Micros::from_secs(1);
        let options = bad_line(Options { is_crc, begins, ..Options::default() });
        let setup = Setup::new(options.line, &[&[("call", "off")], settings].concat());
        context.play(&setup, Control::new(options), |play| is_sent(play, &program(9_000)))
    })
}

/// As from a slow disk or over a network.
fn late() -> Script {
    let title = "A file whose data comes late, in pieces, arrives as it is";
    let clauses = ["xmodem.tx.on-call", "xmodem.tx.end"];
    Script::new("xmodem", "xmodem.loop.late", title, &clauses, |context| {
        let options = Options { begins: Micros::from_secs(1), ..Options::default() };
        let setup = Setup::new(options.line, &[("call", "off")]);
        context.play(&setup, Control::new(options), |play| {
            let program = program(3_000);
            let job = play.late_job("send", &[], &program)?;
            let end = play.end_of_late(job, 37, Micros::from_millis(40))?;
            is_whole(play, &program, end)
        })
    })
}

fn is_sent(play: &mut Play<'_, Control>, program: &[u8]) -> Outcome {
    let job = play.send(program)?;
    let end = play.end_of(job, DAY)?;
    is_whole(play, program, end)
}

fn is_whole(play: &mut Play<'_, Control>, program: &[u8], end: End) -> Outcome {
    play.demand("the job is done", end.is_ok(), end)?;
    let report = play.partner().report().clone();
    play.demand("the control has a whole file", report.is_done, report.blocks)?;
    let (came, padding) = report.came.split_at(program.len().min(report.came.len()));
    play.same_bytes("the file", program, came)?;
    let is_padding = padding.len() < 1_024 && padding.iter().all(|byte| *byte == 0x1A);
    play.demand("behind it is padding", is_padding, padding.len())
}

fn receives(
    slug: &str,
    settings: &'static [(&'static str, &'static str)],
    is_long: bool,
) -> Script {
    let title = format!("A control sends a file over a bad line ({slug})");
    let clauses = ["xmodem.rx.call", "xmodem.rx.bad-block", "xmodem.rx.end", "xmodem.rx.padding"];
    let id = format!("xmodem.loop.receive-{slug}");
    Script::new("xmodem", id, title, &clauses, move |context| {
        let file = Some(program(9_000));
        let options = bad_line(Options { file, is_long, ..Options::default() });
        let setup = Setup::new(options.line, settings);
        context.play(&setup, Control::new(options), |play| {
            play.run(Micros::from_secs(200))?;
            is_delivered(play)
        })
    })
}

fn is_delivered(play: &mut Play<'_, Control>) -> Outcome {
    let is_done = play.partner().report().is_done;
    play.demand("the control has sent all of it", is_done, is_done)?;
    let ends: Vec<_> = play.deliveries().into_iter().map(|(_, one)| one).collect();
    let failures: Vec<_> = ends.iter().map(|one| one.failure).collect();
    play.equal("failures of deliveries", vec![None], failures)?;
    play.same_bytes("what was delivered", &program(9_000), &ends[0].bytes)
}

/// The host puts 100 bytes away five times a second, of a file that comes at 960.
fn slow_host() -> Script {
    let title = "A file to a slow host: the control waits for its answers, all is delivered";
    let clauses = ["xmodem.rx.room", "xmodem.rx.block"];
    Script::new("xmodem", "xmodem.loop.slow-host", title, &clauses, |context| {
        let options = Options { file: Some(program(9_000)), ..Options::default() };
        let setup = Setup { delivery_room: 512, ..Setup::new(options.line, &[]) };
        context.play(&setup, Control::new(options), |play| {
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
