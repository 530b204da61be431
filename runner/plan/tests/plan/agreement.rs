//! Plan and simulation, which share no arithmetic, about the same 200 random shops.

use std::collections::BTreeMap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use softplug_plan::{Discipline, Options, Plan, Service, Shop, Start, plan, simulate};

use crate::shops::{any, part};

const SHOPS: u64 = 200;
const HALF: Options = Options {
    seconds: 600.0,
    most_services: 20_000_000,
    feeds_while_filled: false,
    start: Start::Full,
    keeps_levels: false,
};

fn random(shop: u64) -> ChaCha8Rng {
    ChaCha8Rng::seed_from_u64(1_000 + shop)
}

/// Whether each line brings an empty control to full within one wait, as the model takes for granted.
fn lines_are_quick(shop: &Shop, waits: impl Iterator<Item = f64>) -> bool {
    shop.each().zip(waits).all(|((_, machine), wait)| {
        (machine.line() - machine.consumes) * wait >= machine.buffer_bits()
    })
}

fn waits(shop: &Shop, buffers: &[f64]) -> Vec<f64> {
    let payload = shop.bus().payload();
    let round: f64 = buffers.iter().map(|bits| bits / payload + shop.bus().switch).sum();
    buffers.iter().map(|bits| round - bits / payload).collect()
}

/// Each machine begins at any moment of the first round.
fn phases(plan: &Plan, random: &mut ChaCha8Rng) -> Start {
    let round = plan.bus.round_seconds.unwrap();
    Start::At(plan.machines.iter().map(|_| round * part(random)).collect())
}

#[test]
fn what_is_planned_does_not_run_dry() {
    let mut counts = BTreeMap::new();
    for number in 0..SHOPS {
        let mut random = random(number);
        let shop = any(&mut random);
        let plan = plan(&shop);
        if !plan.feasible {
            *counts.entry("refused").or_insert(0) += 1;
            continue;
        }
        *counts.entry("feasible").or_insert(0) += 1;
        let service = plan.service();
        let starts = [Start::Full, phases(&plan, &mut random), phases(&plan, &mut random)];
        for start in starts {
            for discipline in [Discipline::Slots, Discipline::Scheduled] {
                let full = Options { feeds_while_filled: true, start: start.clone(), ..HALF };
                let outcome = simulate(&shop, &service, discipline, &full);
                assert!(outcome.holds(), "shop {number}, {discipline:?}, {start:?}: {shop:?}");
                if !plan.must_feed_while_filled() {
                    let half = Options { start: start.clone(), ..HALF };
                    let outcome = simulate(&shop, &service, discipline, &half);
                    assert!(
                        outcome.holds(),
                        "half, shop {number}, {discipline:?}, {start:?}: {shop:?}"
                    );
                }
            }
        }
        // All units can have their smallest buffer at once.
        let least = plan.machines.iter().map(|machine| machine.unit_buffer_min_bits.unwrap());
        let least = Service { buffers: least.collect(), ..plan.service() };
        let full = Options { feeds_while_filled: true, ..HALF };
        assert!(simulate(&shop, &least, Discipline::Slots, &full).holds(), "least, shop {number}");
        if plan.must_feed_while_filled() {
            // The check that the four constraints leave out: the line is too slow for units that
            // pause, in every round by a little.
            let long = Options { seconds: 36_000.0, ..HALF };
            let outcome = simulate(&shop, &service, Discipline::Slots, &long);
            assert!(outcome.ran_dry(), "must feed, shop {number}: {shop:?}");
        } else {
            *counts.entry("feasible without feeding while filled").or_insert(0) += 1;
        }
        if lines_are_quick(&shop, plan.machines.iter().map(|machine| machine.wait_seconds.unwrap()))
        {
            *counts.entry("feasible from the worst").or_insert(0) += 1;
            let worst = Options { start: Start::Worst, ..HALF };
            let outcome = simulate(&shop, &service, Discipline::Slots, &worst);
            assert!(outcome.holds() && outcome.recovers(), "worst, shop {number}: {shop:?}");
        }
    }
    println!("{counts:?}");
    assert!(counts["feasible"] >= 60 && counts["refused"] >= 60, "{counts:?}");
    assert!(counts["feasible without feeding while filled"] >= 30, "{counts:?}");
    assert!(counts["feasible from the worst"] >= 30, "{counts:?}");
}

