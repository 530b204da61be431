//! Plug-ins that trap, loop, eat memory or lie on some links: the others notice
//! nothing, and each fault is told with what led there.

#![cfg(target_os = "linux")]

use std::collections::HashMap;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use crate::load::{Fragile, Guests, HOSTILE, Load, Machine, PATIENCE, pattern};
use softplug_abi::EventKind;
use softplug_abi::manifest::SettingValues;
use softplug_live::reactor::LaneId;

const LINKS: u32 = 100;
const HOSTILE_LINKS: u32 = 10;
const BYTES: usize = 1_500;

#[test]
fn ninety_links_notice_nothing_of_ten_hostile_ones() {
    // The instances of failed plug-ins are dropped by another thread, which may be late.
    let guests = Rc::new(Guests::load(512));
    let echo = Rc::clone(&guests);
    let mut load = Load::new(SettingValues::default(), 1_024, move || echo.echo());
    let machines: Vec<Machine> = (0..LINKS)
        .map(|link| {
            let instance =
                if link < HOSTILE_LINKS { guests.hostile(link as usize) } else { guests.echo() };
            let (_, pty) =
                load.add_plugin(19_200, Fragile::sound(instance), SettingValues::default());
            // Those that harm themselves go on for as long as it takes.
            let bytes = if link < HOSTILE_LINKS { 20 * BYTES } else { BYTES };
            Machine::new(pty, pattern(link, bytes), 1_500).without_holds()
        })
        .collect();
    load.wait_until_up();
    let stop = Arc::new(AtomicBool::new(false));
    let running = Machine::run_all(machines, Arc::clone(&stop));

    // Whoever has failed gets a fresh instance at once, and fails again.
    let mut replaced: HashMap<LaneId, usize> = HashMap::new();
    let echoed = |load: &Load<_>| {
        let sent = |link| load.reactor.status(LaneId(link + 1)).unwrap().read().bytes_out;
        (HOSTILE_LINKS..LINKS).all(|link| sent(link) >= BYTES as u64)
    };
    let have_failed = |load: &Load<_>| {
        (0..HOSTILE_LINKS).all(|link| load.lanes[&LaneId(link + 1)].faults.len() > 3)
    };
    let end = Instant::now() + PATIENCE;
    while !(echoed(&load) && have_failed(&load)) {
        assert!(Instant::now() < end, "some neither echo nor fail");
        load.look();
        for link in 0..HOSTILE_LINKS {
            let lane = LaneId(link + 1);
            let faults = load.lanes[&lane].faults.len();
            if faults > *replaced.entry(lane).or_default() {
                replaced.insert(lane, faults);
                let instance = Fragile::sound(guests.hostile(link as usize));
                load.replace(lane, instance, SettingValues::default());
            }
        }
    }
    stop.store(true, Ordering::Relaxed);
    let machines = running.join().unwrap();
    for (link, machine) in (0..LINKS).zip(&machines) {
        let lane = &load.lanes[&LaneId(link + 1)];
        if link >= HOSTILE_LINKS {
            assert_eq!(lane.faults, []);
            // What is still on its way when the machines stop is not looked at.
            let echoed = &machine.received;
            assert!(pattern(link, BYTES).starts_with(echoed), "link {link}");
            assert!(echoed.len() > BYTES - 100, "link {link}: {}", echoed.len());
            continue;
        }
        let (_, says) = HOSTILE[link as usize % HOSTILE.len()];
        for fault in &lane.faults {
            assert_eq!(fault.event, Some(EventKind::Received));
            assert!(fault.sentence.contains(says), "{}", fault.sentence);
            assert_eq!(fault.last_words.as_deref(), (says == "trapped").then_some(" lie"));
            let last = fault.recording.entries().last().unwrap();
            assert!(fault.recording.is_whole() && last.kind == EventKind::Received);
        }
    }
}
