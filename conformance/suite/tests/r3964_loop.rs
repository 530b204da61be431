//! The 3964 family in closed loops: the plug-in against itself, against the
//! simulated station with one fault at a time, at the very ends of its timers;
//! and RK512 both ways.
//!
//! `SOFTPLUG_LOOP_BLOCKS` says how many blocks two plug-ins exchange (10,000).

mod rk512;

use crate::common::pair::{Pair, PluginEnd};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_abi::{LineParameters, Micros};
use softplug_link::LinkOptions;
use softplug_machines::r3964::{Fault, Faults, Options, Priority, Station, When};
use softplug_native::NativePlugin;

const LONG: Micros = Micros::from_secs(1_000_000);

/// A port without FIFO: what is stopped leaves no more than one character.
fn plugin(line: LineParameters, settings: &[(&str, &str)]) -> PluginEnd {
    let options = LinkOptions { line, ..LinkOptions::default() };
    PluginEnd::native(NativePlugin::R3964, settings, &options, 1, Micros::ZERO)
}

fn random(seed: u64) -> ChaCha8Rng {
    let mut bytes = [0; 32];
    bytes[..8].copy_from_slice(&seed.to_le_bytes());
    ChaCha8Rng::from_seed(bytes)
}

/// At random times, at random lengths, so that the line is now idle and now
/// wanted by both.
fn blocks(seed: u64, count: usize) -> Vec<(Micros, Vec<u8>)> {
    let mut random = random(seed);
    let mut at = Micros::from_millis(50);
    let mut blocks = Vec::with_capacity(count);
    for _ in 0..count {
        at = at + Micros(i64::from(random.next_u32() % 30_000));
        let mut data = vec![0; random.next_u32() as usize % 48];
        random.fill_bytes(&mut data);
        for byte in &mut data {
            if *byte % 8 == 0 {
                *byte = [0x02, 0x03, 0x10, 0x15][usize::from(*byte / 8) % 4];
            }
        }
        blocks.push((at, data));
    }
    blocks
}

#[test]
fn two_plugins_exchange_ten_thousand_blocks_and_lose_none() {
    let count = std::env::var("SOFTPLUG_LOOP_BLOCKS")
        .map_or(10_000, |text| text.parse::<usize>().expect("a number"));
    let line = LineParameters::new(38_400);
    let (low, high) = (blocks(1, count / 2), blocks(2, count - count / 2));
    let mut one = plugin(line, &[("priority", "low")]);
    let mut other = plugin(line, &[("priority", "high")]);
    for (at, data) in &low {
        one.send(*at, data.clone());
    }
    for (at, data) in &high {
        other.send(*at, data.clone());
    }
    let mut pair = Pair::new(one, other);
    pair.run_until(LONG);

    for (sender, receiver, blocks) in [(&pair.a, &pair.b, &low), (&pair.b, &pair.a, &high)] {
        assert!(sender.is_at_rest());
        let done = sender.host.jobs.iter().filter(|job| matches!(job.result, Some(Ok(_))));
        assert_eq!(done.count(), blocks.len());
        assert!(receiver.host.delivered.iter().all(|delivered| delivered.result.is_ok()));
        let delivered = receiver.host.delivered.iter().map(|delivered| &delivered.data);
        assert!(delivered.eq(blocks.iter().map(|(_, data)| data)));
    }
    // They did collide: STX of the low side, then DLE without a block of its own.
    let collisions = pair
        .a
        .host
        .emitted
        .windows(2)
        .filter(|pair| pair[0].2 == 0x02 && pair[1].2 == 0x10 && pair[1].0 > pair[0].1);
    assert!(collisions.count() > count / 1_000);
}

/// A plug-in that is replaced every millisecond, within blocks, acknowledgements
/// and conflicts, exchanges the same as one that is not.
#[test]
fn replacing_the_plugins_all_the_time_loses_nothing() {
    let line = LineParameters::new(38_400);
    let (low, high) = (blocks(3, 150), blocks(4, 150));
    let run = |every: Option<i64>| {
        let mut one = plugin(line, &[("priority", "low")]);
        let mut other = plugin(line, &[("priority", "high")]);
        for (at, data) in &low {
            one.send(*at, data.clone());
        }
        for (at, data) in &high {
            other.send(*at, data.clone());
        }
        let swaps = |first: i64| {
            every
                .into_iter()
                .flat_map(move |every| (0..3_000).map(move |n| Micros(first + n * every)))
        };
        one.swap_at(swaps(0));
        other.swap_at(swaps(333));
        let mut pair = Pair::new(one, other);
        pair.run_until(LONG);
        pair
    };
    let (kept, replaced) = (run(None), run(Some(1_000)));
    assert_eq!((kept.a.host.swapped, replaced.a.host.swapped), (0, 3_000));
    assert_eq!(kept.a.host.emitted, replaced.a.host.emitted);
    assert_eq!(kept.b.host.emitted, replaced.b.host.emitted);
    for (end, blocks) in [(&replaced.a, &high), (&replaced.b, &low)] {
        let delivered = end.host.delivered.iter().map(|delivered| &delivered.data);
        assert!(delivered.eq(blocks.iter().map(|(_, data)| data)));
    }
}

