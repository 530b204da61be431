//! The 3964 family: retries up to their limits, both sides at once, a lossy line.

use super::case::Script;
use super::failure::Outcome;
use super::play::{End, Play};
use super::setup::Setup;
use softplug_abi::{Failure, Micros};
use softplug_machines::r3964::{Fault, Faults, Noise, Noisy, Options, Priority, Station, When};

const STX: u8 = 0x02;
const NAK: u8 = 0x15;

/// Longer than every scenario takes.
const LONG: Micros = Micros::from_secs(1_000);

/// The end of a job whose last STX was not answered.
const NO_ANSWER: End = Err((Failure::NoAnswer, 0x0703));

/// A dialect: its profile, the station that speaks it, and the settings for it.
#[derive(Copy, Clone)]
struct Dialect {
    profile: &'static str,
    options: fn() -> Options,
    settings: &'static [(&'static str, &'static str)],
}

const R3964: Dialect =
    Dialect { profile: "r3964", options: Options::default, settings: &[("nak_at_start", "off")] };

const WITHOUT_CHECK: Dialect = Dialect {
    profile: "3964",
    options: Options::without_check,
    settings: &[("nak_at_start", "off"), ("bcc", "off")],
};

const SIMPLIFIED: Dialect =
    Dialect { profile: "r3964-simplified", options: Options::simplified, settings: &[] };

