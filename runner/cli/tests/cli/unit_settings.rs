//! Settings of a unit's plug-in: of `unit.toml`, by hand, and where they cannot be kept.

use std::fs;

use serde_json::Value;

use crate::bench::Bench;
use crate::unit::{Unit, bench};

fn with_settings(settings: &str) -> Bench {
    let bench = bench("unsigned = true");
    let text = String::from_utf8(bench.read("unit.toml")).unwrap();
    bench.write("unit.toml", format!("{text}settings = {{ {settings} }}\n"));
    bench
}

fn kept(bench: &Bench) -> Option<String> {
    fs::read_to_string(bench.path("state/mill.settings")).ok()
}

fn link(unit: &Unit, bench: &Bench) -> Value {
    unit.list(bench)["units"][0]["links"][0].clone()
}

#[test]
fn those_of_the_configuration_hold_until_others_are_sent() {
    let bench = with_settings("quiet_time = \"701\"");
    let unit = Unit::start(&bench);
    unit.flash(&bench, &[]).with_code(0);
    assert_eq!(kept(&bench), None);
    drop(unit);
    // Nor does a start keep them: they may be changed.
    let unit = Unit::start(&bench);
    unit.flash(&bench, &[]).with_code(0);
    assert_eq!(kept(&bench), None);
    unit.flash(&bench, &["--set", "quiet_time=702"]).with_code(0);
    assert_eq!(kept(&bench).as_deref(), Some("quiet_time\x00702\0"));
    // By hand, without any, those that were sent last hold.
    unit.flash(&bench, &[]).with_code(0);
    assert_eq!(kept(&bench).as_deref(), Some("quiet_time\x00702\0"));
}

#[test]
fn those_that_a_plug_in_does_not_take_are_told() {
    let bench = with_settings("volume = \"11\"");
    let unit = Unit::start(&bench);
    let ran = unit.flash(&bench, &[]).with_code(1);
    assert!(
        ran.err.contains("it does not take its settings") && ran.err.contains("volume"),
        "{ran}"
    );
    unit.flash(&bench, &["--set", "quiet_time=702"]).with_code(0);
    // A list says it, too.
    drop(unit);
    fs::remove_file(bench.path("state/mill.settings")).unwrap();
    let unit = Unit::start(&bench);
    let mut link = link(&unit, &bench);
    while link["trouble"].is_null() {
        link = self::link(&unit, &bench);
    }
    assert!(link["trouble"].as_str().unwrap().contains("it does not take its settings"), "{link}");
    assert!(link["runs"].is_null(), "{link}");
}

#[test]
fn those_that_cannot_be_kept_are_refused_and_the_old_ones_go_on() {
    let bench = bench("unsigned = true");
    let unit = Unit::start(&bench);
    unit.flash(&bench, &["--set", "quiet_time=701"]).with_code(0);
    let runs = link(&unit, &bench)["runs"].clone();
    // No file takes the place of a folder, whoever asks for it.
    fs::remove_file(bench.path("state/mill.settings")).unwrap();
    fs::create_dir(bench.path("state/mill.settings")).unwrap();
    let ran = unit.flash(&bench, &["--set", "quiet_time=702"]).with_code(1);
    assert!(ran.err.contains("its settings cannot be kept in"), "{ran}");
    assert_eq!(link(&unit, &bench)["runs"], runs);
    fs::remove_dir(bench.path("state/mill.settings")).unwrap();
    unit.flash(&bench, &["--set", "quiet_time=703"]).with_code(0);
    assert_eq!(kept(&bench).as_deref(), Some("quiet_time\x00703\0"));
}
