//! Machines that are alike: the plan, which goes the general way, against the closed forms, which
//! are written here once more.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use softplug_plan::{Bus, Machine, Shop, plan};

use crate::shops::{CAN, between, mills, shop};

/// What the closed forms need, with the margin in `p`.
struct Alike {
    m: f64,
    t: f64,
    bus: f64,
    p: f64,
    q: f64,
}

impl Alike {
    fn of(shop: &Shop) -> Self {
        let (bus, machine) = (shop.bus(), &shop.machines()[0]);
        Self {
            m: shop.each().count() as f64,
            t: bus.switch,
            bus: bus.payload(),
            p: machine.consumes / (1.0 - bus.margin),
            q: machine.buffer_bits(),
        }
    }

    fn least(&self) -> f64 {
        (self.p * self.m * self.t + self.q) * self.bus / (self.bus - (self.m - 1.0) * self.p)
    }

    fn most(&self) -> f64 {
        self.q * self.bus / self.p
    }

    fn machines(&self) -> f64 {
        self.q * self.bus / (self.p * self.p * self.t + self.p * self.q)
    }
}

fn near(one: f64, other: f64, part: f64) {
    assert!((one - other).abs() <= part * other.abs(), "{one} is not {other}");
}

#[test]
fn sixteen_mills_on_a_can_bus() {
    let sixteen = plan(&shop(vec![mills(16)]));
    assert!(sixteen.feasible);
    // 2048·100000/(6000²·0.002 + 6000·2048) = 16.57
    assert_eq!(sixteen.largest_equal, 16);
    assert_eq!(sixteen.machines.len(), 16);
    let first = &sixteen.machines[0];
    assert_eq!(first.name, "mill-1");
    // (6000·16·0.002 + 2048)·100000/(100000 − 15·6000) = 22400, 2048·100000/6000 = 34133.3
    near(first.unit_buffer_min_bits.unwrap(), 22_400.0, 1e-4);
    near(first.unit_buffer_max_bits.unwrap(), 34_133.333, 1e-4);
    // All alike: all can have their largest.
    near(first.unit_buffer_bits.unwrap(), first.unit_buffer_max_bits.unwrap(), 1e-6);
    assert_eq!(sixteen.machines[0].unit_buffer_bits, sixteen.machines[15].unit_buffer_bits);
    assert!(!sixteen.must_feed_while_filled());

    let seventeen = plan(&shop(vec![mills(17)]));
    assert!(!seventeen.feasible);
    assert_eq!(seventeen.largest_equal, 16);
    assert!(seventeen.machines.iter().all(|machine| machine.violated == [3]));
    assert!(seventeen.machines.iter().all(|machine| machine.unit_buffer_bits.is_none()));
}

#[test]
fn the_bound_itself_is_not_reached() {
    // 1000·10⁵/(1000²·0 + 1000·10⁴…): with no switch the bound is R/p, here 10 exactly.
    let bus = Bus { rate: 1e5, efficiency: 1.0, switch: 0.0, ..CAN };
    let machine = |count| Machine { consumes: 1e4, rate: 1e5, ..mills(count) };
    let shop = |count| Shop::new(bus, vec![machine(count)]).unwrap();
    assert_eq!(plan(&shop(1)).largest_equal, 9);
    assert!(plan(&shop(9)).feasible);
    assert!(!plan(&shop(10)).feasible);
}

#[test]
fn random_shops_of_machines_that_are_alike() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let (mut feasible, mut refused) = (0, 0);
    for number in 0..500 {
        let payload = between(&mut random, 1e3, 1e9);
        let consumes = payload / between(&mut random, 1.5, 300.0);
        let machine = |count| Machine {
            name: "m".to_owned(),
            rate: between(&mut ChaCha8Rng::seed_from_u64(number), 2.0, 40.0) * consumes,
            efficiency: 0.7,
            consumes,
            buffer: between(&mut ChaCha8Rng::seed_from_u64(!number), 1.0, 1e6) as u64,
            count,
        };
        let switch = between(&mut random, 1e-7, 1.0);
        let bus = Bus { rate: 2.0 * payload, efficiency: 0.5, switch, margin: 1e-6 };
        let shop = |count| Shop::new(bus, vec![machine(count)]).unwrap();
        let most = Alike::of(&shop(1)).machines().floor();
        assert_eq!(plan(&shop(1)).largest_equal, most as u64, "shop {number}");

        // At the most, one more, and some number below.
        for count in [most as u64, most as u64 + 1, 1 + random.next_u64() % most.max(1.0) as u64] {
            if !(1..=1_000).contains(&count) {
                continue;
            }
            let (plan, alike) = (plan(&shop(count)), Alike::of(&shop(count)));
            assert_eq!(plan.feasible, count as f64 <= most, "shop {number} of {count}");
            if !plan.feasible {
                refused += 1;
                continue;
            }
            feasible += 1;
            for machine in &plan.machines {
                near(machine.unit_buffer_min_bits.unwrap(), alike.least(), 1e-9);
                near(machine.unit_buffer_max_bits.unwrap(), alike.most(), 1e-9);
                near(machine.unit_buffer_bits.unwrap(), alike.most(), 1e-6);
            }
        }
    }
    assert!(feasible > 500 && refused > 300, "{feasible} feasible, {refused} refused");
}

#[test]
fn a_margin_is_what_each_machine_could_take_more() {
    let with = Bus { margin: 0.2, ..CAN };
    let planned = plan(&Shop::new(with, vec![mills(8)]).unwrap());
    let hungrier = Machine { consumes: 6_000.0 / 0.8, ..mills(8) };
    let same = plan(&shop(vec![hungrier]));
    assert_eq!(planned.largest_equal, same.largest_equal);
    near(
        planned.machines[0].unit_buffer_min_bits.unwrap(),
        same.machines[0].unit_buffer_min_bits.unwrap(),
        1e-5,
    );
}

/// What is lost in reckoning is no wait: its line would have to carry more than there is.
#[test]
fn a_machine_alone_on_a_bus_that_does_not_switch_never_waits() {
    for efficiency in [0.612_283_487_339_991, 0.5, 0.3, 0.9, 0.123_456_789] {
        let bus = Bus { rate: 250_000.0, efficiency, switch: 0.0, margin: 0.05 };
        let machine = Machine {
            name: "mill".to_owned(),
            rate: 38_400.0,
            efficiency: 0.5,
            consumes: 4_303.0,
            buffer: 1_024,
            count: 1,
        };
        let plan = plan(&Shop::new(bus, vec![machine]).unwrap());
        let first = &plan.machines[0];
        assert!(plan.feasible);
        assert_eq!(first.line_needed_bits_per_second, None, "{efficiency}");
        assert_eq!((first.wait_seconds, first.must_feed_while_filled), (Some(0.0), Some(true)));
    }
}
