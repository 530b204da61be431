//! A line that stands still although bytes wait is counted, and nothing else is.

#![cfg(target_os = "linux")]

use std::thread::sleep;
use std::time::Duration;

use softplug_abi::manifest::Manifest;
use softplug_abi::{JobId, LineParameters, Micros};
use softplug_link::{Job, Recorder};
use softplug_live::pty::PtyPair;
use softplug_live::station::{Station, StationOptions};
use softplug_live::{Port, PortOptions, PortSpec};
use softplug_native::{NativeInstance, NativePlugin};

/// A character takes 1.04 ms, and four are in the port at most.
const BAUD: u32 = 9_600;
const DEPTH: u32 = 4;
const AWAY: Duration = Duration::from_millis(200);
const HELD: Duration = Duration::from_secs(2);

/// A station in the middle of a job, and the machine.
struct Bench {
    station: Station<NativeInstance>,
    host: Recorder,
    machine: PtyPair,
}

impl Bench {
    fn sending() -> Self {
        let machine = PtyPair::open().unwrap();
        let manifest = Manifest::parse(NativePlugin::XonXoff.manifest().as_bytes()).unwrap();
        let settings = manifest.resolve_settings([]).unwrap();
        let line = LineParameters { stop_half_bits: 2, ..LineParameters::new(BAUD) };
        let spec = PortSpec::Device(machine.slave_path().to_owned());
        let port = Port::open(&spec, &PortOptions::new(line)).unwrap();
        let options = StationOptions { settings, depth: Some(DEPTH), ..StationOptions::default() };
        let instance = NativePlugin::XonXoff.instantiate();
        let mut station = Station::new(port, instance, options).unwrap();
        let mut host = Recorder::default();
        host.add_source(JobId(1), vec![b'x'; 4_000]);
        station.open(&mut host).unwrap();
        let job =
            Job { id: JobId(1), kind: 0, size: Some(4_000), fields: Vec::new(), check: false };
        station.begin_job(job, &mut host).unwrap();
        let mut bench = Self { station, host, machine };
        bench.work(20);
        bench
    }

    /// Looks after the line for so many ms.
    fn work(&mut self, millis: i64) {
        let until = self.station.now() + Micros::from_millis(millis);
        while self.station.now() < until {
            self.station.turn(until, &mut self.host).unwrap();
        }
    }
}

#[test]
fn who_comes_late_leaves_a_gap_while_bytes_wait() {
    let mut bench = Bench::sending();
    let before = bench.station.counters().gaps;
    sleep(AWAY);
    bench.work(20);
    let counters = bench.station.counters();
    assert!(counters.gaps > before);
    // Four characters were in the port.
    assert!(counters.longest_gap > Micros::from_millis(190), "{:?}", counters.longest_gap);
}

#[test]
fn a_line_that_the_machine_holds_has_no_gap() {
    let mut bench = Bench::sending();
    bench.machine.write(&[0x13]).unwrap();
    bench.work(50);
    assert_eq!(bench.station.counters().holds, 1);
    let before = bench.station.counters().bytes_out;
    sleep(HELD);
    bench.machine.write(&[0x11]).unwrap();
    bench.work(20);
    let counters = bench.station.counters();
    assert!(counters.bytes_out > before);
    // Counted, the hold would be the longest; a computer may be late, but not for so long.
    let held = Micros(i64::try_from(HELD.as_micros()).unwrap());
    assert!(counters.longest_gap < held - Micros::from_millis(100), "{:?}", counters.longest_gap);
}
