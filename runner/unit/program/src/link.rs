//! One link of the unit: its plug-in memory, its lane, and what its server has to know of it.

mod delivery;
mod job;

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::sync::mpsc::Sender;
use std::task::Waker;
use std::thread;

use softplug_abi::manifest::SettingValues;
use softplug_abi::{Failure, LineParameters, Micros};
use softplug_gateway::PortOptions;
use softplug_gateway::channel::StationOptions;
use softplug_gateway::port::parse_line;
use softplug_gateway::reactor::{
    Backoff, Command, LaneFigures, LaneId, LaneSetup, Probation, Reactor, Report, Swap, SwapReport,
    Watchdogs, When,
};
use softplug_host::{Host, Plugin, Session};
use softplug_link::{Spare, Successor};
use softplug_unit_protocol::{Digest, SwapOutcome, ToServer, ToUnit, WhenCode};
use softplug_unit_uplink::{Outbox, plain_text};

use crate::config::LinkConfig;
use crate::memory::{Bootable, Download, Memory};
use delivery::Deliveries;
use job::Jobs;

/// How long a lane that closes may take to let leave what its port has.
const CLOSING: Micros = Micros::from_millis(1_000);
/// The longest text in a message, in bytes.
const LONGEST_TEXT: usize = 600;
/// The longest fields of a request, in bytes: they must fit into a message.
const LONGEST_FIELDS: usize = 900;
/// Bytes of the flight recorder of a lane.
const RECORDER: usize = 64 << 10;
/// Bytes of what comes from the machine that wait for the uplink, beside those under way.
const DELIVERY_ROOM: u32 = 16 << 10;

/// What a link works with that is not its own.
pub(crate) struct Surroundings<'a> {
    pub(crate) reactor: &'a Reactor<Session>,
    pub(crate) host: &'a Host,
    pub(crate) outbox: &'a mut Outbox,
    /// Somebody is told.
    pub(crate) is_up: bool,
    /// Wakes the unit's thread.
    pub(crate) waker: &'a Waker,
    /// Where plug-ins go that were compiled.
    pub(crate) compiled: &'a Sender<Compiled>,
    pub(crate) next_lane: &'a mut u32,
}

impl Surroundings<'_> {
    fn say(&mut self, message: &ToServer<'_>) {
        if self.is_up {
            self.outbox.push(message, false);
        }
    }

    fn remark(&mut self, message: &ToServer<'_>) {
        if self.is_up {
            self.outbox.push(message, true);
        }
    }
}

/// A plug-in that was compiled for a link, and what for.
pub(crate) struct Compiled {
    pub(crate) link: u8,
    plugin: Result<Plugin, String>,
    digest: Digest,
    settings: Settings,
    purpose: Purpose,
}

/// Name and value, as people write them.
type Settings = BTreeMap<String, String>;

#[derive(Clone, Debug)]
enum Purpose {
    /// It is the link's plug-in from now on.
    Run,
    /// It takes the place of the running one.
    Swap { when: When, probation: Probation },
}

/// A plug-in on a lane.
#[derive(Clone)]
struct Running {
    digest: Digest,
    plugin: Plugin,
    settings: Settings,
    values: SettingValues,
}

pub(crate) struct Link {
    number: u8,
    config: LinkConfig,
    memory: Memory,
    lane: Option<LaneId>,
    running: Option<Running>,
    /// What takes over, until it has.
    successor: Option<Running>,
    /// What ran before a swap that is on trial.
    former: Option<Running>,
    /// Its digest is being compiled.
    awaited: Option<Digest>,
    /// Settings with which that is wanted in the end.
    wanted: Option<Settings>,
    /// The fault that comes was asked for.
    is_halted: bool,
    next: Option<Box<Running>>,
    /// The plug-in that runs is on trial: confirmed when its port has opened.
    is_on_trial: bool,
    jobs: Jobs,
    deliveries: Deliveries,
    requests: BTreeMap<u32, Asked>,
    next_request: u32,
    is_port_open: bool,
    down: Option<(softplug_abi::LinkDownReason, Micros, String)>,
    state: String,
    fault: Option<String>,
    /// Bytes of an answer that is not whole yet.
    answer: Vec<u8>,
    counted: Option<LaneFigures>,
}

