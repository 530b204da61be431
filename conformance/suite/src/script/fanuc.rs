//! FANUC RS-232: a reader, a drip feed, a punch, a request from the panel and the remote
//! buffer, each with a simulated control.

use super::case::Script;
use super::failure::{Outcome, diverged};
use super::play::Play;
use super::setup::Setup;
use softplug_abi::{Failure, Micros, Value, Values};
use softplug_link::Observed;
use softplug_machines::fanuc::{
    Control, FeedHold, Feeding, Interface, Options, Parity, Press, PunchOptions, RemoteOptions,
    eight_none_two, seven_even_two,
};
use std::fmt::Write as _;

const SECOND: Micros = Micros::from_secs(1);
const HOUR: Micros = Micros::from_secs(3_600);

type Settings = &'static [(&'static str, &'static str)];

pub(super) fn scripts() -> Vec<Script> {
    let mut all = vec![drip_feed(), late(), late_packets(), request(), punch(), slow_host()];
    all.extend([
        late_behind_abort(),
        paused_check("reader-paused-check", &[]),
        paused_check("remote-a-paused-check", REMOTE),
    ]);
    all.extend(readers());
    all.extend(remote_buffers());
    all.extend(broken_punches());
    all
}

fn script(
    slug: &str,
    title: &str,
    clauses: &[&'static str],
    settings: Settings,
    control: Options,
    depth: usize,
    scenario: impl Fn(&mut Play<'_, Control>) -> Outcome + Send + Sync + 'static,
) -> Script {
    let id = format!("fanuc-rs232.loop.{slug}");
    Script::new("fanuc-rs232", id, title, clauses, move |context| {
        let setup = Setup { depth, ..Setup::new(control.line, settings) };
        let control = Control::new(control.clone()).expect("the scenario's control is sound");
        context.play(&setup, control, &scenario)
    })
}

/// A control whose 256 characters fill and drain many times.
fn small(options: Options) -> Options {
    Options {
        buffer: 256,
        reserve: 32,
        resume: 128,
        block_time: Micros::from_millis(60),
        ..options
    }
}

fn readers() -> Vec<Script> {
    let clauses = [
        "fanuc-rs232.feed.wait-dc1",
        "fanuc-rs232.feed.obey-dc3",
        "fanuc-rs232.feed.resume",
        "fanuc-rs232.feed.done-when-left",
    ];
    let software =
        Options { parity: Parity::Software, line: eight_none_two(9_600), ..Options::default() };
    let deep = Options { line: seven_even_two(19_200), ..Options::default() };
    let reader = |slug, title, settings, control, depth: usize| {
        script(slug, title, &clauses, settings, small(control), depth, move |play| {
            read(play, &program(30), depth as u32)
        })
    };
    vec![
        reader(
            "reader",
            "READ: nothing before DC1, nothing lost over many DC3",
            &[],
            deep.clone(),
            1,
        ),
        reader("reader-deep-port", "READ with a port that holds four characters", &[], deep, 4),
        reader(
            "reader-software-parity",
            "READ with parity in software",
            &[("parity", "software")],
            software,
            1,
        ),
    ]
}

fn read(play: &mut Play<'_, Control>, program: &str, depth: u32) -> Outcome {
    let job = play.send(program.as_bytes())?;
    play.run(SECOND)?;
    let early = play.host.sent();
    play.equal("characters before DC1", 0, early.len())?;
    let now = play.now();
    play.partner().press(now, Press::Read);
    let end = play.end_of(job, HOUR)?;
    play.run(SECOND)?;
    let sent = play.host.sent().len() as u64;
    play.equal("the job's end", Ok(sent), end)?;
    arrived(play, program)?;
    let report = play.partner().report();
    let after = report.characters_after_dc3.max();
    play.demand(&format!("at most {depth} characters after DC3"), after <= depth, after)?;
    play.demand("the control held the line again and again", report.holds >= 3, report.holds)
}

/// The control has the whole program, and no alarm.
fn arrived(play: &mut Play<'_, Control>, program: &str) -> Outcome {
    let report = play.partner().report();
    play.demand("the control shows no alarm", report.alarms.is_empty(), &report.alarms)?;
    let text = text_of(program);
    let is_same = report.received.matches(text.as_bytes());
    play.demand("the control has the program as it is", is_same, &report.received)?;
    play.equal("programs that the control has read", 1, report.programs)
}

fn drip_feed() -> Script {
    let clauses = ["fanuc-rs232.feed.obey-dc3", "fanuc-rs232.feed.repeats-harmless"];
    let holds = vec![FeedHold { after: 20, span: Micros::from_secs(20) }];
    let control = small(Options {
        line: seven_even_two(9_600),
        feeding: Feeding::Drip { cycle_start: 128, feed_holds: holds },
        codes_twice: true,
        ..Options::default()
    });
    let title = "Drip feed: the tool never waits for data, a feed hold of 20 s is sat out";
    script("drip-feed", title, &clauses, &[], control, 1, |play| {
        let program = program(60);
        let job = play.send(program.as_bytes())?;
        let now = play.now();
        play.partner().press(now, Press::Read);
        let end = play.end_of(job, HOUR)?;
        play.demand("the job must be done", end.is_ok(), end)?;
        play.run(Micros::from_secs(60))?;
        arrived(play, &program)?;
        let report = play.partner().report();
        play.equal("times that the tool had to wait", 0, report.starved)?;
        play.demand("the feed hold held the line", report.held > Micros::from_secs(15), report.held)
    })
}

/// As from a slow disk or over a network.
const EVERY: Micros = Micros::from_millis(40);

fn late() -> Script {
    let clauses = ["fanuc-rs232.feed.obey-dc3", "fanuc-rs232.feed.done-when-left"];
    let control = small(Options { line: seven_even_two(9_600), ..Options::default() });
    let title = "READ of a program whose data comes late, in pieces: it arrives as it is";
    script("reader-late", title, &clauses, &[], control, 1, |play| {
        let program = program(20);
        let job = play.late_job("send", &[], program.as_bytes())?;
        let now = play.now();
        play.partner().press(now, Press::Read);
        let end = play.end_of_late(job, 31, EVERY)?;
        let sent = play.host.sent().len() as u64;
        play.equal("the job's end", Ok(sent), end)?;
        play.run(SECOND)?;
        arrived(play, &program)
    })
}

/// What timed an earlier job is over when the next one's data come so slowly.
fn late_behind_abort() -> Script {
    let clauses = ["fanuc-rs232.feed.dc1-timeout"];
    let control = small(Options { line: seven_even_two(9_600), ..Options::default() });
    let title = "A job is aborted before its time for DC1 is over: it is not the next one's time";
    let settings = &[("dc1_timeout", "20000")];
    script("reader-late-behind-abort", title, &clauses, settings, control, 1, |play| {
        let aborted = play.send(program(5).as_bytes())?;
        play.run(Micros::from_secs(19))?;
        play.abort(aborted)?;
        let end = play.end_of(aborted, Micros::from_millis(500))?;
        play.demand("the job must fail", end.is_err(), end)?;
        let program = program(60);
        let job = play.late_job("send", &[], program.as_bytes())?;
        let now = play.now();
        play.partner().press(now, Press::Read);
        let end = play.end_of_late(job, 31, Micros::from_millis(100))?;
        play.demand("the job must be done", end.is_ok(), end)?;
        play.run(SECOND)?;
        arrived(play, &program)
    })
}

fn late_packets() -> Script {
    let clauses = ["fanuc-rs232.remote.data", "fanuc-rs232.remote.end"];
    let settings = &[("mode", "remote-a"), ("packet_size", "1024")];
    let title = "Remote buffer A: a program whose data comes late, in pieces: it arrives as it is";
    script(
        "remote-a-late",
        title,
        &clauses,
        settings,
        remote(RemoteOptions::default()),
        1,
        |play| {
            let program = program(100);
            let job = play.late_job("send", &[], program.as_bytes())?;
            play.run(Micros::from_secs(2))?;
            let now = play.now();
            play.partner().press(now, Press::Read);
            let end = play.end_of_late(job, 500, Micros::from_millis(300))?;
            play.demand("the job must be done", end.is_ok(), end)?;
            play.run(SECOND)?;
            arrived(play, &program)
        },
    )
}

const REMOTE: Settings = &[("mode", "remote-a"), ("packet_size", "1024")];

/// A pause ends with its job, also with one that fails in its check.
fn paused_check(slug: &str, settings: Settings) -> Script {
    let clauses = ["fanuc-rs232.feed.pause"];
    let title = "A job is paused while it is checked, and fails: the next one is not paused";
    let control = match settings {
        [] => small(Options { line: seven_even_two(9_600), ..Options::default() }),
        _ => remote(RemoteOptions::default()),
    };
    script(slug, title, &clauses, settings, control, 1, |play| {
        let failing = play.late_job("send", &[], b"%\nO1\nG1 X1\n\x07\n%")?;
        play.pause(failing)?;
        let end = play.end_of_late(failing, 4, EVERY)?;
        play.demand("the job must fail in its check", end.is_err(), end)?;
        let program = program(20);
        let job = play.send(program.as_bytes())?;
        play.run(Micros::from_secs(2))?;
        let now = play.now();
        play.partner().press(now, Press::Read);
        let end = play.end_of(job, Micros::from_secs(3_600))?;
        play.demand("the job must be done", end.is_ok(), end)?;
        play.run(SECOND)?;
        arrived(play, &program)
    })
}

fn punch() -> Script {
    let clauses =
        ["fanuc-rs232.punch.dc2-dc4", "fanuc-rs232.punch.leader", "fanuc-rs232.punch.name"];
    let punch = PunchOptions {
        leader: b"\0\0\0\0\x1B&HE:\0\0".to_vec(),
        trailer: 20,
        ..PunchOptions::default()
    };
    let control = Options { line: seven_even_two(9_600), punch, ..Options::default() };
    let title = "PUNCH: leader and trailer are no part of the program that is delivered";
    script("punch", title, &clauses, &[], control, 1, |play| {
        let program = program(20);
        let now = play.now();
        play.partner().press(now, Press::Punch(between(&program)));
        play.run(Micros::from_secs(60))?;
        captured(play, &program, Some("O1234"))
    })
}

/// One delivery, complete and as it was.
fn captured(play: &mut Play<'_, Control>, program: &str, name: Option<&str>) -> Outcome {
    let deliveries = play.deliveries();
    play.equal("deliveries", 1, deliveries.len())?;
    let delivery = &deliveries[0].1;
    play.equal("the delivery's failure", None, delivery.failure)?;
    play.same_bytes("what was delivered", program.as_bytes(), &delivery.bytes)?;
    play.equal("the delivery's name", name, delivery.name.as_deref())
}

fn slow_host() -> Script {
    let clauses = ["fanuc-rs232.punch.flow"];
    let control = Options { line: seven_even_two(19_200), ..Options::default() };
    let title = "A punch to a slow host is held by DC3 again and again, and nothing is lost";
    script("slow-host", title, &clauses, &[], control, 1, |play| {
        let program = program(260);
        play.host.drain_by_hand = true;
        let now = play.now();
        play.partner().press(now, Press::Punch(between(&program)));
        for _ in 0..300 {
            play.run(Micros::from_millis(250))?;
            play.host.drain(200);
            play.settle()?;
        }
        captured(play, &program, Some("O1234"))?;
        let after = play.partner().report().punched_after_dc3;
        play.demand("the punch was held", !after.0.is_empty(), &after)?;
        play.demand("and stopped within ten characters", after.max() <= 10, &after)
    })
}

fn broken_punches() -> Vec<Script> {
    let spoiled = |slug, title, clause, press: Press, failure: Failure| {
        let control =
            Options { line: seven_even_two(9_600), tell_reset: true, ..Options::default() };
        script(slug, title, &[clause], &[], control, 1, move |play| {
            let program = program(20);
            let now = play.now();
            play.partner().press(now, Press::Punch(between(&program)));
            play.run(Micros::from_millis(500))?;
            let now = play.now();
            play.partner().press(now, press.clone());
            play.run(Micros::from_secs(60))?;
            let deliveries = play.deliveries();
            play.equal("deliveries", 1, deliveries.len())?;
            let delivery = &deliveries[0].1;
            play.equal("the delivery's failure", Some(failure), delivery.failure)?;
            let kept = delivery.bytes.trim_ascii_end();
            play.demand("what came is kept", kept.len() > 100, kept.len())?;
            play.same_bytes("what is kept", &program.as_bytes()[..kept.len()], kept)
        })
    };
    vec![
        spoiled(
            "punch-reset",
            "A reset in the middle of a punch: what came is kept, and marked as failed",
            "fanuc-rs232.punch.reset",
            Press::Reset,
            Failure::PartnerReset,
        ),
        spoiled(
            "punch-alarm",
            "An alarm in the middle of a punch: what came is kept, and marked as failed",
            "fanuc-rs232.punch.alarm",
            Press::Alarm,
            Failure::PartnerAlarm,
        ),
    ]
}

/// The operator asks for a program at the panel; the host grants it and sends it.
fn request() -> Script {
    let clauses =
        ["fanuc-rs232.request.ask", "fanuc-rs232.request.answer", "fanuc-rs232.request.program"];
    let control = small(Options { line: seven_even_two(9_600), ..Options::default() });
    let title =
        "A request from the panel is asked of the host, granted, and answered with its program";
    script("request", title, &clauses, &[], control, 1, |play| {
        let now = play.now();
        play.partner().press(now, Press::Request("1234".to_owned()));
        play.run(SECOND)?;
        let asked = play.host.observed.iter().find_map(|(_, observed)| match observed {
            Observed::Request { request, kind, fields } => Some((*request, *kind, fields.clone())),
            _ => None,
        });
        let Some((request, kind, fields)) = asked else {
            return Err(diverged(play.now(), "the operator has asked", "a request", "nothing"));
        };
        let fields = Values::new(&fields);
        play.equal("the request's kind", 0, kind)?;
        play.equal("the number asked for", Some(Value::Int(1_234)), fields.find(1))?;
        play.answer(request.0, Ok(&[]))?;
        let program = program(20);
        let job = play.send(program.as_bytes())?;
        let end = play.end_of(job, HOUR)?;
        play.demand("the job must be done", end.is_ok(), end)?;
        play.run(SECOND)?;
        arrived(play, &program)
    })
}

/// A control with the remote buffer.
fn remote(remote: RemoteOptions) -> Options {
    Options {
        interface: Interface::RemoteA,
        line: seven_even_two(19_200),
        buffer: 4_096,
        resume: 2_048,
        block_time: Micros::from_millis(20),
        remote,
        ..Options::default()
    }
}

fn remote_buffers() -> Vec<Script> {
    let settings: Settings = &[("mode", "remote-a"), ("packet_size", "100")];
    let damaged =
        RemoteOptions { wrong_sums: vec![0, 8], refusals: vec![3, 9], ..RemoteOptions::default() };
    let loops = |slug, title, clauses: &[&'static str], options: RemoteOptions| {
        let retries = options.wrong_sums.len() + options.refusals.len();
        script(slug, title, clauses, settings, remote(options), 1, move |play| {
            let program = program(60);
            let job = play.send(program.as_bytes())?;
            play.run(Micros::from_secs(2))?;
            let now = play.now();
            play.partner().press(now, Press::Read);
            let end = play.end_of(job, HOUR)?;
            play.demand("the job must be done", end.is_ok(), end)?;
            play.run(SECOND)?;
            arrived(play, &program)?;
            let report = play.partner().report().remote;
            play.equal("faults that the control saw", Vec::new(), report.faults)?;
            play.equal("silences that the control saw", 0, report.silences)?;
            let seen = (report.retries_asked + report.retries_heard) as usize;
            play.equal("messages that were repeated", retries, seen)
        })
    };
    vec![
        loops(
            "remote-a",
            "Remote buffer A: a program in packets",
            &["fanuc-rs232.remote.initialise", "fanuc-rs232.remote.data", "fanuc-rs232.remote.end"],
            RemoteOptions::default(),
        ),
        loops(
            "remote-a-damaged",
            "Remote buffer A: what is damaged is repeated, and nothing twice",
            &["fanuc-rs232.remote.sum", "fanuc-rs232.remote.repeat"],
            damaged,
        ),
    ]
}

/// What a control keeps of a program: all behind the first line, up to the closing `%`.
fn text_of(program: &str) -> &str {
    program.trim_start_matches("%\n").trim_end_matches('\n')
}

/// What a control punches between its two `%`.
fn between(program: &str) -> Vec<u8> {
    text_of(program).trim_end_matches('%').into()
}

/// A program of so many blocks, of characters that every code has.
fn program(blocks: usize) -> String {
    let mut program = "%\nO1234(PLATE 35/6, REV 2 - A+B&C)\nG90G21\n".to_owned();
    for n in 1..=blocks {
        let (x, y, z) = (n * 7 % 400, n * 13 % 1_000, n % 7);
        let _ = writeln!(program, "N{n}G1X{x}.{y:03}Y-{y}.5Z+{z}.F{}", 100 + n % 900);
    }
    program + "/M99\nHIJKLPQRSTUVW\nM30\n%\n"
}
