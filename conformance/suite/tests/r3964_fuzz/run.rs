//! Runs cases and holds them against the oracle.

use std::panic::{AssertUnwindSafe, catch_unwind};

use softplug_abi::Micros;
use softplug_link::LinkOptions;
use softplug_machines::r3964::{Noisy, Options, Priority, Received, Sent, Station};
use softplug_native::NativePlugin;

use crate::case::{Case, Subject};
use crate::oracle::{Direction, Side, Tally, hex};
use crate::pair::{Delivered, Pair, PluginEnd};

/// Runs as many cases as the environment says.
pub(crate) fn many(subject: Subject) {
    let number = |name: &str, otherwise: u64| {
        std::env::var(name).map_or(otherwise, |text| text.parse().expect("a number"))
    };
    let cases = number("SOFTPLUG_FUZZ_CASES", 2_000);
    let first = number("SOFTPLUG_FUZZ_SEED", 0);
    let mut tally = Tally::default();
    let mut unseen = Vec::new();
    let mut failed = Vec::new();
    for seed in first..first + cases {
        let case = Case::new(subject, seed);
        match run(&case) {
            Ok(one) => {
                if one.forged + one.colliding > 0 {
                    unseen.push((seed, one.forged, one.colliding));
                }
                tally += one;
            }
            Err(why) => failed.push((case, seed, why)),
        }
    }
    println!("{subject:?}: {cases} cases from seed {first}: {tally:?}");
    for (seed, forged, colliding) in unseen {
        println!("  seed {seed}: {forged} forged acknowledgements, {colliding} colliding checks");
    }
    if !failed.is_empty() {
        for (_, seed, why) in &failed {
            println!("seed {seed} fails: {}", why.lines().next().unwrap_or_default());
        }
        let count = failed.len();
        let (case, seed, why) = failed.swap_remove(0);
        let (case, why) = simplest(case, why);
        panic!("{subject:?}: {count} of {cases} cases fail; seed {seed} is\n{case:?}\n{why}");
    }
    // A run in which nothing arrives proves nothing.
    assert!(tally.done > 0 && tally.delivered >= tally.done.saturating_sub(tally.forged));
}

fn simplest(mut case: Case, mut why: String) -> (Case, String) {
    'again: loop {
        for simpler in case.simpler() {
            if let Err(reason) = run(&simpler) {
                (case, why) = (simpler, reason);
                continue 'again;
            }
        }
        return (case, why);
    }
}

/// One case; a panic is a failure like any other.
fn run(case: &Case) -> Result<Tally, String> {
    let run = || match case.subject {
        Subject::Station => with_station(case),
        Subject::R3964 | Subject::Simplified => with_plugin(case),
    };
    catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().cloned();
        let text = text.or_else(|| panic.downcast_ref::<&str>().map(|text| (*text).to_owned()));
        Err(format!("it panicked: {}", text.unwrap_or_default()))
    })
}

fn far(case: &Case) -> Noisy<Station> {
    let station = Station::new(case.options.clone()).expect("sound options");
    let mut noisy = Noisy::new(station, case.options.line, case.noise);
    // Without a rate all would happen at one instant, where nothing is too late.
    if case.options.line.baud == 0 {
        noisy.transit = Micros(200);
    }
    noisy
}

/// Long enough for everything.
const LONG: Micros = Micros::from_secs(3_600);
const PROBE: &[u8] = b"probe";