impl Dialect {
    fn setup(self, more: &[(&'static str, &str)]) -> Setup {
        let settings: Vec<_> = self.settings.iter().copied().chain(more.iter().copied()).collect();
        Setup::new((self.options)().line, &settings)
    }

    fn station(self, change: impl FnOnce(&mut Options)) -> Station {
        let mut options = Options { nak_at_start: false, ..(self.options)() };
        change(&mut options);
        Station::new(options).expect("the scenario's station is sound")
    }
}

pub(super) fn scripts() -> Vec<Script> {
    let mut all = Vec::new();
    all.extend(set_up_limits());
    all.extend(transmission_limits());
    all.extend(together());
    all.extend(lossy());
    all.extend(late());
    all.push(many());
    all.push(reception_limit());
    all
}

fn set_up_limits() -> Vec<Script> {
    let limit = |dialect: Dialect,
                 slug,
                 title,
                 clauses: &[&'static str],
                 fault: Fault,
                 end: End| {
        let attempts = (dialect.options)().setup_attempts as usize;
        let id = format!("{}.loop.{slug}", dialect.profile);
        Script::new(dialect.profile, id, title, clauses, move |context| {
            let faults = Faults::one(When::Always, fault.clone());
            let station = dialect.station(|options| options.faults = faults);
            context.play(&dialect.setup(&[]), station, |play| {
                let job = play.send(b"AB")?;
                let ended = play.end_of(job, LONG)?;
                play.run(Micros::from_secs(30))?;
                play.equal("the job's end", end, ended)?;
                let expected = [vec![STX; attempts], vec![NAK]].concat();
                let sent = play.host.sent();
                play.same_bytes("each attempt is one STX, and one NAK ends them", &expected, &sent)
            })
        })
    };
    vec![
        limit(
            R3964,
            "set-up-until-limit",
            "A partner that never answers STX: all set-up attempts, one NAK, and no more",
            &["r3964.tx.set-up-attempts", "r3964.tx.qvz"],
            Fault::NoAnswer,
            NO_ANSWER,
        ),
        limit(
            R3964,
            "set-up-refused-until-limit",
            "A partner that refuses every STX: all set-up attempts, one NAK, and no more",
            &["r3964.tx.set-up-attempts", "r3964.tx.set-up-refused"],
            Fault::NakAnswer,
            Err((Failure::Refused, 0x0702)),
        ),
        limit(
            WITHOUT_CHECK,
            "set-up-until-limit",
            "A partner that never answers STX: all set-up attempts, one NAK, and no more",
            &["3964.tx.repeat", "3964.tx.qvz"],
            Fault::NoAnswer,
            NO_ANSWER,
        ),
        limit(
            SIMPLIFIED,
            "set-up-until-limit",
            "A partner that never answers STX: three STX, one NAK, and no more",
            &["r3964-simplified.tx.set-up-attempts"],
            Fault::NoAnswer,
            NO_ANSWER,
        ),
    ]
}

fn transmission_limits() -> Vec<Script> {
    let limit = |dialect: Dialect, slug, title, clauses: &[&'static str], fault: Fault| {
        let attempts = (dialect.options)().transmission_attempts as usize;
        let id = format!("{}.loop.{slug}", dialect.profile);
        Script::new(dialect.profile, id, title, clauses, move |context| {
            let faults = Faults::one(When::Always, fault.clone());
            let station = dialect.station(|options| options.faults = faults);
            context.play(&dialect.setup(&[]), station, |play| {
                let job = play.send(b"AB")?;
                let ended = play.end_of(job, LONG)?;
                play.run(Micros::from_secs(30))?;
                // The partner answers each STX, so that each one has its block.
                let begun = play.host.sent().iter().copied().filter(|byte| *byte == STX).count();
                play.equal("blocks that were begun", attempts, begun)?;
                play.demand("the job must fail", ended.is_err(), ended)?;
                let naks = play.host.sent().iter().rev().take_while(|byte| **byte == NAK).count();
                play.equal("NAKs behind the last block", 1, naks)
            })
        })
    };
    vec![
        limit(
            R3964,
            "refused-until-limit",
            "A partner that refuses every block: all transmission attempts, one NAK, and no more",
            &["r3964.tx.transmission-attempts", "r3964.tx.repeat"],
            Fault::NakAcknowledgement,
        ),
        limit(
            R3964,
            "unacknowledged-until-limit",
            "A partner that acknowledges no block: all transmission attempts, one NAK, and no more",
            &["r3964.tx.transmission-attempts", "r3964.tx.qvz"],
            Fault::NoAcknowledgement,
        ),
        limit(
            WITHOUT_CHECK,
            "refused-until-limit",
            "A partner that refuses every block: all transmission attempts, one NAK, and no more",
            &["3964.tx.repeat"],
            Fault::NakAcknowledgement,
        ),
        limit(
            SIMPLIFIED,
            "refused-once",
            "A block that is refused is not repeated: one NAK, failed",
            &["r3964-simplified.tx.one-transmission"],
            Fault::NakAcknowledgement,
        ),
    ]
}

/// A partner whose blocks are all bad: each is answered by NAK, and after the last
/// attempt the reception is over.
fn reception_limit() -> Script {
    let title = "A partner whose every block is bad: as many NAKs as attempts, one failed delivery";
    let clauses = ["r3964.rx.attempts", "r3964.rx.bcc"];
    Script::new("r3964", "r3964.loop.bad-blocks-until-limit", title, &clauses, |context| {
        let faults = Faults::one(When::Always, Fault::WrongCheck);
        let station = R3964.station(|options| options.faults = faults);
        context.play(&R3964.setup(&[]), station, |play| {
            play.partner().send(Micros::ZERO, b"AB".to_vec());
            play.run(Micros::from_secs(60))?;
            let attempts = Options::default().transmission_attempts;
            let naks = play.partner().report().naks_received;
            play.equal("NAKs that the partner got", attempts, naks)?;
            let ends: Vec<_> =
                play.deliveries().iter().map(|(_, one)| (one.failure, one.status)).collect();
            play.equal("deliveries", vec![(Some(Failure::Checksum), 0x0808)], ends)
        })
    })
}

/// Both sides begin within one character: whoever has high priority goes first, and
/// both blocks arrive once.
fn together() -> Vec<Script> {
    let mut all = Vec::new();
    for (own, partner) in [("low", Priority::High), ("high", Priority::Low)] {
        for (order, lead) in [("station-first", -500), ("at-once", 0), ("plug-in-first", 500)] {
            let id = format!("r3964.loop.together-{own}-{order}");
            let title =
                format!("Both begin within one character, priority {own}: both blocks arrive once");
            let rule = if own == "low" { "r3964.conflict.low" } else { "r3964.conflict.high" };
            all.push(Script::new("r3964", id, title, &[rule], move |context| {
                let station = R3964.station(|options| options.priority = partner);
                let setup = R3964.setup(&[("priority", own)]);
                context.play(&setup, station, |play| begin_together(play, own, lead))
            }));
        }
    }
    all
}

/// `lead`: µs by which the plug-in is ahead of the station.
fn begin_together(play: &mut Play<'_, Station>, own: &str, lead: i64) -> Outcome {
    let start = Micros::from_secs(1);
    let station_at = start + Micros(lead);
    play.run_until(start.min(station_at))?;
    if station_at <= start {
        play.partner().send(station_at, b"from the station".to_vec());
        play.run_until(start)?;
    }
    let job = play.send(b"from the plug-in")?;
    if station_at > start {
        play.run_until(station_at)?;
        play.partner().send(station_at, b"from the station".to_vec());
    }
    let ended = play.end_of(job, LONG)?;
    play.demand("the job must be done", ended.is_ok(), ended)?;
    play.run(Micros::from_secs(30))?;
    let report = play.partner().report().clone();
    let received: Vec<_> = report.received.iter().map(|block| block.data.clone()).collect();
    play.equal("what the partner received", vec![b"from the plug-in".to_vec()], received)?;
    let deliveries = play.deliveries();
    let delivered: Vec<_> =
        deliveries.iter().map(|(_, one)| (one.failure, one.bytes.clone())).collect();
    play.equal("what was delivered", vec![(None, b"from the station".to_vec())], delivered)?;
    let own_first = report.received[0].at < deliveries[0].0;
    play.equal("whether the plug-in's block goes first", own == "high", own_first)
}

/// A line that damages, loses and delays characters, both ways, then a sound one.
fn lossy() -> Vec<Script> {
    let mut all = Vec::new();
    let dialects: [(Dialect, &[&'static str]); 3] = [
        (R3964, &["r3964.rx.at-least-once", "r3964.tx.no-false-success"]),
        (WITHOUT_CHECK, &["3964.tx.acknowledged", "3964.rx.acknowledge"]),
        (
            SIMPLIFIED,
            &["r3964-simplified.rx.at-least-once", "r3964-simplified.tx.one-transmission"],
        ),
    ];
    for (dialect, clauses) in dialects {
        for seed in 1..=4_u64 {
            let id = format!("{}.loop.lossy-{seed}", dialect.profile);
            let title = format!(
                "A lossy line (seed {seed}): what is done has arrived, in order, and is what was sent"
            );
            all.push(Script::new(dialect.profile, id, title, clauses, move |context| {
                let line = (dialect.options)().line;
                let longest_delay = Micros::from_millis(300);
                // Without a check character a lost one is not noticed.
                let drop = if dialect.profile == WITHOUT_CHECK.profile { 0 } else { 4 };
                let noise =
                    Noise { seed, flip_one: 6, drop, delay: 4, longest_delay, ..Noise::default() };
                let far = Noisy::new(dialect.station(|_| ()), line, noise);
                context.play(&dialect.setup(&[]), far, exchange)
            }));
        }
    }
    all
}

/// As from a slow disk or over a network.
fn late() -> Vec<Script> {
    let dialects: [(Dialect, &[&'static str]); 3] = [
        (R3964, &["r3964.tx.no-false-success"]),
        (WITHOUT_CHECK, &["3964.tx.acknowledged"]),
        (SIMPLIFIED, &["r3964-simplified.tx.one-transmission"]),
    ];
    let all = dialects.into_iter().map(|(dialect, clauses)| {
        let id = format!("{}.loop.late", dialect.profile);
        let title = "A block whose data comes late, in pieces, arrives as it is";
        Script::new(dialect.profile, id, title, clauses, move |context| {
            context.play(&dialect.setup(&[]), dialect.station(|_| ()), |play| {
                let data: Vec<u8> = (0..=99).collect();
                let job = play.late_job("send", &[], &data)?;
                let end = play.end_of_late(job, 7, Micros::from_millis(30))?;
                play.demand("the job is done", end.is_ok(), end)?;
                let received = &play.partner().report().received;
                let received: Vec<_> = received.iter().map(|block| block.data.clone()).collect();
                play.equal("what the partner received", vec![data], received)
            })
        })
    });
    all.collect()
}

/// More than 16 bits count.
fn many() -> Script {
    let title = "65,600 blocks each way on one open link: each arrives once";
    let clauses = ["r3964.tx.no-false-success", "r3964.rx.at-least-once"];
    Script::new("r3964", "r3964.loop.many", title, &clauses, |context| {
        context.play(&R3964.setup(&[]), R3964.station(|_| ()), |play| {
            for number in 0..65_600_u32 {
                let block = number.to_le_bytes().to_vec();
                let job = play.send(&block)?;
                let end = play.end_of(job, LONG)?;
                play.demand("the job is done", end.is_ok(), end)?;
                let now = play.now();
                play.partner().send(now, block.clone());
                play.run(Micros::from_millis(40))?;
                let delivered = play.deliveries().pop().map(|(_, one)| one.bytes);
                play.equal("what was delivered", Some(block), delivered)?;
                play.forget();
            }
            let received = play.partner().report().received.len();
            play.equal("blocks that the partner received", 65_600, received)
        })
    })
}

/// The nth block of one side: none is another's.
fn block(from: u8, number: u8) -> Vec<u8> {
    [&[from, number, 0x10, 0x03, 0x02], &b"between the ends"[..], &[0x15, number]].concat()
}

const BLOCKS: u8 = 6;

fn exchange(play: &mut Play<'_, Noisy<Station>>) -> Outcome {
    let mut jobs = Vec::new();
    for number in 0..BLOCKS {
        let now = play.now() + Micros::from_millis(250);
        play.run_until(now)?;
        play.partner().inner.send(now, block(b'S', number));
        play.run(Micros::from_millis(120))?;
        let job = play.send(&block(b'P', number))?;
        jobs.push(play.end_of(job, LONG)?);
    }
    let until = play.now() + LONG;
    while play.partner().inner.waiting() > 0 && play.step(until)? {}
    // On a sound line both come to rest, and one more block goes through.
    play.partner().clear();
    play.run(Micros::from_secs(30))?;
    play.equal("blocks that the partner still has to send", 0, play.line.partner.inner.waiting())?;
    let job = play.send(&block(b'P', BLOCKS))?;
    jobs.push(play.end_of(job, LONG)?);
    play.run(Micros::from_secs(30))?;
    let last = jobs[usize::from(BLOCKS)];
    play.demand("on the sound line the job must be done", last.is_ok(), last)?;

    let report = play.partner().inner.report().clone();
    let received: Vec<Vec<u8>> = report.received.iter().map(|one| one.data.clone()).collect();
    let done = |place: usize| jobs[place].is_ok();
    in_order(play, "what the partner received", b'P', &received, done)?;
    let complete = play.deliveries().into_iter().filter(|(_, one)| one.failure.is_none());
    let complete: Vec<Vec<u8>> = complete.map(|(_, one)| one.bytes).collect();
    in_order(play, "what was delivered", b'S', &complete, |place| {
        report.sent.get(place).is_some_and(|sent| sent.result.is_ok())
    })
}

/// Only whole blocks of that side, in their order, each as often as it was repeated, and
/// at least once where the sender was told so.
fn in_order(
    play: &Play<'_, Noisy<Station>>,
    what: &str,
    from: u8,
    blocks: &[Vec<u8>],
    is_done: impl Fn(usize) -> bool,
) -> Outcome {
    let known: Vec<_> = (0..=BLOCKS).map(|number| block(from, number)).collect();
    let mut places = Vec::new();
    for found in blocks {
        if let Some(place) = known.iter().position(|block| block == found) {
            places.push(place);
        } else {
            let shown = found.escape_ascii().to_string();
            return play.demand(&format!("{what} was never sent"), false, shown);
        }
    }
    play.demand(&format!("{what} is in order"), places.is_sorted(), &places)?;
    let lost: Vec<_> =
        (0..known.len()).filter(|place| is_done(*place) && !places.contains(place)).collect();
    play.demand(&format!("{what} lacks blocks that were acknowledged"), lost.is_empty(), lost)
}
