//! The scheduler of a live bus at the planner's largest number of machines, and with one more.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use softplug_plan::{Bus, Discipline, Machine, Options, Shop, plan, simulate};

use crate::shops::part;

/// Machines that are alike on a bus, both at random; lines that bring what units that pause need.
fn random(number: u64) -> (Bus, Machine) {
    let mut random = ChaCha8Rng::seed_from_u64(number);
    let mut between = |from: f64, to: f64| from + (to - from) * part(&mut random);
    let consumes = between(500.0, 20_000.0).round();
    let machine = Machine {
        name: "mill".to_owned(),
        rate: 3.0 * consumes,
        efficiency: 0.8,
        consumes,
        buffer: between(64.0, 2_048.0) as u64,
        count: 1,
    };
    let rate = consumes * between(8.0, 40.0);
    (Bus { rate, efficiency: 0.5, switch: between(0.0, 0.02), margin: 1e-6 }, machine)
}

#[test]
fn none_starves_at_the_largest_number_of_machines_and_some_do_with_one_more() {
    for number in 0..24 {
        let (bus, machine) = random(number);
        let of = |count| Shop::new(bus, vec![Machine { count, ..machine.clone() }]).unwrap();
        let most = plan(&of(1)).largest_equal;
        assert!(most >= 2, "shop {number}");
        let run = |count, seconds| {
            let (shop, options) = (of(count), Options { seconds, ..Options::default() });
            simulate(&shop, &plan(&shop).service(), Discipline::Scheduled, &options)
        };
        assert!(plan(&of(most)).feasible && run(most, 1_800.0).holds(), "shop {number}, {most}");
        // The less is missing, the later it shows.
        let mut spans = [600.0, 6_000.0, 60_000.0].into_iter();
        let is_dry = spans.any(|seconds| run(most + 1, seconds).ran_dry());
        assert!(!plan(&of(most + 1)).feasible && is_dry, "shop {number}, {most}");
    }
}