fn with_station(case: &Case) -> Result<Tally, String> {
    let near = Options {
        priority: case.priority,
        faults: softplug_machines::r3964::Faults::default(),
        ..case.options.clone()
    };
    let near = Station::new(near).expect("sound options");
    let mut pair = Pair::new(near, far(case));
    let mut todo: Vec<_> = case.jobs.iter().map(|(at, data)| (*at, true, data)).collect();
    todo.extend(case.blocks.iter().map(|(at, data)| (*at, false, data)));
    todo.sort_by_key(|(at, ..)| *at);
    for (at, is_near, data) in todo {
        pair.run_until(at);
        if is_near {
            pair.a.send(at, data.clone());
        } else {
            pair.b.inner.send(at, data.clone());
        }
    }
    pair.run_until(LONG);
    if !pair.a.is_idle() || !pair.b.inner.is_idle() {
        return Err("not both are idle".to_owned());
    }
    let near = Side::of_station(&pair.a);
    let faults = pair.b.inner.report().faults.len();
    let tally = judge(case, &near, &pair.b, faults)?;
    let naks = pair.a.report().naks + pair.b.inner.report().naks;
    let stx = pair.a.report().stx + pair.b.inner.report().stx;
    bound_naks(case, naks as usize, stx as usize, pair.b.disturbances.len() + faults)?;

    sound_from_now(&mut pair.b);
    let now = pair.now + Micros::from_secs(1);
    pair.a.send(now, PROBE.to_vec());
    pair.now = now;
    pair.run_until(now + LONG);
    pair.b.inner.send(pair.now, PROBE.to_vec());
    pair.run_until(pair.now + LONG);
    let arrived = |station: &Station| {
        let report = station.report();
        report.received.last().is_some_and(|block| block.data == PROBE)
            && report.sent.last().is_some_and(|sent| sent.result.is_ok())
    };
    if !arrived(&pair.a) || !arrived(&pair.b.inner) {
        return Err("a block on the sound line afterwards is not exchanged".to_owned());
    }
    Ok(tally)
}

fn with_plugin(case: &Case) -> Result<Tally, String> {
    let plugin = match case.subject {
        Subject::R3964 | Subject::Station => NativePlugin::R3964,
        Subject::Simplified => NativePlugin::R3964Simplified,
    };
    let settings = settings(case);
    let settings: Vec<_> = settings.iter().map(|(name, value)| (*name, value.as_str())).collect();
    let options = LinkOptions {
        line: case.options.line,
        delivery_room: case.delivery_room,
        ..LinkOptions::default()
    };
    let mut near = PluginEnd::native(plugin, &settings, &options, case.depth, case.latency);
    near.swap_at(case.swaps.iter().copied());
    near.abort_at(case.aborts.iter().copied());
    near.host.piece = case.piece;
    near.host.put_away_after = case.put_away_after;
    for (at, data) in &case.jobs {
        near.send(*at, data.clone());
    }
    let mut pair = Pair::new(near, far(case));
    play(case, &mut pair).map_err(|why| format!("{why}\n{}", story(&pair)))
}

type Played = Pair<PluginEnd, Noisy<Station>>;

fn play(case: &Case, pair: &mut Played) -> Result<Tally, String> {
    for (at, data) in &case.blocks {
        pair.run_until(*at);
        pair.b.inner.send(*at, data.clone());
    }
    pair.run_until(LONG);
    if !pair.a.is_at_rest() {
        return Err("the plug-in does not come to rest".to_owned());
    }
    if !pair.b.inner.is_idle() {
        return Err("the station does not come to rest".to_owned());
    }
    let near = Side::of_plugin(&pair.a);
    let faults = pair.b.inner.report().faults.len();
    let tally = judge(case, &near, &pair.b, faults)?;
    // What an aborted job left in a deep port goes out in the time of another.
    if case.is_plain && case.aborts.is_empty() {
        count_tries(case, &near, &pair.b)?;
    }

    sound_from_now(&mut pair.b);
    let now = pair.now + Micros::from_secs(2);
    pair.a.send(now, PROBE.to_vec());
    pair.run_until(now + LONG);
    let now = pair.now + Micros::from_secs(2);
    pair.run_until(now);
    pair.b.inner.send(now, PROBE.to_vec());
    pair.run_until(now + LONG);
    let report = pair.b.inner.report();
    if report.received.last().is_none_or(|block| block.data != PROBE)
        || pair.a.host.jobs.last().is_none_or(|job| !matches!(job.result, Some(Ok(_))))
    {
        return Err("the plug-in cannot send a block on the sound line afterwards".to_owned());
    }
    let last = pair.a.host.delivered.last();
    if last.is_none_or(|last| last.data != PROBE || last.result.is_err())
        || report.sent.last().is_none_or(|sent| sent.result.is_err())
    {
        return Err("the plug-in cannot receive a block on the sound line afterwards".to_owned());
    }
    Ok(tally)
}

