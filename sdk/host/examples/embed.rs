//! Runs a plug-in: `cargo run --example embed -- PLUGIN.wasm < BYTES`.
//!
//! Sends standard input through the plug-in as if it came from a serial line and
//! prints what the plug-in asks for.

use softplug_abi::{Action, Actions, Event, Instance, LineParameters, Micros};
use softplug_host::{Host, HostOptions, Session};
use std::error::Error;
use std::io::Read;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let path = PathBuf::from(std::env::args_os().nth(1).ok_or("usage: embed PLUGIN.wasm")?);
    let mut input = Vec::new();
    std::io::stdin().read_to_end(&mut input)?;

    let host = Host::new(HostOptions::default())?;
    let plugin = host.load(&path)?;
    println!("{} {} on {}", plugin.manifest().name, plugin.digest(), host.engine());

    let mut session = plugin.instantiate()?;
    session.configure(&plugin.manifest().resolve_settings([])?, Micros::ZERO)?;
    let line = LineParameters::new(9_600);
    let open = Event::Open { resumed: false, line, transmit_room: 4_096, delivery_room: 4_096 };
    give(&mut session, &open, Micros::ZERO)?;

    let mut now = Micros::ZERO;
    for bytes in input.chunks(64) {
        now = now + line.characters(bytes.len() as u64);
        give(&mut session, &Event::Received(bytes), now)?;
    }
    give(&mut session, &Event::Close, now)?;
    println!("{} units of fuel", session.total_fuel());
    Ok(())
}

fn give(session: &mut Session, event: &Event<'_>, now: Micros) -> Result<(), Box<dyn Error>> {
    let mut output = session.step(event, now)?;
    loop {
        for action in Actions::new(output.actions) {
            match action? {
                Action::Transmit { bytes, .. } => {
                    println!("{now} transmit {}", bytes.escape_ascii());
                }
                other => println!("{now} {other:?}"),
            }
        }
        if !output.more {
            return Ok(());
        }
        output = session.step(&Event::Continue, now)?;
    }
}