/// A request of the machine that is not answered.
struct Asked {
    /// The plug-in's number for it.
    request: u32,
    kind: u16,
    fields: Vec<u8>,
}

impl Link {
    pub(crate) fn new(number: u8, config: LinkConfig, memory: Memory) -> Self {
        Self {
            number,
            jobs: Jobs::new(number, config.buffer),
            deliveries: Deliveries::new(number),
            config,
            memory,
            lane: None,
            running: None,
            successor: None,
            former: None,
            awaited: None,
            wanted: None,
            is_halted: false,
            next: None,
            is_on_trial: false,
            requests: BTreeMap::new(),
            next_request: 1,
            is_port_open: false,
            down: None,
            state: String::new(),
            fault: None,
            answer: Vec::new(),
            counted: None,
        }
    }

    pub(crate) fn lane(&self) -> Option<LaneId> {
        self.lane
    }

    pub(crate) fn name(&self) -> &str {
        &self.config.name
    }

    /// The unit has started: what the memory has, runs.
    pub(crate) fn start(&mut self, around: &mut Surroundings<'_>) {
        if let Some(foreign) = self.memory.foreign() {
            tracing::warn!(link = self.config.name, "{foreign}");
        }
        let settings = self.kept_settings().unwrap_or_else(|| self.config.settings.clone());
        match self.memory.boot() {
            Ok(Some(bootable)) => self.compile(bootable, settings, Purpose::Run, around),
            Ok(None) => tracing::info!(link = self.config.name, "it has no plug-in yet"),
            Err(error) => tracing::error!(link = self.config.name, error, "its plug-in cannot run"),
        }
    }

    /// Compiling takes long where there is little to compute with: not on this thread.
    fn compile(
        &mut self,
        bootable: Bootable,
        settings: Settings,
        purpose: Purpose,
        around: &mut Surroundings<'_>,
    ) {
        let Bootable { digest, bytes, is_on_trial } = bootable;
        self.awaited = Some(digest);
        self.is_on_trial = is_on_trial;
        let (host, compiled, waker) =
            (around.host.clone(), around.compiled.clone(), around.waker.clone());
        let link = self.number;
        let load = move || {
            let plugin = host.load_bytes(&bytes).map_err(|error| error.to_string());
            if compiled.send(Compiled { link, plugin, digest, settings, purpose }).is_ok() {
                waker.wake();
            }
        };
        let spawned = thread::Builder::new().name("softplug-load".to_owned()).spawn(load);
        if let Err(error) = spawned {
            self.refuse(5, 0, &format!("no thread to compile it: {error}"), around);
        }
    }

    /// A plug-in was compiled.
    pub(crate) fn compiled(&mut self, compiled: Compiled, around: &mut Surroundings<'_>) {
        if self.awaited != Some(compiled.digest) {
            return;
        }
        self.awaited = None;
        let Compiled { plugin, digest, settings, purpose, .. } = compiled;
        let settings = self.wanted.take().unwrap_or(settings);
        let running = plugin.and_then(|plugin| {
            let given = settings.iter().map(|(name, value)| (name.as_str(), value.as_str()));
            let values =
                plugin.manifest().resolve_settings(given).map_err(|error| error.to_string())?;
            Ok(Running { digest, plugin, settings, values })
        });
        match (running, purpose) {
            (Ok(running), Purpose::Swap { when, probation }) if self.lane.is_some() => {
                self.swap(running, when, probation, around);
            }
            (Ok(running), _) => self.run(running, around),
            (Err(why), purpose) => {
                tracing::error!(link = self.config.name, why, "a plug-in is not taken");
                if self.is_on_trial {
                    self.is_on_trial = false;
                    self.memory.fail();
                    self.go_on_with_the_other();
                }
                match purpose {
                    Purpose::Run => self.refuse(5, 0, &why, around),
                    Purpose::Swap { .. } => self.tell_swap(SwapOutcome::Refused, 0, &why, around),
                }
            }
        }
    }