/// What happened, in the order of time, up to a page of it.
fn story(pair: &Played) -> String {
    let mut lines = Vec::new();
    for (start, _, byte) in &pair.a.host.emitted {
        lines.push((*start, format!("{start} subject begins {byte:02X}")));
    }
    for arrival in &pair.b.to_outer {
        let (at, signal) = (arrival.at, arrival.signal);
        lines.push((at, format!("{at}         to the subject: {signal:02X?}")));
    }
    for arrival in pair.b.to_inner.iter().filter(|arrival| arrival.is_altered) {
        let (at, signal) = (arrival.at, arrival.signal);
        lines.push((at, format!("{at}         to the station, altered: {signal:02X?}")));
    }
    for job in &pair.a.host.jobs {
        lines.push((job.begun, format!("{} job begins, {}", job.begun, hex(&job.data))));
        if let Some(ended) = job.ended {
            lines.push((ended, format!("{ended} job ends, {:?}", job.result)));
        }
    }
    for delivered in &pair.a.host.delivered {
        let Delivered { at, data, result, .. } = delivered;
        lines.push((*at, format!("{at} delivered, {result:?}, {}", hex(data))));
    }
    for (at, code, text) in &pair.a.host.notes {
        lines.push((*at, format!("{at} note {code:04X}: {text}")));
    }
    let report = pair.b.inner.report();
    for (at, fault) in &report.faults {
        lines.push((*at, format!("{at}         station: {fault:?}")));
    }
    for (at, error) in &report.errors {
        lines.push((*at, format!("{at}         station: {error}")));
    }
    for sent in &report.sent {
        let Sent { begun, ended, data, result, .. } = sent;
        lines.push((*begun, format!("{begun}         station begins {}", hex(data))));
        lines.push((*ended, format!("{ended}         station ends, {result:?}")));
    }
    for received in &report.received {
        let Received { at, data } = received;
        lines.push((*at, format!("{at}         station received {}", hex(data))));
    }
    lines.sort_by_key(|(at, _)| *at);
    let lines: Vec<_> = lines.into_iter().map(|(_, line)| line).take(120).collect();
    lines.join("\n")
}

fn settings(case: &Case) -> Vec<(&'static str, String)> {
    let on = |value: bool| if value { "on" } else { "off" }.to_owned();
    let millis = |span: Micros| (span.0 / 1_000).to_string();
    let options = &case.options;
    let priority = match case.priority {
        Priority::Low => "low",
        Priority::High => "high",
        Priority::None => "none",
    };
    vec![
        ("bcc", on(options.bcc)),
        ("handshake", on(options.handshake)),
        ("doubling", on(options.doubling)),
        ("priority", priority.to_owned()),
        ("qvz", millis(options.qvz)),
        ("zvz", millis(options.zvz)),
        ("bwz", millis(options.bwz)),
        ("buffer_wait", millis(options.buffer_wait)),
        ("setup_attempts", options.setup_attempts.to_string()),
        ("transmission_attempts", options.transmission_attempts.to_string()),
        ("block_size", options.block_size.to_string()),
        ("nak_at_start", on(options.nak_at_start)),
        ("nak_on_garbage", on(options.nak_on_garbage)),
    ]
}

fn sound_from_now(far: &mut Noisy<Station>) {
    far.clear();
    far.inner.behave();
}

