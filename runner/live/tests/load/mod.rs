//! Many links under load both ways, machines that hold now and then, and swaps in
//! the middle of it.

mod fragile;
mod hostile;
mod machine;

pub(crate) use fragile::Fragile;
pub(crate) use hostile::{Guests, HOSTILE};
pub(crate) use machine::{Machine, XOFF, XON, pattern};

use std::collections::HashMap;
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use softplug_abi::manifest::SettingValues;
use softplug_abi::{Instance, JobId, LineParameters, Micros};
use softplug_link::{Job, Spare, Successor};
use softplug_live::channel::StationOptions;
use softplug_live::pty::PtyPair;
use softplug_live::reactor::{
    Backoff, Command, Feed, JobOutcome, LaneFigures, LaneId, LaneInstance, LaneSetup, Probation,
    Reactor, ReactorOptions, Report, Swap, SwapReport, Watchdogs, When,
};
use softplug_live::reservoir::{Drawn, ReservoirReader, reservoir};
use softplug_live::{PortOptions, PortSpec};

/// Without any report for so long, the load stands still.
pub(crate) const PATIENCE: Duration = Duration::from_mins(1);

/// Characters in flight at most: with fewer, a thread that drives many saturated
/// links wakes too often.
const DEPTH: u32 = 16;

/// Links under load.
pub(crate) struct Load<I: Instance> {
    pub(crate) reactor: Reactor<Fragile<I>>,
    reports: Receiver<(LaneId, Report)>,
    pub(crate) lanes: HashMap<LaneId, Lane>,
    make: Box<dyn Fn() -> I>,
    settings: SettingValues,
    recorder_bytes: usize,
}

/// What the host has seen of one link.
#[derive(Default)]
pub(crate) struct Lane {
    /// Deliveries, as they come.
    readers: Vec<ReservoirReader>,
    pub(crate) delivered: Vec<u8>,
    pub(crate) job: Option<JobOutcome>,
    pub(crate) faults: Vec<softplug_live::reactor::LaneFault>,
    /// Swaps that were asked for, and what came of each.
    pub(crate) swaps: Vec<SwapReport>,
    is_swapping: bool,
    is_up: bool,
}

impl<I: LaneInstance> Load<I> {
    pub(crate) fn new(
        settings: SettingValues,
        recorder_bytes: usize,
        make: impl Fn() -> I + 'static,
    ) -> Self {
        let (sender, reports) = channel();
        let tell = move |lane, report| {
            let _ = sender.send((lane, report));
        };
        let reactor = Reactor::start(ReactorOptions::default(), tell).unwrap();
        let make = Box::new(make);
        Self { reactor, reports, lanes: HashMap::new(), make, settings, recorder_bytes }
    }

    /// A link with a machine on it; returns the machine's end.
    pub(crate) fn add(&mut self, baud: u32) -> (LaneId, PtyPair) {
        let instance = Fragile::sound((self.make)());
        self.add_plugin(baud, instance, self.settings.clone())
    }

    /// Adds a lane with another plug-in.
    pub(crate) fn add_plugin(
        &mut self,
        baud: u32,
        instance: Fragile<I>,
        settings: SettingValues,
    ) -> (LaneId, PtyPair) {
        self.add_with(baud, instance, settings, |_| {})
    }

    /// Adds a lane with another plug-in that is set up otherwise.
    pub(crate) fn add_with(
        &mut self,
        baud: u32,
        instance: Fragile<I>,
        settings: SettingValues,
        change: impl FnOnce(&mut LaneSetup<Fragile<I>>),
    ) -> (LaneId, PtyPair) {
        let id = LaneId(self.lanes.len() as u32 + 1);
        let machine = PtyPair::open().unwrap();
        let mut setup = LaneSetup {
            port: PortSpec::Device(machine.slave_path().to_owned()),
            port_options: PortOptions::new(LineParameters::new(baud)),
            station: StationOptions { settings, depth: Some(DEPTH), ..StationOptions::default() },
            instance,
            endpoint: None,
            watchdogs: Watchdogs::default(),
            reopen: Backoff::default(),
            recorder_bytes: self.recorder_bytes,
        };
        change(&mut setup);
        self.reactor.add(id, setup);
        self.lanes.insert(id, Lane::default());
        (id, machine)
    }

    pub(crate) fn wait_until_up(&mut self) {
        self.attend(|lanes| lanes.values().all(|lane| lane.is_up));
    }

