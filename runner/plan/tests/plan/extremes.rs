//! Numbers at the ends of what can be meant: nothing overflows, and nothing is said that is no number.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde_json::Value;
use softplug_plan::{
    Bus, Discipline, LEAST_RATE, MOST_BUFFER, MOST_MARGIN, MOST_RATE, MOST_SWITCH, Machine,
    Options, Shop, Start, picture_of, plan, simulate,
};

use crate::shops::between;

/// One of the ends, or anything between.
fn end(random: &mut ChaCha8Rng, least: f64, most: f64) -> f64 {
    match random.next_u32() % 4 {
        0 => least,
        1 => most,
        _ => between(random, least, most),
    }
}

fn shop(random: &mut ChaCha8Rng) -> Shop {
    let switch = end(random, 1e-9, MOST_SWITCH);
    let bus = Bus {
        rate: end(random, LEAST_RATE, MOST_RATE),
        efficiency: end(random, 0.001, 1.0),
        switch: if random.next_u32().is_multiple_of(4) { 0.0 } else { switch },
        margin: end(random, 1e-6, MOST_MARGIN),
    };
    let kinds = 1 + random.next_u32() % 3;
    let machine = |kind: u32| Machine {
        name: format!("kind {kind}"),
        rate: end(random, LEAST_RATE, MOST_RATE),
        efficiency: end(random, 0.001, 1.0),
        consumes: end(random, LEAST_RATE, MOST_RATE),
        buffer: end(random, 1.0, MOST_BUFFER as f64) as u64,
        count: end(random, 1.0, 300.0) as u64,
    };
    let machines = (0..kinds).map(machine).collect();
    Shop::new(bus, machines).unwrap()
}

/// The shop in which every machine takes as much less as a file may say.
fn slowest(shop: &Shop) -> Shop {
    let mut machines = shop.machines().to_vec();
    let least = machines.iter().map(|machine| machine.consumes).fold(f64::INFINITY, f64::min);
    for machine in &mut machines {
        machine.consumes *= LEAST_RATE / least;
    }
    Shop::new(*shop.bus(), machines).unwrap()
}

/// Whether all that must have a number has one: JSON has no other way to say infinite than null.
fn has_numbers(plan: &Value) -> bool {
    let has = |value: &Value, keys: &[&str]| keys.iter().all(|key| value[*key].is_number());
    let always = ["unit_buffer_min_bits", "unit_buffer_max_bits", "unit_buffer_bits"];
    let times = ["fill_seconds", "wait_seconds"];
    let machines = plan["machines"].as_array().unwrap().iter();
    let changes = plan["changes"].as_array().unwrap().iter();
    let is_feasible = plan["feasible"] == true;
    has(&plan["bus"], &["payload_bits_per_second", "load", "margin"])
        && machines.into_iter().all(|it| !is_feasible || has(it, &always) && has(it, &times))
        && changes.into_iter().all(|change| has(change, &["from", "to", "relative"]))
}

#[test]
fn shops_of_all_sizes_are_planned_drawn_and_simulated() {
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let mut feasible = 0;
    for number in 0..1_000 {
        let shop = shop(&mut random);
        let plan = plan(&shop);
        feasible += u64::from(plan.feasible);
        let value = serde_json::to_value(&plan).unwrap();
        assert!(has_numbers(&value), "shop {number}: {shop:?} {value}");
        // Advice may fail only where not even the slowest shop that can be written down would do.
        let may_lack = plan.feasible || !softplug_plan::plan(&slowest(&shop)).feasible;
        assert!(!plan.feasible || plan.advice.is_none(), "shop {number}: {shop:?}");
        assert!(may_lack || plan.advice.is_some(), "shop {number}: {shop:?}");
        assert_eq!(
            plan.feasible,
            plan.machines.iter().all(|machine| machine.violated.is_empty()),
            "shop {number}: {shop:?}"
        );
        for machine in plan.machines.iter().filter(|_| plan.feasible) {
            let [least, chosen, most] = [
                machine.unit_buffer_min_bits,
                machine.unit_buffer_bits,
                machine.unit_buffer_max_bits,
            ]
            .map(Option::unwrap);
            assert!(
                least <= chosen * (1.0 + 1e-9) && chosen <= most * (1.0 + 1e-9),
                "shop {number}"
            );
        }
        for discipline in [Discipline::Slots, Discipline::Scheduled, Discipline::Blind] {
            for start in [Start::Full, Start::Worst] {
                let options = Options { start, most_services: 200, ..Options::default() };
                let outcome = simulate(&shop, &plan.service(), discipline, &options);
                assert!(outcome.seconds.is_finite(), "shop {number}");
            }
        }
        if number % 50 == 0 {
            let svg = picture_of(&shop, &plan);
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "shop {number}: {svg}");
        }
    }
    assert!(feasible > 50, "{feasible}");
}
