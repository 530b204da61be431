//! One link of the unit: its plug-in memory, its lane, and what its server has to know of it.

mod delivery;
mod job;
mod plugin;
mod settings;
mod tell;

use std::collections::BTreeMap;
use std::sync::mpsc::Sender;
use std::task::Waker;

use softplug_abi::{Failure, JobId, Micros, RequestId};
use softplug_host::{Host, Session};
use softplug_live::plain_text;
use softplug_live::reactor::{Command, LaneFigures, LaneId, Probation, Reactor, Report, When};
use softplug_unit_protocol::{Digest, SwapOutcome, ToServer, ToUnit, WhenCode};
use softplug_unit_uplink::Outbox;

use crate::config::LinkConfig;
use crate::memory::{Download, Memory};
use delivery::Deliveries;
use job::Jobs;
use plugin::{Purpose, Running};
use settings::Given;

pub(crate) use plugin::Compiled;

/// The longest text in a message, in bytes.
const LONGEST_TEXT: usize = 600;
/// The longest fields of a request, in bytes: they must fit into a message.
const LONGEST_FIELDS: usize = 900;

/// The longest answer to a request, in bytes: no protocol's is nearly as long.
const LONGEST_ANSWER: usize = 1 << 20;

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
    wanted: Option<Given>,
    /// Settings that held before those of what is on trial.
    before: Option<Given>,
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
    /// Why nothing runs, if that is known.
    trouble: Option<String>,
    /// An answer that is not whole yet: to which request, and what has come of it.
    answer: (u32, Vec<u8>),
    counted: Option<LaneFigures>,
}

/// A request of the machine that is not answered.
struct Asked {
    /// The plug-in's number for it.
    request: RequestId,
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
            before: None,
            is_halted: false,
            next: None,
            is_on_trial: false,
            requests: BTreeMap::new(),
            next_request: 1,
            is_port_open: false,
            down: None,
            state: String::new(),
            fault: None,
            trouble: None,
            answer: (0, Vec::new()),
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
        match self.memory.boot() {
            Ok(Some(bootable)) => self.compile(bootable, self.settings(), Purpose::Run, around),
            Ok(None) => {
                tracing::info!(link = self.config.name, "nothing in its memory can run");
                self.trouble = self.memory.passed_over();
            }
            Err(error) => {
                let why = error.to_string();
                tracing::error!(link = self.config.name, error = why, "its plug-in cannot run");
                self.trouble = Some(why);
            }
        }
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
                if self.is_on_its_way(digest, settings) {
                    // Its server did not hear that, in a session that has ended.
                    self.tell_swap(SwapOutcome::Waiting, 0, "", around);
                    return;
                }
                let span = Micros(i64::try_from(span).unwrap_or(i64::MAX));
                let purpose = Purpose::Swap { when, probation: Probation { events, span } };
                self.change(digest, settings, purpose, ToUnit::SWAP, around);
            }
            ToUnit::CancelSwap { .. } => self.command(Command::CancelSwap, around),
            ToUnit::Reopen { .. } => self.command(Command::Reopen, around),
            ToUnit::Halt { why, .. } => {
                self.is_halted = self.lane.is_some() && self.fault.is_none();
                self.command(Command::Halt(plain_text(why)), around);
            }
            ToUnit::ForceResume { .. } => self.command(Command::ForceResume, around),
            ToUnit::Answer { request, refused, is_last, bytes, .. } => {
                self.answer(RequestId(request).0, refused, is_last, bytes, around);
            }
            ToUnit::Stored { delivery, until, is_whole, .. } => {
                self.deliveries.stored(delivery, until, is_whole);
            }
            ToUnit::Abort { job: 0, .. } => self.command(Command::Abort(JobId::NONE), around),
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
        let (of, so_far) = &mut self.answer;
        if *of != request {
            (*of, *so_far) = (request, Vec::new());
        }
        so_far.extend_from_slice(bytes);
        let is_too_long = so_far.len() > LONGEST_ANSWER;
        if !is_last && refused.is_none() && !is_too_long {
            return;
        }
        let bytes = std::mem::take(so_far);
        self.requests.remove(&request);
        let refused = refused.or(is_too_long.then_some(Failure::TooLong));
        let answer = refused.map_or(Ok(bytes), Err);
        self.command(Command::Answer { request: request_of_lane, answer }, around);
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
                    self.tell_slots(around);
                }
                self.tell_port(around);
            }
            Report::Down { reason, detail, retry_in, .. } => {
                self.is_port_open = false;
                self.down = Some((reason, retry_in, detail));
                self.tell_port(around);
            }
            Report::JobEnded(end) => self.jobs.ended(end),
            Report::Rewind { job } => self.jobs.rewind(job, self.lane, around),
            Report::DeliveryBegun { delivery, job, unit: _, bytes } => {
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
                self.break_off(around);
                tracing::error!(
                    link = self.config.name,
                    fault = fault.sentence,
                    "its plug-in ended"
                );
                around.say(&ToServer::Fault { link, what: short(&fault.sentence) });
                self.fault = Some(fault.sentence);
                (self.successor, self.former) = (None, None);
                // Whoever stops it by hand says nothing of how good it is.
                if !std::mem::take(&mut self.is_halted) {
                    self.give_way(around);
                }
            }
            Report::Removed => {
                self.break_off(around);
                self.lane = None;
                self.running = None;
                (self.successor, self.former) = (None, None);
                self.is_port_open = false;
                match self.next.take() {
                    Some(next) => self.run(*next, around),
                    None => self.tell_link(around),
                }
            }
            // There are no endpoints here, and no process to hand over to.
            Report::Alarm(_) | Report::Endpoint(_) | Report::HandedOver(_) => {}
        }
    }

    /// What was under way ends with the plug-in, or with its lane.
    fn break_off(&mut self, around: &mut Surroundings<'_>) {
        let status = self.lane.and_then(|lane| around.reactor.status(lane));
        self.jobs.break_off(status.map(|status| status.read()), around);
        self.deliveries.break_off();
        let link = self.number;
        for request in std::mem::take(&mut self.requests).into_keys() {
            around.say(&ToServer::Withdrawn { link, request });
        }
    }

    /// Gives the uplink what it has room for, and asks for more.
    pub(crate) fn pump(
        &mut self,
        figures: Option<LaneFigures>,
        now: Micros,
        around: &mut Surroundings<'_>,
    ) {
        self.jobs.pump(figures.as_ref(), now, around);
        // Not before its answers.
        if self.jobs.number().is_some_and(|job| !self.deliveries.answer(job)) {
            self.jobs.tell_end(around);
        }
        if let Some(figures) = figures {
            self.count(figures, around);
        }
    }

    /// Data for the server: while the session has room.
    pub(crate) fn deliver(&mut self, send: &mut dyn FnMut(&ToServer<'_>) -> bool, longest: usize) {
        self.deliveries.pump(send, longest);
    }
}

/// As much of a text as a message has room for.
fn short(text: &str) -> &str {
    &text[..text.floor_char_boundary(LONGEST_TEXT)]
}