/// A job over the block size goes as several blocks, each acknowledged before the
/// next, also where some are repeated.
#[test]
fn a_split_job_arrives_whole_and_in_order() {
    let data: Vec<u8> = (0..5_000_u32).map(|n| (n * n / 7) as u8).collect();
    for plan in [Vec::new(), vec![(When::PerMille(200), Fault::NakAcknowledgement)]] {
        let is_sound = plan.is_empty();
        let faults = Faults { seed: 5, plan };
        let options = Options { faults, ..Options::default() };
        let settings = [("split", "on"), ("block_size", "100"), ("priority", "low")];
        let mut near = plugin(options.line, &settings);
        near.host.piece = 33;
        near.send(Micros::from_secs(1), data.clone());
        near.send(Micros::from_secs(1), b"the next".to_vec());
        let mut pair = Pair::new(near, Station::new(options).expect("sound options"));
        pair.run_until(LONG);
        assert!(pair.a.host.jobs.iter().all(|job| matches!(job.result, Some(Ok(_)))));
        let report = pair.b.report();
        assert_eq!(report.naks_received == 1 && report.faults.is_empty(), is_sound);
        assert_eq!(report.received.len(), 51);
        let (last, blocks) = report.received.split_last().expect("51 blocks");
        assert!(blocks.iter().all(|block| block.data.len() == 100));
        let whole: Vec<u8> = blocks.iter().flat_map(|block| block.data.clone()).collect();
        assert_eq!((whole == data, last.data.as_slice()), (true, &b"the next"[..]));
    }
}

/// The plug-in with one job, a station with one block, one after the other.
fn exchange(settings: &[(&str, &str)], options: Options) -> Pair<PluginEnd, Station> {
    let mut near = plugin(options.line, settings);
    near.send(Micros::from_secs(1), b"from the plug-in".to_vec());
    let mut pair = Pair::new(near, Station::new(options).expect("sound options"));
    pair.run_until(Micros::from_secs(200));
    pair.b.send(Micros::from_secs(200), b"from the station".to_vec());
    pair.run_until(LONG);
    pair
}

/// After a single fault both blocks arrive all the same, unaltered.
#[test]
fn every_single_fault_is_overcome() {
    let late = Micros::from_millis(2_500);
    let gap = Micros::from_millis(300);
    let faults = [
        Fault::NoAnswer,
        Fault::LateAnswer(late),
        Fault::NakAnswer,
        Fault::OtherAnswer(0x41),
        Fault::Conflict,
        Fault::NoBuffer,
        Fault::Silence(late),
        Fault::NoAcknowledgement,
        Fault::LateAcknowledgement(late),
        Fault::NakAcknowledgement,
        Fault::OtherAcknowledgement(0x02),
        Fault::OtherAcknowledgement(0x41),
        Fault::NakInBlock(3),
        Fault::OtherInBlock(3, 0x41),
        Fault::OtherInBlock(3, 0x10),
        Fault::LateStart(late),
        Fault::WrongCheck,
        Fault::LoneDle(4),
        Fault::Gap(4, gap),
        Fault::Cut(4),
        Fault::Garbage(vec![0x55, 0x02]),
        Fault::Break,
    ];
    for fault in faults {
        let is_repeated = matches!(fault, Fault::NoAcknowledgement | Fault::LateAcknowledgement(_));
        let is_conflict = fault == Fault::Conflict;
        let faults = Faults::one(When::Nth(1), fault.clone());
        let pair = exchange(&[("priority", "low")], Options { faults, ..Options::default() });
        let report = pair.b.report();
        assert_eq!(report.faults.len(), 1, "{fault:?}");
        assert!(matches!(pair.a.host.jobs[0].result, Some(Ok(_))), "{fault:?}");
        let arrived: Vec<_> = report.received.iter().map(|block| block.data.as_slice()).collect();
        let expected = vec![&b"from the plug-in"[..]; if is_repeated { 2 } else { 1 }];
        assert_eq!(arrived, expected, "{fault:?}");
        let delivered = pair.a.host.delivered.iter().filter(|delivered| delivered.result.is_ok());
        let delivered: Vec<_> = delivered.map(|delivered| delivered.data.as_slice()).collect();
        // The station's fault needed a block to collide with.
        let own: &[&[u8]] =
            if is_conflict { &[b"", b"from the station"] } else { &[b"from the station"] };
        assert_eq!(delivered, own, "{fault:?}");
        assert!(report.sent.iter().all(|sent| sent.result.is_ok()), "{fault:?}");
        assert!(pair.a.is_at_rest() && pair.b.is_idle(), "{fault:?}");
    }
}

