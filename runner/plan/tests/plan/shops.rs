//! Shops for tests: one like that of the model's paper, and random ones.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::Rng;
use softplug_plan::{Bus, DEFAULT_MARGIN, Machine, Shop};

/// A CAN bus of 250 kbit/s, of whose bits four in ten are data.
pub(crate) const CAN: Bus =
    Bus { rate: 250_000.0, efficiency: 0.4, switch: 0.002, margin: DEFAULT_MARGIN };

/// Machines with a line of 19,200 bit/s, eight of ten bits data.
pub(crate) fn mills(count: u64) -> Machine {
    Machine {
        name: "mill".to_owned(),
        rate: 19_200.0,
        efficiency: 0.8,
        consumes: 6_000.0,
        buffer: 256,
        count,
    }
}

pub(crate) fn shop(machines: Vec<Machine>) -> Shop {
    Shop::new(CAN, machines).unwrap()
}

/// A part of 1.
pub(crate) fn part(random: &mut ChaCha8Rng) -> f64 {
    f64::from(random.next_u32()) / f64::from(u32::MAX)
}

/// A number between two, each order of magnitude as likely as any other.
pub(crate) fn between(random: &mut ChaCha8Rng, least: f64, most: f64) -> f64 {
    least * (most / least).powf(part(random))
}

/// Any shop: few of its machines alike, some lines slow, and about half of them feasible.
pub(crate) fn any(random: &mut ChaCha8Rng) -> Shop {
    let bus = Bus {
        rate: between(random, 1e5, 1e7),
        efficiency: between(random, 0.2, 1.0),
        switch: between(random, 1e-5, 1e-2),
        margin: DEFAULT_MARGIN,
    };
    let kinds = 1 + random.next_u32() % 6;
    let load = between(random, 0.2, 3.0);
    let holds = between(random, 0.02, 2.0);
    let alike = between(random, 1.0, 4.0);
    let machines = (0..kinds).map(|kind| {
        let count = 1 + u64::from(random.next_u32() % 3);
        let share = load * bus.payload() / f64::from(kinds) / count as f64;
        let consumes = share * between(random, 1.0 / alike, 1.0);
        let line = between(random, 0.9, 30.0) * consumes;
        let bits = consumes * holds * between(random, 1.0 / alike, alike);
        Machine {
            name: format!("kind {kind}"),
            rate: line.max(1.0) / 0.8,
            efficiency: 0.8,
            consumes: consumes.max(1.0),
            buffer: (bits / 8.0).ceil() as u64,
            count,
        }
    });
    let machines = machines.collect();
    Shop::new(bus, machines).unwrap()
}
