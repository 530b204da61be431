//! A gateway's end of the uplink, and what a plug-in sends natively.

use std::fs;
use std::path::PathBuf;
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use sha2::{Digest, Sha256};
use softplug_abi::manifest::Manifest;
use softplug_abi::{JobId, Micros};
use softplug_link::{Job, LinkOptions, Recorder, VirtualLine};
use softplug_live::reactor::{Backoff, Feed, JobEnd, LaneId, Report};
use softplug_live::reservoir::{Drawn, ReservoirReader, reservoir};
use softplug_live::units::{UnitAddress, UnitCommand, UnitPlace, UnitPlugin, UnitSetup, Units};
use softplug_native::NativePlugin;

use super::board::PATIENCE;

const LANE: LaneId = LaneId(1);

pub(super) struct Gateway {
    units: Units,
    reports: Receiver<(LaneId, Report)>,
    seen: Vec<Report>,
    deliveries: Vec<(Option<ReservoirReader>, Vec<u8>)>,
}

impl Gateway {
    /// Drives the unit at this port of the computer, with this plug-in.
    pub(super) fn start(port: u16, module: Vec<u8>) -> Self {
        let (tell, reports) = channel();
        let identity = u64::from(std::process::id()) << 32 | u64::from(port);
        let units = Units::start(identity, move |lane, report| {
            let _ = tell.send((lane, report));
        })
        .unwrap();
        let unit = UnitPlace::Tcp { host: "127.0.0.1".to_owned(), port };
        let address = UnitAddress { unit, link: Some("machine".to_owned()) };
        let digest = Sha256::digest(&module).into();
        let settings = Vec::new();
        let plugin = UnitPlugin { module: module.into(), digest, signature: None, settings };
        let reopen = Backoff { first: Micros::from_millis(50), longest: Micros::from_millis(500) };
        units.add(
            LANE,
            UnitSetup {
                address,
                plugin,
                delivery_room: 16_384,
                stored: None,
                reopen,
                bus: None,
                tls: None,
            },
        );
        Self { units, reports, seen: Vec::new(), deliveries: Vec::new() }
    }

    pub(super) fn until_up(&mut self) {
        self.until_report(|report| matches!(report, Report::Up).then_some(()));
    }

    pub(super) fn begin(&self, id: u32, program: &[u8]) {
        let (mut writer, source) = reservoir(program.len(), 0, program.len());
        writer.write(program);
        writer.finish();
        let size = Some(program.len() as u64);
        let job = Job { id: JobId(id), kind: 0, size, fields: Vec::new(), check: false };
        self.units.tell(LANE, UnitCommand::Begin(Feed { job, source }));
    }

    pub(super) fn until_ended(&mut self) -> JobEnd {
        self.until_report(|report| match report {
            Report::JobEnded(end) => Some(end.clone()),
            _ => None,
        })
    }

    /// All of this has come from the machine, and nothing else.
    pub(super) fn until_arrived(&mut self, all: &[u8]) {
        let begin = Instant::now();
        let mut arrived = Vec::new();
        while arrived.len() < all.len() {
            assert!(begin.elapsed() < PATIENCE, "{} bytes of {}", arrived.len(), all.len());
            self.hear(Duration::from_millis(5));
            arrived = self.deliveries.iter().flat_map(|(_, bytes)| bytes.clone()).collect();
        }
        assert_eq!(String::from_utf8_lossy(&arrived), String::from_utf8_lossy(all));
    }

    fn until_report<T>(&mut self, finds: impl Fn(&Report) -> Option<T>) -> T {
        let begin = Instant::now();
        loop {
            if let Some(found) = self.seen.iter().find_map(&finds) {
                self.seen.clear();
                return found;
            }
            assert!(begin.elapsed() < PATIENCE, "it was never told: {:?}", self.seen);
            self.hear(Duration::from_millis(5));
        }
    }

    /// Takes what is told, for so long and no longer, and puts away what has come.
    pub(super) fn hear(&mut self, patience: Duration) {
        let until = Instant::now() + patience;
        while let Ok((_, report)) =
            self.reports.recv_timeout(until.saturating_duration_since(Instant::now()))
        {
            match report {
                Report::DeliveryBegun { bytes, .. } => {
                    self.deliveries.push((Some(bytes), Vec::new()));
                }
                report => self.seen.push(report),
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

/// What the plug-in sends of a program, built into this test, after an XON of the machine.
pub(super) fn sent_natively(name: &str, program: &[u8]) -> Vec<u8> {
    let plugin = NativePlugin::from_name(name).unwrap();
    let settings = Manifest::parse(plugin.manifest().as_bytes()).unwrap().resolve_settings([]);
    let options = LinkOptions { settings: settings.unwrap(), ..LinkOptions::default() };
    let mut line = VirtualLine::new(plugin.instantiate(), options, 16);
    let mut host = Recorder::default();
    line.link.open(Micros(0), &mut host).unwrap();
    line.link.received(Micros(1_000), &[0x11], &mut host).unwrap();
    host.add_source(JobId(7), program.to_vec());
    let size = Some(program.len() as u64);
    let job = Job { id: JobId(7), kind: 0, size, fields: Vec::new(), check: false };
    line.link.begin_job(Micros(2_000), job, &mut host).unwrap();
    line.transmit(Micros(2_000), &mut host).unwrap();
    line.run_until(Micros::from_secs(60), &mut host).unwrap();
    host.sent()
}

/// So many bytes of a program in which no part is as another.
pub(super) fn program(bytes: usize) -> Vec<u8> {
    let mut text: Vec<u8> =
        (1..).flat_map(|n| format!("N{n} G1 X{n}\n").into_bytes()).take(bytes).collect();
    if let Some(last) = text.last_mut() {
        *last = b'\n';
    }
    text
}

/// A plug-in as it was built for tests.
pub(super) fn built(name: &str) -> Vec<u8> {
    let folder = std::env::var_os("SOFTPLUG_PLUGINS").filter(|folder| !folder.is_empty());
    let beside = || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../target/plugins");
    let file = folder.map_or_else(beside, PathBuf::from).join(format!("{name}.wasm"));
    fs::read(&file)
        .unwrap_or_else(|_| panic!("there is no {}: run `cargo xtask build`", file.display()))
}
