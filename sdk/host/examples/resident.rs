//! Measures the resident memory of a further instance, on Linux:
//! `cargo run --release --example resident [PLUGIN.wasm]`.
//!
//! 1,000 instances are opened and take one byte each; the growth is divided by their number.

use softplug_abi::{Event, Instance, LineParameters, Micros, Parity};
use softplug_host::{Host, HostOptions, Session};
use std::error::Error;
use std::path::Path;

const INSTANCES: usize = 1_000;

fn main() -> Result<(), Box<dyn Error>> {
    let host = Host::new(HostOptions::default())?;
    let plugin = match std::env::args_os().nth(1) {
        Some(path) => host.load(Path::new(&path))?,
        None => host.load_bytes(&wat::parse_str(include_str!("../tests/guests/echo.wat"))?)?,
    };
    // The first pays for what all share.
    let mut sessions = Vec::with_capacity(INSTANCES + 1);
    sessions.push(stepped(&plugin)?);
    let before = resident_bytes()?;
    for _ in 0..INSTANCES {
        sessions.push(stepped(&plugin)?);
    }
    let grown = resident_bytes()?.saturating_sub(before);
    println!("{{\"bytes_per_instance\":{}}}", grown / INSTANCES as u64);
    Ok(())
}

fn stepped(plugin: &softplug_host::Plugin) -> Result<Session, Box<dyn Error>> {
    let mut session = plugin.instantiate()?;
    session.configure(&plugin.manifest().resolve_settings([])?, Micros::ZERO)?;
    let line =
        LineParameters { baud: 115_200, data_bits: 8, parity: Parity::None, stop_half_bits: 2 };
    let (transmit_room, delivery_room) = (4_096, 4_096);
    let open = Event::Open { resumed: false, line, transmit_room, delivery_room };
    session.step(&open, Micros::ZERO)?;
    session.step(&Event::Received(b"N"), Micros(1))?;
    Ok(session)
}

fn resident_bytes() -> Result<u64, Box<dyn Error>> {
    let statm = std::fs::read_to_string("/proc/self/statm")?;
    let pages: u64 = statm.split(' ').nth(1).ok_or("statm has no second field")?.parse()?;
    Ok(pages * 4_096)
}