    /// A trial has failed: the memory is told that what ran before still runs.
    fn go_on_with_the_other(&mut self) {
        if let Err(error) = self.memory.boot() {
            tracing::error!(link = self.config.name, error, "nothing in its memory can run");
        }
    }

    /// The lane of this plug-in; behind the end of the lane that there is.
    fn run(&mut self, running: Running, around: &mut Surroundings<'_>) {
        if let Some(lane) = self.lane {
            self.next = Some(Box::new(running));
            let command = Command::Close { patience: CLOSING, hand_over: false };
            around.reactor.tell(lane, command);
            return;
        }
        let instance = match running.plugin.instantiate() {
            Ok(instance) => instance,
            Err(error) => {
                self.refuse(5, 0, &error.to_string(), around);
                return;
            }
        };
        let given = running.settings.iter().map(|(name, value)| (name.as_str(), value.as_str()));
        let named = running.plugin.manifest().line_for(given, &running.values);
        let base = named.map_or(LineParameters::new(0), |named| named.parameters);
        let text = self.config.line.as_deref().unwrap_or_default();
        let line = parse_line(text, base).unwrap_or(base);
        let lane = LaneId(*around.next_lane);
        *around.next_lane += 1;
        around.reactor.add(
            lane,
            LaneSetup {
                port: self.config.port.clone(),
                port_options: PortOptions::new(line),
                station: StationOptions {
                    settings: running.values.clone(),
                    depth: self.config.depth,
                    delivery_room: DELIVERY_ROOM,
                    ..StationOptions::default()
                },
                instance,
                endpoint: None,
                watchdogs: Watchdogs::default(),
                reopen: Backoff::default(),
                recorder_bytes: RECORDER,
            },
        );
        self.lane = Some(lane);
        self.keep_settings(&running.settings);
        self.running = Some(running);
        self.fault = None;
        self.tell_link(around);
    }

    fn swap(
        &mut self,
        successor: Running,
        when: When,
        probation: Probation,
        around: &mut Surroundings<'_>,
    ) {
        let (Some(lane), Some(running)) = (self.lane, &self.running) else { return };
        let (new, old) = (successor.plugin.manifest(), running.plugin.manifest());
        let accepts_back = old.accepts_of(new);
        let goes_back = new.state.saves.is_some_and(|format| accepts_back.contains(&format));
        let instances = successor.plugin.instantiate().and_then(|instance| {
            let has_spare = goes_back && probation != Probation::default();
            let spare = has_spare.then(|| running.plugin.instantiate()).transpose()?;
            Ok((instance, spare))
        });
        let (instance, spare) = match instances {
            Ok(instances) => instances,
            Err(error) => {
                let why = error.to_string();
                self.swapped(SwapReport::Refused { sentence: why }, around);
                return;
            }
        };
        let spare = spare.map(|instance| Spare { instance, accepts: accepts_back.to_vec() });
        let successor_of_lane = Successor {
            instance,
            settings: successor.values.clone(),
            accepts: new.accepts_of(old).to_vec(),
            spare,
        };
        self.successor = Some(successor);
        let swap = Swap { successor: successor_of_lane, when, probation };
        around.reactor.tell(lane, Command::Swap(swap));
    }

