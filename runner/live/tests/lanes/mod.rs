//! A reactor of native XON/XOFF plug-ins on ptys.

use std::collections::HashMap;
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::os::fd::AsFd;
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, poll};
use softplug_abi::manifest::{Manifest, SettingValues};
use softplug_abi::{JobId, LineParameters};
use softplug_link::Job;
use softplug_live::channel::StationOptions;
use softplug_live::pty::PtyPair;
use softplug_live::reactor::{
    Backoff, Command, Feed, JobEnd, LaneFigures, LaneId, LaneSetup, Reactor, ReactorOptions,
    Report, Watchdogs,
};
use softplug_live::reservoir::reservoir;
use softplug_live::{PortOptions, PortSpec};
use softplug_native::{NativeInstance, NativePlugin};

/// After so long a report that does not come fails the test.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// A reactor, its reports, and the far ends of its lanes.
pub(crate) struct Bench {
    pub(crate) reactor: Reactor<NativeInstance>,
    reports: Receiver<(LaneId, Report)>,
    /// Reports that were not asked for yet.
    early: Vec<(LaneId, Report)>,
    pub(crate) machines: HashMap<LaneId, PtyPair>,
    added: u32,
}

impl std::fmt::Debug for Bench {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.reports.try_iter()).entries(&self.early).finish()
    }
}

impl Bench {
    pub(crate) fn start() -> Self {
        Self::start_with(ReactorOptions::default().links_per_thread)
    }

    /// With so many lanes for each thread.
    pub(crate) fn start_with(links_per_thread: usize) -> Self {
        let (sender, reports) = channel();
        let options = ReactorOptions { links_per_thread, ..ReactorOptions::default() };
        let reactor = Reactor::start(options, move |lane, report| {
            let _ = sender.send((lane, report));
        })
        .unwrap();
        Self { reactor, reports, early: Vec::new(), machines: HashMap::new(), added: 0 }
    }

    /// A lane on a new pty.
    pub(crate) fn add(&mut self, baud: u32) -> LaneId {
        self.add_with(baud, |_| {})
    }

    /// Adds a lane that is set up otherwise.
    pub(crate) fn add_with(
        &mut self,
        baud: u32,
        change: impl FnOnce(&mut LaneSetup<NativeInstance>),
    ) -> LaneId {
        self.add_on(PtyPair::open().unwrap(), baud, change)
    }

    /// A lane that works.
    pub(crate) fn add_up(&mut self, baud: u32) -> LaneId {
        let lane = self.add(baud);
        self.wait_for(lane, |report| matches!(report, Report::Up));
        lane
    }

    /// A lane on this pty.
    pub(crate) fn add_on(
        &mut self,
        machine: PtyPair,
        baud: u32,
        change: impl FnOnce(&mut LaneSetup<NativeInstance>),
    ) -> LaneId {
        self.added += 1;
        let id = LaneId(self.added);
        let mut setup = setup(PortSpec::Device(machine.slave_path().to_owned()), baud);
        change(&mut setup);
        self.machines.insert(id, machine);
        self.reactor.add(id, setup);
        id
    }

    /// The next report of the lane that `is_it` says yes to.
    pub(crate) fn wait_for(&mut self, lane: LaneId, is_it: impl Fn(&Report) -> bool) -> Report {
        if let Some(at) = self.early.iter().position(|(id, report)| *id == lane && is_it(report)) {
            return self.early.remove(at).1;
        }
        loop {
            let (id, report) = self
                .reports
                .recv_timeout(PATIENCE)
                .unwrap_or_else(|error| panic!("{error}, but {:?}", self.early));
            if id == lane && is_it(&report) {
                return report;
            }
            self.early.push((id, report));
        }
    }

    /// Begins a job with all its data there.
    pub(crate) fn send(&mut self, lane: LaneId, job: JobId, data: &[u8]) {
        let (mut writer, source) = reservoir(data.len(), 0, data.len());
        assert_eq!(writer.write(data), data.len());
        writer.finish();
        let job = self::job(job.0, Some(data.len() as u64));
        self.reactor.tell(lane, Command::Begin(Feed { job, source }));
    }

    pub(crate) fn end_of_job(&mut self, lane: LaneId) -> JobEnd {
        let end = self.wait_for(lane, |report| matches!(report, Report::JobEnded(_)));
        let Report::JobEnded(end) = end else { unreachable!() };
        end
    }

    /// What the machine gets, exactly so many bytes.
    pub(crate) fn read_from_machine(&self, lane: LaneId, count: usize) -> Vec<u8> {
        read_exactly(&self.machines[&lane], count)
    }

    /// Waits until the lane's figures are so.
    pub(crate) fn until(&self, lane: LaneId, is_so: impl Fn(&LaneFigures) -> bool) {
        let end = Instant::now() + PATIENCE;
        while !is_so(&self.figures(lane)) {
            assert!(Instant::now() < end, "it never came to that: {:?}", self.figures(lane));
            thread::sleep(Duration::from_millis(1));
        }
    }

    pub(crate) fn figures(&self, lane: LaneId) -> LaneFigures {
        self.reactor.status(lane).unwrap().read()
    }
}

pub(crate) fn job(id: u32, size: Option<u64>) -> Job {
    Job { id: JobId(id), kind: 0, size, fields: Vec::new(), check: false }
}

pub(crate) fn setup(port: PortSpec, baud: u32) -> LaneSetup<NativeInstance> {
    LaneSetup {
        port,
        port_options: PortOptions::new(LineParameters::new(baud)),
        station: StationOptions { settings: settings(&[]), ..StationOptions::default() },
        instance: NativePlugin::XonXoff.instantiate(),
        endpoint: None,
        watchdogs: Watchdogs::default(),
        reopen: Backoff::default(),
        recorder_bytes: 0,
    }
}

pub(crate) fn settings(asked: &[(&str, &str)]) -> SettingValues {
    let manifest = Manifest::parse(NativePlugin::XonXoff.manifest().as_bytes()).unwrap();
    manifest.resolve_settings(asked.iter().copied()).unwrap()
}

pub(crate) fn read_exactly(machine: &PtyPair, count: usize) -> Vec<u8> {
    let mut master = File::from(machine.master().as_fd().try_clone_to_owned().unwrap());
    let mut received = vec![0; count];
    let mut at = 0;
    while at < count {
        let _ = poll(&mut [PollFd::new(&master, PollFlags::IN)], None);
        match master.read(&mut received[at..]) {
            Ok(read) => at += read,
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => panic!("{error}"),
        }
    }
    received
}

/// Writes all, as fast as it is taken.
pub(crate) fn write_all(machine: &PtyPair, bytes: &[u8]) {
    let mut at = 0;
    while at < bytes.len() {
        let _ = poll(&mut [PollFd::new(machine.master(), PollFlags::OUT)], None);
        at += machine.write(&bytes[at..]).unwrap();
    }
}

/// A program of so many bytes, no two blocks alike.
pub(crate) fn program(bytes: usize) -> Vec<u8> {
    (0..).flat_map(|n| format!("N{n:05} G1 X{}\n", n % 97).into_bytes()).take(bytes).collect()
}
