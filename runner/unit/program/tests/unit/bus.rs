//! Several units on one bus, which is slower than loopback.

use std::collections::BTreeSet;
use std::sync::mpsc::{Receiver, channel};
use std::time::Instant;

use softplug_abi::{JobId, Micros};
use softplug_link::Job;
use softplug_live::reactor::{Backoff, Feed, JobEnd, JobOutcome, LaneId, Report};
use softplug_live::reservoir::reservoir;
use softplug_live::units::{
    BusRates, BusSetup, BusSurvey, UnitAddress, UnitCommand, UnitPlace, UnitSetup, Units,
};
use softplug_machines::kept::Received;
use tempfile::TempDir;

use crate::machine::Machine;
use crate::shop::{PATIENCE, RunningUnit, Shop, ended, program, start_unit, write_unit};

/// 8,000 bytes of data a second.
const RATES: BusRates = BusRates { rate: 128_000.0, efficiency: 0.5, switch: 0.005 };

/// Units with a machine each, and the gateway's end of all of them.
struct Floor {
    machines: Vec<Machine>,
    units: Units,
    reports: Receiver<(LaneId, Report)>,
    _running: Vec<(RunningUnit, TempDir)>,
}

impl Floor {
    fn new(count: u32) -> Self {
        let machines: Vec<_> = (0..count).map(|_| Machine::fast()).collect();
        let (tell, reports) = channel();
        let units = Units::start(7, move |lane, report| {
            let _ = tell.send((lane, report));
        });
        let units = units.unwrap();
        units.set_buses(vec![BusSetup { name: "hall".to_owned(), rates: RATES }]);
        let mut running = Vec::new();
        for (number, machine) in (1_u32..).zip(&machines) {
            let folder = tempfile::tempdir().unwrap();
            write_unit(&folder, machine, "unsigned = true");
            let (unit, address) = start_unit(&folder, number.into());
            running.push((unit, folder));
            let unit = UnitPlace::Tcp { host: "127.0.0.1".to_owned(), port: address.port() };
            let setup = UnitSetup {
                address: UnitAddress { unit, link: None },
                plugin: Shop::first_plugin(),
                delivery_room: 16_384,
                reopen: Backoff {
                    first: Micros::from_millis(50),
                    longest: Micros::from_millis(500),
                },
                stored: None,
                bus: Some("hall".to_owned()),
                tls: None,
            };
            units.add(LaneId(number), setup);
        }
        let mut floor = Self { machines, units, reports, _running: running };
        let mut up = BTreeSet::new();
        while up.len() < count as usize {
            if let (lane, Report::Up) = floor.next() {
                up.insert(lane);
            }
        }
        // What is shown is a moment old.
        while floor.units.buses().is_empty() {
            std::thread::yield_now();
        }
        floor
    }

    fn next(&mut self) -> (LaneId, Report) {
        self.reports.recv_timeout(PATIENCE).expect("something is told")
    }

    fn begin(&self, lane: LaneId, bytes: &[u8]) {
        let (mut writer, source) = reservoir(bytes.len(), 0, bytes.len());
        writer.write(bytes);
        writer.finish();
        let size = Some(bytes.len() as u64);
        let job = Job { id: JobId(1), kind: 0, size, fields: Vec::new(), check: false };
        self.units.tell(lane, UnitCommand::Begin(Feed { job, source }));
    }

    fn until_ended(&mut self) -> JobEnd {
        loop {
            if let Some(end) = ended(&self.next().1) {
                return end;
            }
        }
    }

    fn bus(&self) -> BusSurvey {
        let [bus] = self.units.buses().try_into().expect("there is one bus");
        bus
    }

    fn received(&self, number: usize) -> Vec<u8> {
        self.machines[number].tell(|_, control| match control.report().received {
            Received::Bytes(bytes) => bytes,
            Received::Digest { .. } => panic!("it keeps bytes"),
        })
    }
}

#[test]
fn a_bus_feeds_its_units_in_turn_at_its_own_rate_and_is_measured() {
    let mut floor = Floor::new(3);
    let program = program(20_000);
    let begin = Instant::now();
    (1..=3).for_each(|number| floor.begin(LaneId(number), &program));
    let mut served = BTreeSet::new();
    for _ in 0..3 {
        while served.len() < 3 {
            served.extend(floor.bus().serves);
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        assert_eq!(floor.until_ended().outcome, JobOutcome::Done);
    }
    // 60,000 bytes at 8,000 a second, but for what waits in the uplink's queue.
    assert!(begin.elapsed().as_secs_f64() > 7.3, "{:?}", begin.elapsed());
    for number in 0..3 {
        // A pty holds what has left until the control reads it.
        while floor.received(number).len() < program.len() {
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
        assert!(floor.received(number) == program, "{number}");
    }
    let bus = floor.bus();
    assert_eq!(bus.setup.rates, RATES);
    assert_eq!(bus.lanes, [1, 2, 3].map(LaneId));
    let figures = bus.figures;
    assert!(figures.load.is_some_and(|load| load > 0.0 && load < 1.01), "{figures:?}");
    assert!(figures.efficiency.is_some_and(|part| part > 0.1 && part < 1.0), "{figures:?}");
    assert!(figures.switch.is_some_and(|seconds| seconds >= RATES.switch), "{figures:?}");
    let unit = floor.units.figures(LaneId(1)).unwrap();
    assert_eq!(unit.buffer, 8_192);
    assert!(unit.slots.iter().any(|slot| slot.digest == unit.runs && unit.runs.is_some()));
}

#[test]
fn a_bus_that_is_gone_serves_its_links_to_their_end() {
    let mut floor = Floor::new(1);
    let program = program(12_000);
    floor.begin(LaneId(1), &program);
    floor.units.set_buses(Vec::new());
    assert_eq!(floor.until_ended().outcome, JobOutcome::Done);
    assert_eq!(floor.bus().lanes, [LaneId(1)]);
    floor.units.remove(LaneId(1));
    while !matches!(floor.next().1, Report::Removed) {}
    while !floor.units.buses().is_empty() {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
}
