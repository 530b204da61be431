//! What would mend a shop does mend it, and less does not.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use softplug_plan::{Bus, Change, Machine, Parameter, Shop, plan};

use crate::shops::{any, mills, shop};

/// The shop with this change, or with so much of it.
fn with(shop: &Shop, change: &Change, part: f64) -> Option<Shop> {
    let to = change.from + part * (change.to - change.from);
    let mut bus: Bus = *shop.bus();
    let mut machines: Vec<Machine> = shop.machines().to_vec();
    let index = machines.iter().position(|machine| Some(&machine.name) == change.machine.as_ref());
    let machine = index.map(|index| &mut machines[index]);
    match (change.parameter, machine) {
        (Parameter::BusRate, None) => bus.rate = to,
        (Parameter::Switch, None) => bus.switch = to,
        (Parameter::ConsumesOfAll, None) => {
            for machine in &mut machines {
                machine.consumes *= to;
            }
        }
        (Parameter::Rate, Some(machine)) => machine.rate = to,
        (Parameter::Consumes, Some(machine)) => machine.consumes = to,
        (Parameter::Buffer, Some(machine)) => machine.buffer = to.round() as u64,
        (Parameter::Count, Some(machine)) => machine.count = to.round() as u64,
        (parameter, machine) => panic!("{parameter:?} of {machine:?}"),
    }
    machines.retain(|machine| machine.count > 0);
    Shop::new(bus, machines).ok()
}

#[test]
fn random_shops_are_mended_and_not_by_less() {
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut kinds = std::collections::BTreeMap::new();
    for number in 0..400 {
        let shop = any(&mut random);
        let plan_now = plan(&shop);
        assert_eq!(plan_now.advice.as_ref(), plan_now.changes.first());
        assert_eq!(plan_now.feasible, plan_now.changes.is_empty(), "shop {number}");
        assert!(plan_now.changes.is_sorted_by(|one, other| one.relative <= other.relative));
        for change in &plan_now.changes {
            *kinds.entry(format!("{:?}", change.parameter)).or_insert(0) += 1;
            let mended = with(&shop, change, 1.0).expect("what is advised can be written down");
            assert!(plan(&mended).feasible, "shop {number}: {change} in {shop:?}");
            let less = match change.parameter {
                Parameter::Count | Parameter::Buffer => 1.0 - 1.0 / (change.to - change.from).abs(),
                // What is rounded to four digits may be more than a small change needs.
                _ if change.relative < 0.05 => continue,
                _ => 0.98,
            };
            let short = with(&shop, change, less).unwrap();
            assert!(!plan(&short).feasible, "shop {number}: less than {change} in {shop:?}");
        }
    }
    assert_eq!(kinds.len(), 7, "{kinds:?}");
}

#[test]
fn seventeen_mills_are_told_what_to_do() {
    let plan = plan(&shop(vec![mills(17)]));
    let said: Vec<_> = plan.changes.iter().map(ToString::to_string).collect();
    let mends = [
        "consumes of mill down to 5848 bit/s (-2.5 %)",
        "rate of the bus up to 256500 bit/s (+2.6 %)",
        "count of mill down to 16 (-5.9 %)",
    ];
    assert_eq!(said, mends);
    assert_eq!(plan.advice.unwrap().to_string(), said[0]);
}

#[test]
fn a_large_control_can_be_in_the_way_of_the_others() {
    let small = Machine { name: "small".to_owned(), buffer: 64, ..mills(6) };
    let large = Machine { name: "large".to_owned(), buffer: 65_536, ..mills(1) };
    let plan = plan(&shop(vec![small, large]));
    assert!(!plan.feasible);
    assert!(
        plan.machines
            .iter()
            .all(|machine| machine.violated
                == if machine.name == "large" { vec![] } else { vec![3] })
    );
    let of_large = |change: &&Change| {
        change.machine.as_deref() == Some("large") && change.parameter == Parameter::Buffer
    };
    let change = plan.changes.iter().find(of_large).unwrap();
    assert!(change.to < change.from, "{change}");
}

#[test]
fn what_every_machine_takes_is_ranked_with_all_else() {
    let lathes = Machine { name: "lathe".to_owned(), ..mills(8) };
    let plan = plan(&shop(vec![mills(9), lathes]));
    let said: Vec<_> = plan.changes.iter().map(ToString::to_string).collect();
    assert_eq!(said[0], "consumes of every machine down to 0.9748 of what it is (-2.5 %)");
    assert_eq!(said[1], "rate of the bus up to 256500 bit/s (+2.6 %)");
    assert_eq!(plan.advice.as_ref(), plan.changes.first());
}

/// A machine that already takes the least that a file may have cannot take less.
#[test]
fn no_machine_is_advised_to_take_less_than_a_file_may_have() {
    let slow = Machine { name: "slow".to_owned(), consumes: 1.0, buffer: 1, ..mills(1) };
    let plan = plan(&shop(vec![mills(17), slow.clone()]));
    let of_all = |change: &Change| change.parameter == Parameter::ConsumesOfAll;
    assert!(!plan.feasible && !plan.changes.iter().any(of_all), "{:?}", plan.changes);
    let two = Machine { consumes: 2.0, ..slow };
    let shop = shop(vec![mills(17), two]);
    let changes = softplug_plan::plan(&shop).changes;
    let change = changes.iter().find(|change| of_all(change)).unwrap();
    assert!(change.to >= 0.5 && with(&shop, change, 1.0).is_some(), "{change}");
}

#[test]
fn only_nothing_is_less_by_all_of_it() {
    let percent = |from: f64, to: f64| {
        let relative = (to - from).abs() / from;
        let change =
            Change { parameter: Parameter::Switch, machine: None, from, to, relative }.to_string();
        change.split_once(" (").unwrap().1.trim_end_matches(')').to_owned()
    };
    let shown = [
        (1.0, 0.006),
        (1.0, 0.004),
        (1.0, 0.0031),
        (1.0, 0.0001),
        (1.0, 1e-12),
        (60.0, 1e-20),
        (1.0, 0.0),
        (1.0, 1.996),
    ]
    .map(|(from, to)| percent(from, to));
    let said = [
        "-99 %",
        "-99.6 %",
        "-99.7 %",
        "-99.99 %",
        "-99.9999999999 %",
        "-99.999999999999 %",
        "-100 %",
        "+100 %",
    ];
    assert_eq!(shown, said);
}
