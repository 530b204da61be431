//! A machine, a unit at it, a cable, and a gateway's end.

use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use softplug_abi::{JobId, Micros};
use softplug_host::Digest;
use softplug_link::Job;
use softplug_live::reactor::{Backoff, Feed, JobEnd, LaneId, Report, SwapReport};
use softplug_live::reservoir::{Drawn, ReservoirReader, reservoir};
use softplug_live::units::{
    TlsKeys, UnitAddress, UnitCommand, UnitPlace, UnitPlugin, UnitSetup, Units,
};
use softplug_machines::kept::Received;
use softplug_unit::{Reach, Stop, Unit, UnitConfig};
use softplug_unit_slots::{FileDevice, Geometry, Options, Slot, Slots, Trust};
use tempfile::TempDir;

use crate::cable::Cable;
use crate::machine::Machine;

/// How long something that must come may take on a busy machine.
pub(crate) const PATIENCE: Duration = Duration::from_mins(1);

pub(crate) struct RunningUnit {
    stop: Stop,
    thread: Option<JoinHandle<()>>,
}

impl Drop for RunningUnit {
    fn drop(&mut self) {
        self.stop.ask();
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

pub(crate) struct Shop {
    pub(crate) machine: Machine,
    pub(crate) cable: Cable,
    units: Option<Units>,
    unit: Option<RunningUnit>,
    reports: Receiver<(LaneId, Report)>,
    seen: Vec<Report>,
    /// In the order in which they began.
    deliveries: Vec<(Option<ReservoirReader>, Vec<u8>)>,
    lane: LaneId,
    identities: u64,
    folder: TempDir,
    /// The gateway's, and the unit's that it expects.
    tls: Option<TlsKeys>,
}

impl Shop {
    pub(crate) fn new(machine: Machine) -> Self {
        Self::with(machine, "unsigned = true")
    }

    /// `unit`: the table [tls] of the unit, or nothing; `gateway`: what the gateway has.
    pub(crate) fn with_tls(machine: Machine, unit: &str, gateway: Option<TlsKeys>) -> Self {
        let folder = tempfile::tempdir().unwrap();
        write_unit(&folder, &machine, &format!("unsigned = true\n{unit}"));
        Self::of(machine, folder, Cable::tapped, gateway)
    }

    pub(crate) fn that_wants_signatures(machine: Machine) -> Self {
        let key = "-----BEGIN PUBLIC KEY-----\nMCowBQYDK2VwAyEAGb9ECWmEzf6FQbrBZ9w7lshQhqowtrbLDFw4rXAxZuE=\n\
                   -----END PUBLIC KEY-----\n";
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("works.pem");
        fs::write(&file, key).unwrap();
        Self::with(machine, &format!("keys = [\"{}\"]", file.display()))
    }

    fn with(machine: Machine, signature: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        write_unit(&folder, &machine, signature);
        Self::of(machine, folder, Cable::new, None)
    }

    fn of(
        machine: Machine,
        folder: TempDir,
        cable: fn(SocketAddr) -> Cable,
        tls: Option<TlsKeys>,
    ) -> Self {
        let (unit, address) = start_unit(&folder, 1);
        let (_, reports) = channel();
        let mut shop = Self {
            machine,
            cable: cable(address),
            units: None,
            unit: Some(unit),
            reports,
            seen: Vec::new(),
            deliveries: Vec::new(),
            lane: LaneId(0),
            identities: 1,
            folder,
            tls,
        };
        shop.start_gateway();
        shop
    }

    fn start_gateway(&mut self) {
        self.identities += 1;
        let (tell, reports) = channel();
        self.reports = reports;
        let units = Units::start(self.identities, move |lane, report| {
            let _ = tell.send((lane, report));
        })
        .unwrap();
        self.lane = LaneId(self.lane.0 + 1);
        let unit =
            UnitPlace::Tcp { host: "127.0.0.1".to_owned(), port: self.cable.address().port() };
        let address = UnitAddress { unit, link: Some("mill".to_owned()) };
        let plugin = Self::first_plugin();
        let reopen = Backoff { first: Micros::from_millis(50), longest: Micros::from_millis(500) };
        let tls = self.tls.clone();
        let setup = UnitSetup {
            address,
            tls,
            plugin,
            delivery_room: 16_384,
            stored: None,
            reopen,
            bus: None,
        };
        units.add(self.lane, setup);
        self.units = Some(units);
    }

    pub(crate) fn stop_gateway(&mut self) {
        self.units = None;
    }

    pub(crate) fn restart_gateway(&mut self) {
        self.stop_gateway();
        self.start_gateway();
        self.seen.clear();
    }

    pub(crate) fn restart_unit(&mut self) {
        self.restart_unit_with(|_| {});
    }

    /// Something is done to its memory meanwhile.
    pub(crate) fn restart_unit_with(&mut self, act: impl FnOnce(&mut Slots<'_, FileDevice>)) {
        self.unit = None;
        act(&mut slots_in(&self.folder.path().join("state/mill.slots")));
        self.identities += 1;
        let (unit, address) = start_unit(&self.folder, self.identities);
        self.unit = Some(unit);
        self.cable.leads_to(address);
    }

    pub(crate) fn first_plugin() -> UnitPlugin {
        plugin_of(xon_xoff())
    }

    /// The module with a section more: another one that does the same.
    pub(crate) fn another_plugin() -> UnitPlugin {
        let mut module = xon_xoff();
        module.extend_from_slice(&[0, 5, 4, b'n', b'o', b't', b'e']);
        plugin_of(module)
    }

    pub(crate) fn tell(&self, command: UnitCommand) {
        self.units.as_ref().unwrap().tell(self.lane, command);
    }

    pub(crate) fn begin(&self, id: u32, program: &[u8]) {
        let (mut writer, source) = reservoir(program.len().max(1), 0, program.len().max(1));
        writer.write(program);
        writer.finish();
        let size = Some(program.len() as u64);
        let job = Job { id: JobId(id), kind: 0, size, fields: Vec::new(), check: false };
        self.tell(UnitCommand::Begin(Feed { job, source }));
    }

    pub(crate) fn send(&mut self, id: u32, program: &[u8]) -> JobEnd {
        self.begin(id, program);
        self.until_report(ended)
    }

    /// The data that has reached the control.
    pub(crate) fn received(&self) -> Vec<u8> {
        self.machine.tell(|_, control| match control.report().received {
            Received::Bytes(bytes) => bytes,
            Received::Digest { .. } => panic!("it keeps bytes"),
        })
    }

    /// All of this has reached the control, and nothing else: a pty holds what has left until the
    /// control reads it.
    pub(crate) fn until_received(&mut self, all: &[u8]) {
        self.until(|shop| shop.received().len() >= all.len());
        assert!(self.received() == all, "{:?}", String::from_utf8_lossy(&self.received()));
    }

    /// What came from the control.
    pub(crate) fn arrived(&mut self) -> Vec<u8> {
        self.hear(Duration::ZERO);
        self.deliveries.iter().flat_map(|(_, bytes)| bytes.clone()).collect()
    }

    /// How often the slots were erased.
    pub(crate) fn erases(&self) -> [u32; 2] {
        // The unit has the file itself.
        let copy = self.folder.path().join("copy.slots");
        fs::copy(self.folder.path().join("state/mill.slots"), &copy).unwrap();
        let slots = slots_in(&copy);
        Slot::BOTH.map(|slot| slots.erases(slot))
    }

    pub(crate) fn until(&mut self, is_so: impl Fn(&mut Self) -> bool) {
        let begin = Instant::now();
        while !is_so(self) {
            assert!(begin.elapsed() < PATIENCE, "it never came: {:?}", self.seen);
            self.hear(Duration::from_millis(5));
        }
    }

    pub(crate) fn until_up(&mut self) {
        self.until_report(|report| matches!(report, Report::Up).then_some(()));
    }

    /// The first report that this finds something in, those before it are forgotten.
    pub(crate) fn until_report<T>(&mut self, finds: impl Fn(&Report) -> Option<T>) -> T {
        let begin = Instant::now();
        loop {
            let found =
                self.seen.iter().enumerate().find_map(|(at, report)| Some((at, finds(report)?)));
            if let Some((at, found)) = found {
                self.seen.drain(..=at);
                return found;
            }
            assert!(begin.elapsed() < PATIENCE, "it was never told: {:?}", self.seen);
            self.hear(Duration::from_millis(5));
        }
    }

    fn hear(&mut self, patience: Duration) {
        loop {
            match self.reports.recv_timeout(patience) {
                Ok((_, Report::DeliveryBegun { bytes, .. })) => {
                    self.deliveries.push((Some(bytes), Vec::new()));
                }
                Ok((_, report)) => self.seen.push(report),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            }
        }
        for (from, to) in &mut self.deliveries {
            let mut buffer = [0; 1_024];
            while let Some(reader) = from {
                match reader.read(&mut buffer) {
                    Drawn::Bytes(count) => to.extend_from_slice(&buffer[..count]),
                    Drawn::Later => break,
                    // It is stored: the unit is told so.
                    Drawn::End | Drawn::Failed => *from = None,
                }
            }
        }
    }
}

fn slots_in(file: &Path) -> Slots<'static, FileDevice> {
    let geometry = Geometry { size: 256 << 10, erase: 4_096, granule: 4 };
    let trust = Trust::unsigned_too(&[]);
    let options = Options { trust, attempts: 3, most_erases: 10_000 };
    Slots::open(FileDevice::open(file, geometry).unwrap(), options).unwrap()
}

/// A unit of 8 KiB at this machine.
pub(crate) fn write_unit(folder: &TempDir, machine: &Machine, signature: &str) {
    let line = if machine.baud == 0 { 921_600 } else { machine.baud };
    let text = format!(
        "name = \"unit-1\"\nlisten = \"127.0.0.1:0\"\nstate = \"state\"\n[signature]\n{signature}\n\
         [[link]]\nname = \"mill\"\nport = \"{}\"\nline = \"{line} 8N1\"\nmemory_size = \"256KiB\"\n\
         buffer = \"8KiB\"\n",
        machine.port
    );
    fs::write(folder.path().join("unit.toml"), text).unwrap();
}

pub(crate) fn start_unit(folder: &TempDir, identity: u64) -> (RunningUnit, SocketAddr) {
    let config = UnitConfig::read(&folder.path().join("unit.toml")).unwrap();
    let unit = Unit::start(config, identity << 32).unwrap();
    let Reach::Tcp(address) = unit.address() else { panic!("it listens on a TCP port") };
    let stop = unit.stop();
    let thread = thread::spawn(move || unit.run().unwrap());
    (RunningUnit { stop, thread: Some(thread) }, address)
}

fn plugin_of(module: Vec<u8>) -> UnitPlugin {
    let digest = *Digest::of(&module).as_bytes();
    UnitPlugin { module: module.into(), digest, signature: None, settings: Vec::new() }
}

pub(crate) fn ended(report: &Report) -> Option<JobEnd> {
    if let Report::JobEnded(end) = report { Some(end.clone()) } else { None }
}

pub(crate) fn swapped(report: &Report) -> Option<SwapReport> {
    if let Report::Swapped(report) = report { Some(report.clone()) } else { None }
}

pub(crate) fn faulted(report: &Report) -> Option<()> {
    matches!(report, Report::Fault(_)).then_some(())
}

pub(crate) fn broken_off(report: &Report) -> Option<()> {
    let failure = Some(softplug_abi::Failure::Interrupted);
    matches!(report, Report::DeliveryEnded { failure: is, .. } if *is == failure).then_some(())
}

pub(crate) fn delivered(report: &Report) -> Option<u64> {
    match report {
        Report::DeliveryEnded { failure: None, bytes, .. } => Some(*bytes),
        _ => None,
    }
}

pub(crate) fn down(report: &Report) -> Option<String> {
    if let Report::Down { detail, .. } = report { Some(detail.clone()) } else { None }
}

/// So many bytes of a program in which no part is as another.
pub(crate) fn program(bytes: usize) -> Vec<u8> {
    let mut text: Vec<u8> =
        (1..).flat_map(|n| format!("N{n} G1 X{n}\n").into_bytes()).take(bytes).collect();
    if let Some(last) = text.last_mut() {
        *last = b'\n';
    }
    text
}

fn xon_xoff() -> Vec<u8> {
    built("xon-xoff")
}

/// A plug-in as it was built for tests.
pub(crate) fn built(name: &str) -> Vec<u8> {
    let folder = std::env::var_os("SOFTPLUG_PLUGINS").filter(|folder| !folder.is_empty());
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../target/plugins");
    let file = folder.map_or_else(beside, PathBuf::from).join(format!("{name}.wasm"));
    fs::read(&file)
        .unwrap_or_else(|_| panic!("there is no {}: run `cargo xtask build`", file.display()))
}
