//! Whole shops with plug-ins, as the planner plans them.

use softplug_abi::manifest::Manifest;
use softplug_link::LinkOptions;
use softplug_native::NativePlugin;
use softplug_plan::{Bus, DEFAULT_MARGIN, Machine, Shop, plan};
use softplug_shop::{Options, Simulated, Unit, simulate};

/// 100,000 bit/s of data.
fn shop(machines: Vec<Machine>) -> Shop {
    let bus = Bus { rate: 250_000.0, efficiency: 0.4, switch: 0.002, margin: DEFAULT_MARGIN };
    Shop::new(bus, machines).unwrap()
}

fn mills(count: u64) -> Machine {
    Machine {
        name: "mill".to_owned(),
        rate: 19_200.0,
        efficiency: 0.8,
        consumes: 6_000.0,
        buffer: 256,
        count,
    }
}

fn simulated(shop: &Shop, seconds: f64) -> Simulated {
    let plugin = NativePlugin::XonXoff;
    let manifest = Manifest::parse(plugin.manifest().as_bytes()).unwrap();
    let settings = manifest.resolve_settings([]).unwrap();
    let unit = || Unit {
        instance: plugin.instantiate(),
        options: LinkOptions { settings: settings.clone(), ..LinkOptions::default() },
    };
    let units = shop.each().map(|_| unit()).collect();
    let options = Options { seconds, keeps_levels: true };
    simulate(shop, &plan(shop).service(), units, &options, |_| {}).unwrap()
}

fn dry(simulated: &Simulated) -> u64 {
    simulated.outcome.machines.iter().map(|machine| machine.times_dry).sum()
}

#[test]
fn as_many_as_the_planner_allows_are_fed_and_one_more_is_not() {
    assert_eq!(plan(&shop(vec![mills(1)])).largest_equal, 16);
    let most = simulated(&shop(vec![mills(16)]), 600.0);
    assert!(most.holds(), "{:?}", most.altered);
    let load = most.bus.load.unwrap();
    assert!((0.9..=1.0).contains(&load), "{load}");

    let more = shop(vec![mills(17)]);
    assert!(!plan(&more).feasible);
    let more = simulated(&more, 600.0);
    assert!(dry(&more) > 0);
    assert_eq!(more.altered, Vec::<String>::new());
    assert!(more.outcome.machines.iter().all(|machine| machine.overflow_bits == 0.0));
}

#[test]
fn machines_that_differ_are_fed_as_planned() {
    let lathe = Machine {
        name: "lathe".to_owned(),
        rate: 9_600.0,
        consumes: 2_400.0,
        buffer: 128,
        ..mills(3)
    };
    let centre = Machine {
        name: "drilling centre".to_owned(),
        rate: 38_400.0,
        consumes: 9_000.0,
        buffer: 512,
        ..mills(4)
    };
    let shop = shop(vec![mills(8), lathe, centre]);
    assert!(plan(&shop).feasible);
    let fed = simulated(&shop, 600.0);
    assert!(fed.holds(), "{} times dry", dry(&fed));
    let levels = &fed.outcome.machines[0].levels;
    assert!(levels.len() > 1_000 && levels.is_sorted_by(|a, b| a.at < b.at));
}