    fn swapped(&mut self, report: SwapReport, around: &mut Surroundings<'_>) {
        let (outcome, pause, why) = match report {
            SwapReport::Waiting => (SwapOutcome::Waiting, 0, String::new()),
            SwapReport::Done { pause, with_state, on_probation } => {
                if let Some(successor) = self.successor.take() {
                    self.keep_settings(&successor.settings);
                    let former = self.running.replace(successor);
                    self.former = former.filter(|_| on_probation);
                }
                if !on_probation {
                    self.is_on_trial = false;
                    self.memory.confirm();
                }
                let outcome =
                    if with_state { SwapOutcome::DoneWithState } else { SwapOutcome::Done };
                (outcome, pause.0.max(0) as u64, String::new())
            }
            SwapReport::Kept => {
                self.former = None;
                self.is_on_trial = false;
                self.memory.confirm();
                (SwapOutcome::Kept, 0, String::new())
            }
            SwapReport::Refused { sentence } => {
                self.successor = None;
                self.give_up_trial();
                (SwapOutcome::Refused, 0, sentence)
            }
            SwapReport::Reverted(fault) => {
                self.running = self.former.take();
                if let Some(settings) =
                    self.running.as_ref().map(|running| running.settings.clone())
                {
                    self.keep_settings(&settings);
                }
                self.give_up_trial();
                (SwapOutcome::Reverted, 0, fault.sentence)
            }
        };
        self.tell_swap(outcome, pause, &why, around);
    }

    /// What the memory gives now takes the place of a plug-in that has failed on trial.
    fn run_the_other(&mut self, around: &mut Surroundings<'_>) {
        let settings = self.kept_settings().unwrap_or_else(|| self.config.settings.clone());
        match self.memory.boot() {
            Ok(Some(bootable)) => self.compile(bootable, settings, Purpose::Run, around),
            Ok(None) => tracing::warn!(link = self.config.name, "there is none before it"),
            Err(error) => {
                tracing::error!(link = self.config.name, error, "the one before cannot run")
            }
        }
    }

    fn give_up_trial(&mut self) {
        if std::mem::take(&mut self.is_on_trial) {
            self.memory.fail();
            self.go_on_with_the_other();
        }
    }

    fn tell_swap(
        &mut self,
        outcome: SwapOutcome,
        pause: u64,
        why: &str,
        around: &mut Surroundings<'_>,
    ) {
        let why = short(why);
        around.say(&ToServer::Swapped { link: self.number, outcome, pause, why });
    }

    /// A message for this link.
    pub(crate) fn hear(&mut self, message: &ToUnit<'_>, around: &mut Surroundings<'_>) {
        match *message {
            ToUnit::Query {} => self.tell_all(around),
            ToUnit::Download { length, digest, signature, .. } => {
                let begun = self.memory.begin(length, digest, signature);
                self.tell_download(begun, around);
            }
            ToUnit::Piece { at, bytes, .. } => {
                let until = self.memory.piece(at, bytes).map(Download::Until);
                self.tell_download(until, around);
            }
            ToUnit::Install { .. } => {
                let installed = self.memory.install().map(Download::Whole);
                self.tell_download(installed, around);
            }
            ToUnit::Open { digest, settings, .. } => self.open(digest, settings, around),
            ToUnit::Close { .. } => self.close(around),
            ToUnit::Swap { digest, when, events, span, settings, .. } => {
                let when = match when {
                    WhenCode::Now => When::Now,
                    WhenCode::Idle => When::Idle,
                    WhenCode::NowOrIdle => When::NowOrIdle,
                };
                let span = Micros(i64::try_from(span).unwrap_or(i64::MAX));
                let purpose = Purpose::Swap { when, probation: Probation { events, span } };
                self.change(digest, settings, purpose, 18, around);
            }
            ToUnit::CancelSwap { .. } => self.command(Command::CancelSwap, around),
            ToUnit::Reopen { .. } => self.command(Command::Reopen, around),
            ToUnit::Halt { why, .. } => {
                self.is_halted = self.lane.is_some();
                self.command(Command::Halt(plain_text(why)), around);
            }
            ToUnit::ForceResume { .. } => self.command(Command::ForceResume, around),
            ToUnit::Answer { request, refused, is_last, bytes, .. } => {
                self.answer(request, refused, is_last, bytes, around);
            }
            ToUnit::Stored { delivery, until, is_whole, .. } => {
                self.deliveries.stored(delivery, until, is_whole);
            }
            ToUnit::Abort { job: 0, .. } => self.command(Command::Abort(0), around),
            ToUnit::Begin { .. }
            | ToUnit::Data { .. }
            | ToUnit::End { .. }
            | ToUnit::Fail { .. }
            | ToUnit::Pause { .. }
            | ToUnit::Resume { .. }
            | ToUnit::Abort { .. }
            | ToUnit::Noted { .. } => {
                let running = self.running.as_ref().filter(|_| self.fault.is_none());
                let kinds = running.map(|running| running.plugin.manifest().jobs.len());
                self.jobs.hear(message, self.lane.zip(kinds), around);
            }
        }
    }

