//! Fuel for each byte of an exchange, in the sandbox: one JSON object on
//! standard output. No time is measured: the figures are the same on every
//! machine, for one version of the engine.

mod common;

use serde_json::{Map, Value, json};
use softplug_abi::Instance;

fn main() {
    let mut figures = Map::new();
    for recording in common::recordings() {
        let plugin = common::module(recording.plugin);
        let mut session = plugin.instantiate().expect("an instance");
        for (event, now) in recording.events() {
            session.step(&event, now).unwrap_or_else(|fault| {
                panic!("{} takes every event: {fault}", recording.plugin.name())
            });
        }
        let name = format!("{}: {}", recording.plugin.name(), recording.name);
        let per_byte = session.total_fuel() as f64 / recording.bytes as f64;
        let rounded = (per_byte * 10.0).round() / 10.0;
        figures.insert(format!("{name}, fuel per byte"), json!(rounded));
        figures.insert(format!("{name}, most fuel of an event"), json!(session.largest_fuel()));
    }
    println!("{}", Value::Object(figures));
}
