//! Ten hours at the largest shop that is feasible, and what happens with one machine more.

use softplug_plan::{
    Bus, Discipline, Machine, MachineOutcome, Options, Service, Shop, Start, plan, simulate,
};

use crate::shops::{CAN, mills, shop};

/// Three kinds of machines, so many of each.
fn unequal(count: u64) -> Shop {
    let lathe = Machine {
        name: "lathe".to_owned(),
        rate: 9_600.0,
        consumes: 2_400.0,
        buffer: 128,
        ..mills(count)
    };
    let centre = Machine {
        name: "centre".to_owned(),
        rate: 38_400.0,
        consumes: 9_000.0,
        buffer: 512,
        ..mills(count)
    };
    shop(vec![mills(count), lathe, centre])
}

fn planned(shop: &Shop) -> Service {
    plan(shop).service()
}

#[test]
fn ten_hours_at_the_largest_shop_of_equal_machines() {
    let shop = shop(vec![mills(16)]);
    for discipline in [Discipline::Slots, Discipline::Scheduled] {
        let outcome = simulate(&shop, &planned(&shop), discipline, &Options::default());
        assert!(outcome.holds(), "{discipline:?}");
        assert!(outcome.is_complete);
        assert!(outcome.services > 100_000, "{discipline:?}: {}", outcome.services);
    }
}

#[test]
fn ten_hours_at_the_largest_shop_of_unequal_machines() {
    let most = (1..100).take_while(|count| plan(&unequal(*count)).feasible).last().unwrap();
    assert_eq!(most, 5);
    let shop = unequal(most);
    for discipline in [Discipline::Slots, Discipline::Scheduled] {
        let outcome = simulate(&shop, &planned(&shop), discipline, &Options::default());
        assert!(outcome.holds(), "{discipline:?}");
        let more = unequal(most + 1);
        assert!(!plan(&more).feasible);
        assert!(simulate(&more, &planned(&more), discipline, &Options::default()).ran_dry());
    }
}

/// With one machine more the least buffers and the largest, and all between and around, run dry,
/// also on a bus that could carry what is taken: the bound on machines that are alike is exact for
/// units that cannot feed while they are filled.
#[test]
fn one_more_equal_machine_runs_dry_whatever_the_buffers_are() {
    // A slow switch leaves the bus idle enough: 15 mills take nine tenths of it.
    let slow = Shop::new(Bus { switch: 0.05, ..CAN }, vec![mills(15)]).unwrap();
    assert!(slow.load() <= 0.9);
    for shop in [shop(vec![mills(17)]), slow] {
        let planned = plan(&shop);
        assert!(!planned.feasible && planned.largest_equal + 1 == planned.machines.len() as u64);
        for kilobits in [1, 2, 5, 10, 20, 22, 30, 34, 35, 50, 100, 1_000] {
            let buffers = vec![f64::from(kilobits) * 1e3; planned.machines.len()];
            let service = Service { buffers, ..planned.service() };
            for discipline in [Discipline::Slots, Discipline::Scheduled] {
                let runs_dry = [60.0, 36_000.0].into_iter().any(|seconds| {
                    let options = Options { seconds, ..Options::default() };
                    simulate(&shop, &service, discipline, &options).ran_dry()
                });
                assert!(runs_dry, "{kilobits} kbit, {discipline:?}");
            }
        }
    }
}

/// In the morning all are empty, and a machine that has not begun is not fed at the cost of one that
/// works.
#[test]
fn a_shop_that_is_switched_on_runs_dry_nowhere() {
    let hall = Bus { rate: 2_000_000.0, efficiency: 0.5, switch: 0.01, margin: 0.01 };
    let lathes = Machine { consumes: 14_400.0, buffer: 512, rate: 19_200.0, ..mills(66) };
    let hall = Shop::new(hall, vec![lathes]).unwrap();
    for shop in [shop(vec![mills(16)]), unequal(5), hall] {
        assert!(plan(&shop).feasible);
        let options = Options { start: Start::Empty, keeps_levels: true, ..Options::default() };
        let outcome = simulate(&shop, &planned(&shop), Discipline::Scheduled, &options);
        assert_eq!(outcome.machines.iter().map(|machine| machine.times_dry).sum::<u64>(), 0);
        let is_fed = |machine: &MachineOutcome| machine.levels.iter().any(|at| at.control > 0.0);
        assert!(outcome.machines.iter().all(is_fed));
    }
}

/// And there the model is cautious: a bus that is not loaded to the full could feed more, if the
/// units fed their controls while they are filled.
#[test]
fn units_that_feed_while_they_are_filled_go_beyond_the_bound() {
    // A slow switch, so that there is room between the bound and what the bus carries.
    let bus = Bus { switch: 0.05, ..CAN };
    let one = Shop::new(bus, vec![mills(1)]).unwrap();
    let most = plan(&one).largest_equal;
    assert_eq!(most, 14);
    let shop = Shop::new(bus, vec![mills(most + 1)]).unwrap();
    assert!(!plan(&shop).feasible && shop.load() < 1.0);
    // A round of S = 60 kbit takes 15·(0.6 s + 0.05 s), in which a machine takes 58.5 kbit.
    let service = Service { buffers: vec![60e3; 15], ..planned(&shop) };
    for (feeds_while_filled, holds) in [(true, true), (false, false)] {
        let options = Options { feeds_while_filled, ..Options::default() };
        let outcome = simulate(&shop, &service, Discipline::Slots, &options);
        assert_eq!(outcome.holds(), holds, "feeds while filled: {feeds_while_filled}");
    }
}

#[test]
fn a_unit_that_is_not_asked_how_much_room_it_has_overflows() {
    let shop = shop(vec![mills(4)]);
    let options = Options { seconds: 60.0, ..Options::default() };
    let outcome = simulate(&shop, &planned(&shop), Discipline::Blind, &options);
    assert!(outcome.machines.iter().all(|machine| machine.overflow_bits > 0.0));
    assert!(!outcome.holds() && !outcome.ran_dry());
}

/// The arithmetic of the simulation by hand: one machine, never served again.
#[test]
fn a_machine_that_is_not_served_lives_on_what_there_is() {
    let shop = shop(vec![mills(1)]);
    let service = Service { buffers: vec![9_952.0], order: vec![] };
    let options = Options { seconds: 3.0, keeps_levels: true, ..Options::default() };
    // Nobody is in the order, so time does not go on by services.
    let outcome = simulate(&shop, &service, Discipline::Scheduled, &options);
    assert!(outcome.is_complete);
    let machine = &outcome.machines[0];
    // 9952 + 2048 bits at 6000 bit/s last 2 s; the third second is dry.
    assert_eq!(machine.times_dry, 1);
    assert!(
        (machine.dry[0].from - 2.0).abs() < 1e-9 && (machine.dry[0].seconds - 1.0).abs() < 1e-9
    );
    let empty = machine.levels.iter().find(|sample| sample.unit == 0.0).unwrap();
    assert!((empty.at - 9_952.0 / 6_000.0).abs() < 1e-9 && empty.control >= 2_048.0);
}