    fn command(&mut self, command: Command<Session>, around: &mut Surroundings<'_>) {
        if let Some(lane) = self.lane {
            around.reactor.tell(lane, command);
        }
    }

    fn open(&mut self, digest: Digest, settings: &[u8], around: &mut Surroundings<'_>) {
        let is_there = self.running.as_ref().is_some_and(|running| {
            running.digest == digest && Some(&running.settings) == pairs(settings).as_ref()
        });
        if is_there && self.lane.is_some() && self.fault.is_none() {
            self.tell_link(around);
        } else if self.awaited == Some(digest) && pairs(settings).is_some() {
            // It is on its way, after a start for instance.
            self.wanted = pairs(settings);
        } else if self.jobs.is_under_way() {
            self.refuse(5, 0, "a job is under way", around);
        } else {
            self.change(digest, settings, Purpose::Run, 5, around);
        }
    }

    /// Another plug-in, or other settings.
    fn change(
        &mut self,
        digest: Digest,
        settings: &[u8],
        purpose: Purpose,
        message: u8,
        around: &mut Surroundings<'_>,
    ) {
        let Some(settings) = pairs(settings) else {
            self.refuse(message, 0, "the settings are not pairs of texts", around);
            return;
        };
        if self.awaited.is_some() || self.successor.is_some() || self.next.is_some() {
            self.refuse(message, 0, "another plug-in is just being taken", around);
            return;
        }
        match self.memory.change_to(digest) {
            Ok(bootable) => self.compile(bootable, settings, purpose, around),
            Err(why) => self.refuse(message, 0, &why, around),
        }
    }

    fn close(&mut self, around: &mut Surroundings<'_>) {
        self.next = None;
        if self.lane.is_none() {
            self.tell_link(around);
        }
        self.command(Command::Close { patience: CLOSING, hand_over: false }, around);
    }

    fn answer(
        &mut self,
        request: u32,
        refused: Option<Failure>,
        is_last: bool,
        bytes: &[u8],
        around: &mut Surroundings<'_>,
    ) {
        // One that was withdrawn meanwhile is not asked for any more.
        let Some(asked) = self.requests.get(&request) else { return };
        let request_of_lane = asked.request;
        self.answer.extend_from_slice(bytes);
        if !is_last && refused.is_none() {
            return;
        }
        let bytes = std::mem::take(&mut self.answer);
        self.requests.remove(&request);
        let answer = refused.map_or(Ok(bytes), Err);
        self.command(Command::Answer { request: request_of_lane, answer }, around);
    }

    fn tell_download(&mut self, download: Result<Download, String>, around: &mut Surroundings<'_>) {
        let link = self.number;
        match download {
            Ok(Download::Until(until)) => around.say(&ToServer::Downloaded { link, until }),
            Ok(Download::Whole(slot)) => around.say(&ToServer::Installed { link, slot }),
            Err(why) => around.say(&ToServer::NotInstalled { link, why: short(&why) }),
        }
    }

    /// What a new server has to know.
    fn tell_all(&mut self, around: &mut Surroundings<'_>) {
        for slot in self.memory.tell(self.number) {
            around.say(&slot);
        }
        self.tell_link(around);
        self.tell_port(around);
        let link = self.number;
        if !self.state.is_empty() {
            around.say(&ToServer::State { link, name: short(&self.state) });
        }
        if let Some(fault) = &self.fault {
            around.say(&ToServer::Fault { link, what: short(fault) });
        }
        self.answer.clear();
        self.jobs.tell_all(around);
        self.deliveries.begin_anew();
        for (&request, Asked { kind, fields, .. }) in &self.requests {
            around.say(&ToServer::Request { link, request, kind: *kind, fields });
        }
        around.say(&ToServer::Told { link });
        self.counted = None;
    }