/// Buffers that somebody might try where no plan is found.
fn tries(shop: &Shop, plan: &Plan, random: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let most = plan.service().buffers;
    let scaled = |factor: f64| most.iter().map(|bits| factor * bits).collect::<Vec<_>>();
    let mut tries: Vec<_> = [0.1, 0.5, 0.9, 0.999, 1.0, 1.1, 2.0].map(scaled).into();
    for _ in 0..5 {
        tries.push(most.iter().map(|bits| bits * (0.2 + 0.9 * part(random))).collect());
    }
    // What the mildest machine needs for its part of the bus.
    let load = shop.load();
    tries.push(
        shop.each()
            .map(|(_, machine)| machine.buffer_bits() / (1.0 - load).abs().max(0.01))
            .collect(),
    );
    tries
}

/// For each refused shop and all buffers that are tried, something fails when each control is empty
/// at the end of its first fill: a machine runs dry, or a control is not full when the next begins.
#[test]
fn what_is_refused_fails_from_the_worst_start() {
    let mut counts = BTreeMap::new();
    for number in 0..SHOPS {
        let mut random = random(number);
        let shop = any(&mut random);
        let plan = plan(&shop);
        if plan.feasible {
            continue;
        }
        *counts.entry("refused").or_insert(0) += 1;
        for buffers in tries(&shop, &plan, &mut random) {
            let worst = Options { start: Start::Worst, ..HALF };
            let service = Service { buffers, ..plan.service() };
            let outcome = simulate(&shop, &service, Discipline::Slots, &worst);
            assert!(
                !(outcome.holds() && outcome.recovers()),
                "shop {number}: {service:?} {shop:?}"
            );
        }
    }
    println!("{counts:?}");
    assert!(counts["refused"] >= 60, "{counts:?}");
}

/// A line that is too slow, or a bus that carries less than is taken, runs dry in every way that it
/// is driven.
#[test]
fn what_cannot_be_carried_runs_dry() {
    let mut counts = BTreeMap::new();
    for number in 0..SHOPS {
        let mut random = random(number);
        let shop = any(&mut random);
        let plan = plan(&shop);
        let is_slow = plan.machines.iter().any(|machine| machine.violated.contains(&1));
        let is_full = shop.load() >= 1.0;
        if !is_slow && !is_full {
            continue;
        }
        assert!(!plan.feasible, "shop {number}");
        *counts.entry(if is_full { "bus" } else { "line" }).or_insert(0) += 1;
        for feeds_while_filled in [false, true] {
            for discipline in [Discipline::Slots, Discipline::Scheduled, Discipline::Blind] {
                // The longer, the later it shows.
                let runs_dry = [60.0, 3_600.0, 360_000.0].into_iter().any(|seconds| {
                    let options = Options { feeds_while_filled, seconds, ..HALF };
                    simulate(&shop, &plan.service(), discipline, &options).ran_dry()
                });
                assert!(runs_dry, "shop {number}, {discipline:?}: {shop:?}");
            }
        }
    }
    println!("{counts:?}");
    assert!(counts["bus"] >= 20 && counts["line"] >= 5, "{counts:?}");
}

/// Shops that are refused although some buffers would do: machines that differ, of which one has a
/// large control. The model has its unit fill that control at once, and the others wait for it.
#[test]
fn where_the_model_is_cautious() {
    let mut counts = BTreeMap::new();
    for number in 0..SHOPS {
        let mut random = random(number);
        let shop = any(&mut random);
        let plan = plan(&shop);
        let is_slow = plan.machines.iter().any(|machine| machine.violated.contains(&1));
        if plan.feasible || is_slow || shop.load() >= 1.0 {
            continue;
        }
        // The shortest round in which the bus can carry what is taken; what is taken in it, and a
        // little more, is each unit's buffer.
        let machines = shop.each().count() as f64;
        let round = 1.001 * machines * shop.bus().switch / (1.0 - 1.0005 * shop.load());
        let buffers: Vec<f64> =
            shop.each().map(|(_, machine)| 1.0005 * machine.consumes * round).collect();
        let waits = waits(&shop, &buffers);
        let survives = shop.each().zip(&waits).zip(&buffers).all(|(((_, machine), wait), bits)| {
            let fill = bits / shop.bus().payload();
            machine.consumes * fill < machine.buffer_bits()
                && machine.line() * wait > machine.consumes * (wait + fill)
        });
        let service = Service { buffers, ..plan.service() };
        let outcome = simulate(&shop, &service, Discipline::Slots, &HALF);
        if survives && round > 0.0 {
            *counts.entry("refused, and yet runs").or_insert(0) += 1;
            assert!(outcome.holds(), "shop {number}: {shop:?}");
        } else {
            *counts.entry("refused, and runs dry").or_insert(0) += 1;
            assert!(!outcome.holds(), "shop {number}: {shop:?}");
        }
    }
    println!("{counts:?}");
    assert!(counts["refused, and yet runs"] >= 3, "{counts:?}");
}
