//! Swaps the plug-in of many links under load both ways, and prints as JSON for
//! how long the links stood still and whether every byte came through.
//!
//! `hot_swap PLUGIN.wasm [SWAPS [LINKS]]`: 10,000 swaps of XON/XOFF over 64 links.
//! A third goes without probation, a third with, and in a third the successor
//! fails on probation and the one before goes on.

#[allow(dead_code, unused_imports, reason = "shared with the tests")]
#[path = "../tests/load/mod.rs"]
mod load;

use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use load::{Load, Machine, pattern};
use softplug_host::{Host, HostOptions};
use softplug_live::reactor::{JobOutcome, LaneId, SwapReport};

/// Characters a second of each machine, on a line of 1,920.
const RATE: u32 = 1_500;
/// From one swap of a link to its next at least; most swaps take part of a probation.
const SPACING: Duration = Duration::from_millis(60);

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, otherwise: usize| {
        arguments.get(at).map_or(Ok(otherwise), |text| text.parse::<usize>())
    };
    let path = PathBuf::from(arguments.first().ok_or("name the plug-in's file")?);
    let (swaps, links) = (number(1, 10_000)?, number(2, 64)? as u32);
    // A probation takes 50 ms and some 20 events; the load outlasts all swaps.
    let bytes = (swaps / links as usize + 10) * RATE as usize / 5;

    let host = Host::new(HostOptions { instances: links * 8 + 64, ..HostOptions::default() })?;
    let plugin = host.load(&path)?;
    let settings = plugin.manifest().resolve_settings([])?;
    let made = plugin.clone();
    let make = move || made.instantiate().expect("there are instances enough");
    let mut load = Load::new(settings, 4_096, make);
    let machines: Vec<Machine> = (0..links)
        .map(|link| {
            let (_, pty) = load.add(19_200);
            Machine::new(pty, pattern(link + 500, bytes), RATE)
        })
        .collect();
    load.wait_until_up();
    let stop = Arc::new(AtomicBool::new(false));
    let running = Machine::run_all(machines, Arc::clone(&stop));
    for link in 0..links {
        load.begin(LaneId(link + 1), &pattern(link, bytes));
    }

    let began = Instant::now();
    let mut ordered = 0;
    let mut last = vec![began; links as usize];
    while ordered < swaps {
        load.look();
        for link in 0..links {
            let lane = LaneId(link + 1);
            let is_early = last[link as usize].elapsed() < SPACING;
            if ordered == swaps || is_early || load.is_swapping(lane) {
                continue;
            }
            last[link as usize] = Instant::now();
            let on_probation = ordered % 3 != 0;
            let fails_at = (ordered % 3 == 2).then_some(2 + (ordered as u32 / 3) % 15);
            load.swap(lane, on_probation, fails_at);
            ordered += 1;
        }
    }
    let under_way = load.lanes.values().filter(|lane| lane.job.is_none()).count();
    let seconds = began.elapsed().as_secs_f64();
    load.attend(|lanes| {
        lanes.values().all(|lane| lane.job.is_some() && lane.delivered.len() >= bytes)
    });
    stop.store(true, Ordering::Relaxed);
    let machines = running.join().map_err(|_| "the machines stopped")?;

    let mut wrong = 0;
    let (mut pauses, mut reverted, mut kept, mut other) = (Vec::new(), 0, 0, 0);
    for (link, machine) in (0..links).zip(&machines) {
        let lane = &load.lanes[&LaneId(link + 1)];
        let is_right = lane.job == Some(JobOutcome::Done)
            && machine.received == pattern(link, bytes)
            && lane.delivered == pattern(link + 500, bytes)
            && lane.faults.is_empty();
        wrong += usize::from(!is_right);
        if !is_right {
            let (received, delivered) = (machine.received.len(), lane.delivered.len());
            eprintln!(
                "link {link}: {:?}, {received} received, {delivered} delivered of {bytes}, {:?}",
                lane.job, lane.faults
            );
        }
        for swap in &lane.swaps {
            match swap {
                SwapReport::Done { pause, .. } => pauses.push(pause.0),
                SwapReport::Reverted(_) => reverted += 1,
                SwapReport::Kept => kept += 1,
                _ => other += 1,
            }
        }
    }
    pauses.sort_unstable();
    let at = |part: f64| pauses[((pauses.len() - 1) as f64 * part) as usize];
    let report = serde_json::json!({
        "links": links, "swaps": pauses.len(), "kept": kept, "reverted": reverted,
        "refused_or_waiting": other, "bytes_each_way": bytes, "links_with_a_wrong_byte": wrong,
        "links_still_sending_at_the_last_swap": under_way,
        "seconds_of_swapping": (seconds * 10.0).round() / 10.0,
        "pause_us": { "p50": at(0.5), "p90": at(0.9), "p99": at(0.99), "p999": at(0.999),
            "most": at(1.0) },
    });
    println!("{report:#}");
    if wrong > 0 || other > 0 {
        Err("a byte is wrong, or a swap was not done".into())
    } else {
        Ok(())
    }
}