    fn tell_link(&mut self, around: &mut Surroundings<'_>) {
        let (job, pass, received, is_whole) = self.jobs.received();
        around.say(&ToServer::Link {
            link: self.number,
            is_up: self.is_port_open,
            digest: self.running.as_ref().map_or([0; 32], |running| running.digest),
            job,
            pass,
            received,
            is_whole,
            name: &self.config.name,
        });
    }

    fn tell_port(&mut self, around: &mut Surroundings<'_>) {
        let link = self.number;
        match &self.down {
            _ if self.is_port_open => around.say(&ToServer::Up { link }),
            Some((reason, retry_in, detail)) => {
                let retry_in = retry_in.0.max(0) as u64;
                around.say(&ToServer::Down {
                    link,
                    reason: *reason,
                    retry_in,
                    detail: short(detail),
                });
            }
            None => {}
        }
    }

    fn refuse(&mut self, message: u8, job: u64, why: &str, around: &mut Surroundings<'_>) {
        tracing::warn!(link = self.config.name, message, why, "refused");
        around.say(&ToServer::Refused { message, link: self.number, job, why: short(why) });
    }

    /// What its lane tells.
    pub(crate) fn report(&mut self, report: Report, around: &mut Surroundings<'_>) {
        let link = self.number;
        match report {
            Report::Opened { path, differences } => {
                tracing::info!(link = self.config.name, ?path, ?differences, "the port is open");
            }
            Report::Up => {
                self.is_port_open = true;
                self.down = None;
                if self.former.is_none() && std::mem::take(&mut self.is_on_trial) {
                    self.memory.confirm();
                }
                self.tell_port(around);
            }
            Report::Down { reason, detail, retry_in, .. } => {
                self.is_port_open = false;
                self.down = Some((reason, retry_in, detail));
                self.tell_port(around);
            }
            Report::JobEnded(end) => self.jobs.ended(end, around),
            Report::Rewind { job } => self.jobs.rewind(job, self.lane, around),
            Report::DeliveryBegun { delivery, job, bytes } => {
                bytes.wake_with(around.waker.clone());
                let job = job.and_then(|job| self.jobs.number_of(job)).unwrap_or(0);
                self.deliveries.begun(delivery, job, bytes);
            }
            Report::DeliveryNamed { delivery, name } => self.deliveries.named(delivery, name),
            Report::DeliveryEnded { delivery, failure, status, bytes } => {
                self.deliveries.ended(delivery, failure, status, bytes);
            }
            Report::Request { request, fields, .. } if fields.len() > LONGEST_FIELDS => {
                let answer = Err(Failure::TooLong);
                self.command(Command::Answer { request, answer }, around);
            }
            Report::Request { request, kind, fields } => {
                let number = self.next_request;
                self.next_request += 1;
                around.say(&ToServer::Request { link, request: number, kind, fields: &fields });
                self.requests.insert(number, Asked { request, kind, fields });
            }
            Report::Withdrawn { request } => {
                let numbers: Vec<u32> = self
                    .requests
                    .extract_if(.., |_, asked| asked.request == request)
                    .map(|(number, _)| number)
                    .collect();
                for request in numbers {
                    around.say(&ToServer::Withdrawn { link, request });
                }
            }
            Report::Note { level, code, text } => {
                around.remark(&ToServer::Note { link, level, code, text: short(&text) });
            }
            Report::State(name) => {
                around.remark(&ToServer::State { link, name: short(&name) });
                self.state = name;
            }
            Report::Swapped(report) => self.swapped(report, around),
            Report::Fault(fault) => {
                // First how far its job was: whoever hears of the fault ends it.
                self.break_off_job(around);
                tracing::error!(
                    link = self.config.name,
                    fault = fault.sentence,
                    "its plug-in ended"
                );
                around.say(&ToServer::Fault { link, what: short(&fault.sentence) });
                self.fault = Some(fault.sentence);
                (self.successor, self.former) = (None, None);
                // Whoever stops it by hand says nothing of how good it is.
                if !std::mem::take(&mut self.is_halted) && self.is_on_trial {
                    self.give_up_trial();
                    self.run_the_other(around);
                }
            }
            Report::Removed => {
                self.break_off_job(around);
                self.lane = None;
                self.running = None;
                (self.successor, self.former) = (None, None);
                self.is_port_open = false;
                self.requests.clear();
                match self.next.take() {
                    Some(next) => self.run(*next, around),
                    None => self.tell_link(around),
                }
            }
            // There are no endpoints here, and no process to hand over to.
            Report::Alarm(_) | Report::Endpoint(_) | Report::HandedOver(_) => {}
        }
    }