fn judge(case: &Case, near: &Side, noisy: &Noisy<Station>, faults: usize) -> Result<Tally, String> {
    let far = Side::of_station(&noisy.inner);
    let disturbances = noisy.disturbances.len() + faults;
    let (options, latency) = (&case.options, case.latency);
    let in_port = options.line.characters(20) + Micros::from_millis(1);
    let reach = in_port + latency + case.noise.longest_delay;
    // So can the rest of a block that is too long, and the STXs that it provokes.
    let is_cut_off = case.too_long() > 0;
    let is_ambiguous = !case.is_settled() || !case.aborts.is_empty() || is_cut_off;
    let disturbances = disturbances + case.aborts.len() + case.too_long();
    let out = Direction {
        sender: near,
        receiver: &far,
        to_sender: &noisy.to_outer,
        to_receiver: &noisy.to_inner,
        options,
        disturbances,
        reach,
        is_ambiguous,
        latency,
    };
    let back = Direction {
        sender: &far,
        receiver: near,
        to_sender: &noisy.to_inner,
        to_receiver: &noisy.to_outer,
        options,
        disturbances,
        reach,
        is_ambiguous,
        latency,
    };
    let mut tally = out.judge().map_err(|why| format!("from the subject: {why}"))?;
    tally += back.judge().map_err(|why| format!("to the subject: {why}"))?;
    if case.is_sound() {
        let is_complete = tally.done == tally.jobs && tally.delivered == tally.jobs;
        if !is_complete || tally.jobs != case.jobs.len() + case.blocks.len() {
            return Err(format!("on a sound line not every block arrived once: {tally:?}"));
        }
        if tally.forged + tally.colliding > 0 {
            return Err(format!("forged on a sound line: {tally:?}"));
        }
    }
    if let Some(emitted) = &near.emitted {
        let count = |wanted: u8| emitted.iter().filter(|(.., byte)| *byte == wanted).count();
        if case.is_plain {
            let report = noisy.inner.report();
            let stx = count(0x02) + report.stx as usize;
            bound_naks(case, count(0x15) + report.naks as usize, stx, disturbances)?;
        }
    }
    Ok(tally)
}

/// Each NAK has a cause: the start, a set-up that was refused, a block that was
/// refused or given up, a stray character; or two, where that is an STX, whose
/// DLE is a stray character again.
fn bound_naks(case: &Case, naks: usize, stx: usize, disturbances: usize) -> Result<(), String> {
    let jobs = case.jobs.len() + case.blocks.len();
    let most = 2 + 2 * stx + jobs + 2 * disturbances;
    if naks > most {
        return Err(format!("{naks} NAKs, of which {most} have a cause"));
    }
    Ok(())
}

/// STXs and blocks of each job, where data cannot be taken for them.
fn count_tries(case: &Case, near: &Side, noisy: &Noisy<Station>) -> Result<(), String> {
    let Some(emitted) = &near.emitted else { return Ok(()) };
    let options = &case.options;
    let blocks = options.transmission_attempts as usize;
    let setups = blocks * if options.handshake { options.setup_attempts as usize } else { 1 };
    // What a job left in the queue goes out in the time of the next, if that
    // begins at once: such jobs are counted together.
    for jobs in near.jobs.chunk_by(|one, next| one.ended == next.begun) {
        let (Some(first), Some(last)) = (jobs.first(), jobs.last()) else { continue };
        let (setups, blocks) = (setups * jobs.len(), blocks * jobs.len());
        let in_time = |at: Micros| at >= first.begun && at < last.ended;
        let own: Vec<u8> =
            emitted.iter().filter(|(start, ..)| in_time(*start)).map(|(.., byte)| *byte).collect();
        // Each STX that came may have been a conflict, after which the tries
        // begin at 1.
        let conflicts = noisy
            .to_outer
            .iter()
            .filter(|arrival| in_time(arrival.at) || in_time(arrival.at + case.latency))
            .filter(|arrival| arrival.signal == softplug_machines::Signal::Character(0x02))
            .count();
        let is_stx = |byte: &u8| *byte == 0x02;
        let stx = own.iter().copied().filter(is_stx).count();
        let is_data = |byte: u8| byte >= 0x40;
        let is_first = |pair: &&[u8]| !is_data(pair[0]) && is_data(pair[1]);
        let begun = own.windows(2).filter(is_first).count();
        if stx > setups * (1 + conflicts) {
            return Err(format!(
                "the jobs from {} took {stx} STX, {setups} are set, with {conflicts} conflicts",
                first.begun
            ));
        }
        // The check character may look like data behind ETX.
        let checks = own.windows(2).filter(|pair| pair[0] == 0x03 && is_data(pair[1])).count();
        if begun - checks > blocks * (1 + conflicts) {
            return Err(format!(
                "the jobs from {} were sent {} times, {blocks} are set, with {conflicts} conflicts",
                first.begun,
                begun - checks
            ));
        }
    }
    Ok(())
}
