//! The picture of a simulation.

use softplug_plan::{Discipline, Machine, Options, Service, Shop, picture, plan, simulate};

use crate::shops::{mills, shop};

fn drawn(shop: &Shop, service: &Service, seconds: f64) -> String {
    let options = Options { seconds, keeps_levels: true, ..Options::default() };
    picture(&simulate(shop, service, Discipline::Slots, &options))
}

#[test]
fn a_small_picture_is_drawn_as_ever() {
    let lathe = Machine { name: "lathe".to_owned(), consumes: 3_000.0, ..mills(1) };
    let shop = shop(vec![mills(2), lathe]);
    insta::assert_snapshot!(drawn(&shop, &plan(&shop).service(), 2.0));
}

#[test]
fn names_are_escaped_and_cut() {
    let hostile = Machine { name: "<script>\"&'</script> and on".to_owned(), ..mills(1) };
    let shop = shop(vec![hostile]);
    let svg = drawn(&shop, &plan(&shop).service(), 1.0);
    assert!(svg.contains(">&lt;script&gt;&quot;&amp;'&lt;/scri…</text>"), "{svg}");
    assert!(!svg.contains("<script"));
}

/// Names end at the frame, so one that is too wide would lose its beginning.
#[test]
fn wide_names_are_cut_sooner() {
    for (name, drawn_as) in [("W".repeat(38), "WWWWWWWWW…"), ("铣".repeat(12), "铣铣铣铣铣铣铣铣…")]
    {
        let shop = shop(vec![Machine { name, ..mills(1) }]);
        let svg = drawn(&shop, &plan(&shop).service(), 1.0);
        assert!(svg.contains(&format!(">{drawn_as}</text>")), "{svg}");
    }
}

/// An outcome may come from elsewhere: what XML cannot hold is not written.
#[test]
fn no_name_breaks_the_picture() {
    let shop = shop(vec![mills(1)]);
    let options = Options { seconds: 1.0, ..Options::default() };
    let mut outcome = simulate(&shop, &plan(&shop).service(), Discipline::Slots, &options);
    outcome.machines[0].name = "a\u{fffe}b\u{ffff}c\u{1}".to_owned();
    assert!(picture(&outcome).contains(">a\u{fffd}b\u{fffd}c\u{fffd}</text>"));
}

#[test]
fn of_many_machines_those_that_ran_dry_are_drawn() {
    let shop = shop(vec![mills(40)]);
    let mut service = plan(&shop).service();
    service.buffers[38] = 10.0;
    let svg = drawn(&shop, &service, 0.7);
    assert_eq!(svg.matches("class=\"frame\"").count(), 2 * 12);
    assert!(svg.contains("mill-39") && svg.contains("class=\"dry\""));
    assert!(svg.contains("and 28 more machines; those that ran dry are drawn first"));
    assert!(svg.len() < 20_000, "{}", svg.len());
}
