//! Plug-ins are swapped under load, on probation and without, and some of the
//! successors fail: no byte is lost, doubled or out of order either way.

#![cfg(target_os = "linux")]

use crate::lanes;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::load::{Load, Machine, XOFF, XON, pattern};
use softplug_live::reactor::{JobOutcome, LaneId, SwapReport, When};
use softplug_native::NativePlugin;

const LINKS: u32 = 64;
const BYTES: usize = 6_000;
const SWAPS: usize = 640;

#[test]
fn no_byte_is_lost_over_swaps_under_load() {
    let make = || NativePlugin::XonXoff.instantiate();
    let mut load = Load::new(lanes::settings(&[]), 2_048, make);
    let machines: Vec<Machine> = (0..LINKS)
        .map(|link| {
            let (_, pty) = load.add(19_200);
            Machine::new(pty, pattern(link + 500, BYTES), 1_500)
        })
        .collect();
    load.wait_until_up();
    let stop = Arc::new(AtomicBool::new(false));
    let running = Machine::run_all(machines, Arc::clone(&stop));
    for link in 0..LINKS {
        load.begin(LaneId(link + 1), &pattern(link, BYTES));
    }

    // Round after round: without probation, on probation, on probation with a
    // successor that fails at one of its first events.
    let mut ordered = 0;
    while ordered < SWAPS {
        load.look();
        for link in 0..LINKS {
            let lane = LaneId(link + 1);
            if ordered == SWAPS || load.is_swapping(lane) {
                continue;
            }
            let on_probation = ordered % 3 != 0;
            let fails_at = (ordered % 3 == 2).then_some(2 + (ordered as u32 / 3) % 15);
            load.swap(lane, on_probation, fails_at);
            ordered += 1;
        }
    }
    load.attend(|lanes| {
        lanes.values().all(|lane| lane.job.is_some() && lane.delivered.len() >= BYTES)
    });
    stop.store(true, Ordering::Relaxed);
    let machines = running.join().unwrap();

    let (mut done, mut reverted, mut kept) = (0, 0, 0);
    for (link, machine) in (0..LINKS).zip(&machines) {
        let lane = &load.lanes[&LaneId(link + 1)];
        assert_eq!(lane.job, Some(JobOutcome::Done), "link {link}: {:?}", lane.faults);
        assert!(machine.received == pattern(link, BYTES), "link {link}: what it was sent");
        assert!(lane.delivered == pattern(link + 500, BYTES), "link {link}: what it sent");
        assert_eq!(lane.faults, []);
        for swap in &lane.swaps {
            match swap {
                SwapReport::Done { with_state, .. } => {
                    assert!(with_state);
                    done += 1;
                }
                SwapReport::Reverted(fault) => {
                    assert!(fault.on_probation && fault.recording.is_whole());
                    reverted += 1;
                }
                SwapReport::Kept => kept += 1,
                other => panic!("link {link}: {other:?}"),
            }
        }
    }
    assert_eq!(done, SWAPS);
    assert!(reverted > SWAPS / 6 && kept > SWAPS / 6, "{reverted} reverted, {kept} kept");
}

#[test]
fn without_a_common_format_it_waits_until_the_link_is_idle() {
    let mut load = Load::new(lanes::settings(&[]), 0, || NativePlugin::XonXoff.instantiate());
    let (lane, pty) = load.add(19_200);
    let stop = Arc::new(AtomicBool::new(false));
    load.wait_until_up();
    // Held, so that the job is under way until both swaps have been asked for.
    assert_eq!(pty.write(&[XOFF]).unwrap(), 1);
    load.until(lane, |figures| figures.is_held);
    load.begin(lane, &pattern(1, 1_000));
    load.swap_as(lane, vec![9], When::Now);
    load.attend(|lanes| lanes[&lane].swaps.len() == 1);
    let refused = &load.lanes[&lane].swaps[0];
    assert!(
        matches!(refused, SwapReport::Refused { sentence } if sentence.contains("format 1")),
        "{refused:?}"
    );

    load.swap_as(lane, vec![9], When::NowOrIdle);
    load.attend(|lanes| lanes[&lane].swaps.len() == 2);
    assert_eq!(load.lanes[&lane].swaps[1], SwapReport::Waiting);
    assert_eq!(pty.write(&[XON]).unwrap(), 1);
    let machine = Machine::new(pty, Vec::new(), 1).without_holds();
    let running = Machine::run_all(vec![machine], Arc::clone(&stop));
    load.attend(|lanes| lanes[&lane].swaps.len() == 3);
    let seen = &load.lanes[&lane];
    let done = &seen.swaps[2];
    assert!(matches!(done, SwapReport::Done { with_state: false, .. }), "{done:?}");
    // The job went before.
    assert_eq!(seen.job, Some(JobOutcome::Done));

    // With a common format the state is carried over, idle or not.
    load.swap_as(lane, vec![1], When::Idle);
    load.attend(|lanes| lanes[&lane].swaps.len() == 4);
    let done = &load.lanes[&lane].swaps[3];
    assert!(matches!(done, SwapReport::Done { with_state: true, .. }), "{done:?}");
    stop.store(true, Ordering::Relaxed);
    let machines = running.join().unwrap();
    assert!(machines[0].received == pattern(1, 1_000));
}