/// A break in the block fails the job, and nothing else.
#[test]
fn a_break_in_the_block_fails_the_job() {
    let faults = Faults::one(When::Nth(1), Fault::BreakInBlock(3));
    let pair = exchange(&[("priority", "low")], Options { faults, ..Options::default() });
    let result = pair.a.host.jobs[0].result;
    assert_eq!(result, Some(Err((softplug_abi::Failure::Break, 0x080D))));
    assert_eq!(pair.b.report().received, []);
    assert_eq!(pair.a.host.delivered.len(), 1);
    assert!(pair.a.is_at_rest() && pair.b.is_idle());
}

/// Delays after which a character ends one µs before a limit, at it, one after.
fn around(limit: Micros, line: LineParameters) -> [(Micros, bool); 3] {
    let span = limit - line.characters(1);
    [(span - Micros(1), true), (span, true), (span + Micros(1), false)]
}

#[test]
fn qvz_ends_to_the_microsecond() {
    let options = Options::default();
    for (span, in_time) in around(options.qvz, options.line) {
        for (fault, blocks) in [
            (Fault::LateAnswer(span), 1),
            (Fault::LateAcknowledgement(span), if in_time { 1 } else { 2 }),
        ] {
            let faults = Faults::one(When::Nth(1), fault);
            let pair = exchange(&[("priority", "low")], Options { faults, ..Options::default() });
            let notes = pair.a.host.notes.iter().filter(|(_, code, _)| *code >> 8 == 0x07);
            assert_eq!(notes.count() == 0, in_time, "{span}");
            assert_eq!(pair.b.report().received.len(), blocks, "{span}");
            assert!(matches!(pair.a.host.jobs[0].result, Some(Ok(_))));
        }
    }
}

#[test]
fn zvz_ends_to_the_microsecond() {
    let options = Options::default();
    // Before the first character, within the block, before the check character.
    for place in [0, 5, 18] {
        for (span, in_time) in around(options.zvz, options.line) {
            let faults = Faults::one(When::Nth(1), Fault::Gap(place, span));
            let pair = exchange(&[("priority", "low")], Options { faults, ..Options::default() });
            let report = pair.b.report();
            assert_eq!(report.blocks_begun, if in_time { 1 } else { 2 }, "{place}, {span}");
            let good = pair.a.host.delivered.iter().filter(|one| one.result.is_ok());
            assert_eq!(good.count(), 1, "{place}, {span}");
        }
    }
}

#[test]
fn bwz_ends_to_the_microsecond() {
    let options = Options::default();
    for (span, in_time) in around(options.bwz, options.line) {
        let plan = vec![(When::Nth(1), Fault::WrongCheck), (When::Nth(2), Fault::LateStart(span))];
        let faults = Faults { seed: 0, plan };
        let pair = exchange(&[("priority", "low")], Options { faults, ..Options::default() });
        // In time it is the same reception, else a failed one and another.
        let results: Vec<_> =
            pair.a.host.delivered.iter().map(|delivered| delivered.result.is_ok()).collect();
        let expected: &[bool] = if in_time { &[true] } else { &[false, true] };
        assert_eq!(results, expected, "{span}");
    }
}

#[test]
fn both_of_one_priority_fail_and_come_to_rest() {
    for (setting, priority) in
        [("low", Priority::Low), ("high", Priority::High), ("none", Priority::None)]
    {
        let options = Options { priority, ..Options::default() };
        let mut near = plugin(options.line, &[("priority", setting)]);
        near.send(Micros::from_secs(1), b"one".to_vec());
        let mut pair = Pair::new(near, Station::new(options).expect("sound options"));
        pair.run_until(Micros::from_millis(999));
        pair.b.send(Micros::from_secs(1), b"other".to_vec());
        pair.run_until(LONG);
        assert!(pair.a.is_at_rest() && pair.b.is_idle(), "{setting}");
        let status = match pair.a.host.jobs[0].result {
            Some(Err((_, status))) => status,
            other => panic!("{setting}: {other:?}"),
        };
        let expected = match priority {
            Priority::Low => 0x070C,
            Priority::High => 0x070B,
            Priority::None => 0x0702,
        };
        assert_eq!(status, expected, "{setting}");
    }
}
