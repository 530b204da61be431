//! Measures what 90 links notice of 10 whose plug-ins trap, loop, eat memory or
//! lie: the round trip of 16 bytes through a plug-in that echoes, every 100 ms on
//! each, with ten sound links and with ten hostile ones. Prints JSON.
//!
//! `hostile_links [SECONDS [ROUNDS]]`: 20 seconds of each, 3 rounds in turn.

#[allow(dead_code, unused_imports, reason = "shared with the tests")]
#[path = "../tests/load/mod.rs"]
mod load;

use std::collections::HashMap;
use std::error::Error;
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use load::{Fragile, Guests, Load};
use softplug_abi::manifest::SettingValues;
use softplug_live::ReadOutcome;
use softplug_live::pty::PtyPair;
use softplug_live::reactor::LaneId;

const LINKS: u32 = 100;
const HOSTILE_LINKS: u32 = 10;
const EVERY: Duration = Duration::from_millis(100);
/// A plug-in that has failed is started again after so long.
const RESTART: Duration = Duration::from_millis(100);

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number = |at: usize, otherwise: u64| {
        arguments.get(at).map_or(Ok(otherwise), |text| text.parse::<u64>())
    };
    let (seconds, rounds) = (number(0, 20)?, number(1, 3)?);
    let guests = Rc::new(Guests::load(256));
    let mut reports = Vec::new();
    for _ in 0..rounds {
        for is_hostile in [false, true] {
            reports.push(run(&guests, is_hostile, Duration::from_secs(seconds)));
        }
    }
    println!("{:#}", serde_json::Value::Array(reports));
    Ok(())
}

fn run(guests: &Rc<Guests>, is_hostile: bool, span: Duration) -> serde_json::Value {
    let echo = Rc::clone(guests);
    let mut load = Load::new(SettingValues::default(), 4_096, move || echo.echo());
    let ptys: Vec<PtyPair> = (0..LINKS)
        .map(|link| {
            let instance = match link {
                0..HOSTILE_LINKS if is_hostile => guests.hostile(link as usize),
                _ => guests.echo(),
            };
            load.add_plugin(921_600, Fragile::sound(instance), SettingValues::default()).1
        })
        .collect();
    load.wait_until_up();
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let machines = thread::spawn(move || echoes(&ptys, &stopped));
    let began = Instant::now();
    let mut handled: HashMap<LaneId, (usize, Instant)> = HashMap::new();
    let mut faults = 0;
    while began.elapsed() < span {
        load.look();
        for link in 0..HOSTILE_LINKS {
            let lane = LaneId(link + 1);
            let failed = load.lanes[&lane].faults.len();
            let (before, since) = handled.entry(lane).or_insert((0, began));
            if failed == *before {
                *since = Instant::now();
            } else if since.elapsed() >= RESTART {
                *before = failed;
                faults += 1;
                let instance = Fragile::sound(guests.hostile(link as usize));
                load.replace(lane, instance, SettingValues::default());
            }
        }
    }
    stop.store(true, Ordering::Relaxed);
    let (mut trips, lost) = machines.join().expect("the machines go on to the end");
    trips.sort_unstable();
    let at = |part: f64| trips[((trips.len() - 1) as f64 * part) as usize].as_micros();
    serde_json::json!({
        "hostile_links": if is_hostile { HOSTILE_LINKS } else { 0 }, "faults": faults,
        "links_measured": LINKS - HOSTILE_LINKS, "round_trips": trips.len(), "without_answer": lost,
        "round_trip_us": { "p50": at(0.5), "p99": at(0.99), "most": at(1.0) },
    })
}

/// The round trips of the sound links, and how many had no answer in time.
fn echoes(ptys: &[PtyPair], stop: &AtomicBool) -> (Vec<Duration>, usize) {
    let began = Instant::now();
    let mut next: Vec<Instant> = (0..LINKS).map(|link| began + EVERY * link / LINKS).collect();
    let mut under_way: Vec<Option<(Instant, usize)>> = vec![None; ptys.len()];
    let (mut trips, mut lost) = (Vec::new(), 0);
    while !stop.load(Ordering::Relaxed) {
        let mut was_busy = false;
        for (link, pty) in ptys.iter().enumerate() {
            let mut buffer = [0; 64];
            if let Ok(ReadOutcome::Read(count)) = pty.read(&mut buffer) {
                was_busy = true;
                if let Some((sent_at, missing)) = &mut under_way[link] {
                    *missing = missing.saturating_sub(count);
                    if *missing == 0 {
                        trips.extend((link >= HOSTILE_LINKS as usize).then(|| sent_at.elapsed()));
                        under_way[link] = None;
                    }
                }
            }
            let now = Instant::now();
            if next[link] <= now {
                next[link] += EVERY;
                let unanswered = under_way[link].replace((now, 16)).is_some();
                lost += usize::from(unanswered && link >= HOSTILE_LINKS as usize);
                let _ = pty.write(b"0123456789abcdef");
            }
        }
        if !was_busy {
            thread::sleep(Duration::from_micros(50));
        }
    }
    (trips, lost)
}