    /// Begins a job of which all data is there.
    pub(crate) fn begin(&mut self, lane: LaneId, data: &[u8]) {
        let (mut writer, source) = reservoir(data.len(), 0, data.len());
        assert_eq!(writer.write(data), data.len());
        writer.finish();
        let size = Some(data.len() as u64);
        let job = Job { id: JobId(1), kind: 0, size, fields: Vec::new(), check: false };
        self.reactor.tell(lane, Command::Begin(Feed { job, source }));
    }

    /// Swaps the plug-in for a fresh instance of itself, which fails at that event
    /// if it is on probation.
    pub(crate) fn swap(&mut self, lane: LaneId, on_probation: bool, fails_at: Option<u32>) {
        let accepts = vec![1];
        let spare = on_probation
            .then(|| Spare { instance: Fragile::sound((self.make)()), accepts: accepts.clone() });
        let instance = Fragile::new((self.make)(), fails_at);
        let settings = self.settings.clone();
        let successor = Successor { instance, settings, accepts, spare };
        let probation = Probation { events: 20, span: Micros::from_millis(50) };
        let swap = Swap { successor, when: When::Now, probation };
        self.reactor.tell(lane, Command::Swap(swap));
        if let Some(lane) = self.lanes.get_mut(&lane) {
            lane.is_swapping = true;
        }
    }

    /// Swaps for a plug-in that accepts these formats only.
    pub(crate) fn swap_as(&mut self, lane: LaneId, accepts: Vec<u16>, when: When) {
        let instance = Fragile::sound((self.make)());
        let settings = self.settings.clone();
        let successor = Successor { instance, settings, accepts, spare: None };
        let swap = Swap { successor, when, probation: Probation::default() };
        self.reactor.tell(lane, Command::Swap(swap));
    }

    pub(crate) fn is_swapping(&self, lane: LaneId) -> bool {
        self.lanes[&lane].is_swapping
    }

    /// Puts a fresh plug-in in the place of one that has ended.
    pub(crate) fn replace(&mut self, lane: LaneId, instance: Fragile<I>, settings: SettingValues) {
        self.reactor.tell(lane, Command::Replace { instance, settings });
    }

    /// Takes reports and deliveries until `is_done`.
    pub(crate) fn attend(&mut self, mut is_done: impl FnMut(&HashMap<LaneId, Lane>) -> bool) {
        let mut last = Instant::now();
        loop {
            if self.look() {
                last = Instant::now();
            }
            if is_done(&self.lanes) {
                return;
            }
            assert!(last.elapsed() < PATIENCE, "the load stands still");
        }
    }

    /// Takes reports until the lane's figures are so.
    pub(crate) fn until(&mut self, lane: LaneId, is_so: impl Fn(&LaneFigures) -> bool) {
        let end = Instant::now() + PATIENCE;
        let status = self.reactor.status(lane).unwrap();
        while !is_so(&status.read()) {
            assert!(Instant::now() < end, "it never came to that: {:?}", status.read());
            self.look();
        }
    }

    /// Takes what there is; whether there was anything.
    pub(crate) fn look(&mut self) -> bool {
        let mut was_anything = false;
        match self.reports.recv_timeout(Duration::from_millis(2)) {
            Ok((id, report)) => {
                was_anything = true;
                self.take(id, report);
                while let Ok((id, report)) = self.reports.try_recv() {
                    self.take(id, report);
                }
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(error) => panic!("{error}"),
        }
        for lane in self.lanes.values_mut() {
            was_anything |= lane.draw();
        }
        was_anything
    }

    fn take(&mut self, id: LaneId, report: Report) {
        let Some(lane) = self.lanes.get_mut(&id) else { return };
        match report {
            Report::Up => lane.is_up = true,
            Report::DeliveryBegun { bytes, .. } => lane.readers.push(bytes),
            Report::JobEnded(end) => lane.job = Some(end.outcome),
            Report::Fault(fault) => lane.faults.push(*fault),
            Report::Swapped(swapped) => {
                lane.is_swapping = matches!(swapped, SwapReport::Waiting)
                    || matches!(swapped, SwapReport::Done { on_probation: true, .. });
                lane.swaps.push(swapped);
            }
            _ => {}
        }
    }
}

impl Lane {
    /// Puts away what has come, one delivery after the other.
    fn draw(&mut self) -> bool {
        let before = self.delivered.len();
        while let Some(reader) = self.readers.first_mut() {
            let mut buffer = [0; 1_024];
            match reader.read(&mut buffer) {
                Drawn::Bytes(count) => self.delivered.extend(&buffer[..count]),
                Drawn::Later => break,
                Drawn::End | Drawn::Failed => drop(self.readers.remove(0)),
            }
        }
        self.delivered.len() > before
    }
}