    fn break_off_job(&mut self, around: &mut Surroundings<'_>) {
        let status = self.lane.and_then(|lane| around.reactor.status(lane));
        self.jobs.break_off(status.map(|status| status.read()), around);
    }

    /// Gives the uplink what it has room for, and asks for more.
    pub(crate) fn pump(
        &mut self,
        figures: Option<LaneFigures>,
        now: Micros,
        around: &mut Surroundings<'_>,
    ) {
        self.jobs.pump(figures.as_ref(), now, around);
        if let Some(figures) = figures {
            self.count(figures, around);
        }
    }

    /// Data for the server: while the session has room.
    pub(crate) fn deliver(&mut self, send: &mut dyn FnMut(&ToServer<'_>) -> bool, longest: usize) {
        self.deliveries.pump(send, longest);
    }

    fn count(&mut self, figures: LaneFigures, around: &mut Surroundings<'_>) {
        let is_quiet = figures.job != 0 || self.counted.as_ref() == Some(&figures);
        if is_quiet || !around.is_up {
            return;
        }
        around.remark(&ToServer::Counters {
            link: self.number,
            bytes_in: figures.bytes_in,
            bytes_out: figures.bytes_out,
            holds: figures.holds,
            held: figures.held_micros,
            starved: figures.starvations,
            starved_for: figures.starved_micros,
            line_errors: figures.line_errors.iter().sum(),
        });
        self.counted = Some(figures);
    }

    fn kept_settings(&self) -> Option<Settings> {
        let bytes = fs::read(&self.config.state).ok()?;
        let settings = pairs(&bytes);
        if settings.is_none() {
            let file = self.config.state.display();
            tracing::warn!("{file} does not hold settings; those of unit.toml are taken");
        }
        settings
    }

    /// What a server has set holds after the next start, too.
    fn keep_settings(&self, settings: &Settings) {
        let mut bytes = Vec::new();
        for (name, value) in settings {
            for text in [name, value] {
                bytes.extend_from_slice(text.as_bytes());
                bytes.push(0);
            }
        }
        if let Err(error) = replace(&self.config.state, &bytes) {
            let file = self.config.state.display();
            tracing::error!(%error, "{file} cannot be written: after a start the settings are old");
        }
    }
}

/// Writes a file in one step.
fn replace(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

/// Pairs of texts, each ended by a byte 00.
fn pairs(bytes: &[u8]) -> Option<Settings> {
    let text = std::str::from_utf8(bytes).ok()?;
    let mut settings = Settings::new();
    let mut rest = text;
    while !rest.is_empty() {
        let (name, after) = rest.split_once('\0')?;
        let (value, after) = after.split_once('\0')?;
        settings.insert(name.to_owned(), value.to_owned());
        rest = after;
    }
    Some(settings)
}

/// As much of a text as a message has room for.
fn short(text: &str) -> &str {
    &text[..text.floor_char_boundary(LONGEST_TEXT)]
}
