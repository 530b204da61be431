//! One link of a unit, as the gateway sees it.

mod jobs;
mod plugin;

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use softplug_abi::{DeliveryId, Failure, LinkDownReason, Micros, RequestId};
use softplug_unit_bus::{Consumption, Unit};
use softplug_unit_protocol::{Digest, Identity, SlotState, ToServer, ToUnit};
use softplug_unit_uplink::Outbox;

use super::Thread;
use crate::allowance::Allowance;
use crate::reactor::{Condition, JobEnd, JobOutcome, LaneId, LaneStatus, Report};
use crate::text::plain_text;
use crate::units::delivery::{Arrivals, Flood};
use crate::units::job::UnitJob;
use crate::units::{
    UnitCommand, UnitLinkFigures, UnitPlugin, UnitSetup, UnitSlotFigures, longest_fields, piece,
};
use plugin::{Change, fault};

/// Most requests of a machine that are not answered.
const MOST_REQUESTS: usize = 256;
/// Most answers that are kept in case the unit did not hear them.
const MOST_ANSWERED: usize = 16;
/// Notes and states a second, and at once, as of a lane of this computer.
const WORDS_A_SECOND: i64 = 20;
/// More than a port does that is tried again four times a second.
const CHANGES_A_SECOND: i64 = 10;
/// How long the end of a job is waited for when the link is closed.
const CLOSING: Micros = Micros::from_millis(1_000);
/// After a refusal the unit is asked again in this span.
const AGAIN: Micros = Micros::from_millis(10_000);

/// What a lane works with that is not its own.
pub(super) struct Around<'a> {
    pub(super) outbox: &'a mut Outbox,
    pub(super) is_up: bool,
    pub(super) thread: &'a Thread,
}

/// A lane sends job data while fewer messages than this wait.
const MOST_WAITING: usize = 8;

impl Around<'_> {
    fn say(&mut self, message: &ToUnit<'_>) {
        if self.is_up {
            self.outbox.push(message, false);
        }
    }
}

pub(super) struct UnitLane {
    id: LaneId,
    setup: UnitSetup,
    status: Arc<LaneStatus>,
    /// Its number in this session, once the unit has named it.
    number: Option<u8>,
    slots: [(SlotState, Digest); 2],
    /// The plug-in that the unit runs, as far as is known.
    runs: Digest,
    change: Option<Change>,
    /// The plug-in before a swap that is on trial.
    former: Option<UnitPlugin>,
    /// When what was refused is tried again.
    again_at: Option<Micros>,
    job: Option<UnitJob>,
    /// What the machine takes.
    consumption: Consumption,
    /// Bytes of the unit's buffer, once a job has shown them.
    capacity: u64,
    /// A job of nobody that is known here is aborted first.
    foreign_job: Option<u64>,
    arrivals: Arrivals,
    requests: BTreeSet<RequestId>,
    /// The last answers: a unit that did not hear one asks again in the next session.
    answered: VecDeque<(RequestId, Result<Vec<u8>, Failure>)>,
    /// Those of an earlier session that the unit has not named again.
    doubtful_requests: BTreeSet<RequestId>,
    words: Allowance,
    /// How often its port may come and go: each time stands in the journal.
    changes: Allowance,
    is_port_up: bool,
    closing_until: Option<Micros>,
    is_closed: bool,
}

impl UnitLane {
    pub(super) fn new(id: LaneId, setup: UnitSetup, status: Arc<LaneStatus>) -> Self {
        status.set_condition(Condition::Opening);
        let arrivals = Arrivals::new(setup.stored);
        Self {
            id,
            setup,
            status,
            number: None,
            slots: [(SlotState::Empty, [0; 32]); 2],
            runs: [0; 32],
            change: None,
            former: None,
            again_at: None,
            job: None,
            consumption: Consumption::default(),
            capacity: 0,
            foreign_job: None,
            arrivals,
            requests: BTreeSet::new(),
            answered: VecDeque::new(),
            doubtful_requests: BTreeSet::new(),
            words: Allowance::new(WORDS_A_SECOND),
            changes: Allowance::new(CHANGES_A_SECOND),
            is_port_up: false,
            closing_until: None,
            is_closed: false,
        }
    }

    pub(super) fn id(&self) -> LaneId {
        self.id
    }

    pub(super) fn is_closed(&self) -> bool {
        self.is_closed
    }

    /// Whether a link of the unit, one of so many, is the one that is driven.
    pub(super) fn is_called(&self, name: &str, links: u8) -> bool {
        self.setup.address.link.as_deref().map_or(links == 1, |link| link == name)
    }

    pub(super) fn is_number(&self, number: u8) -> bool {
        self.number == Some(number)
    }

    pub(super) fn poll_timeout(&self) -> Option<Micros> {
        let again_at = self.again_at.filter(|_| self.number.is_some());
        again_at.into_iter().chain(self.closing_until).min()
    }

    fn report(&self, report: Report, around: &Around<'_>) {
        (around.thread.reports)(self.id, report);
    }

    pub(super) fn session_began(&mut self, unit: Identity, is_same_unit: bool, thread: &Thread) {
        self.number = None;
        self.arrivals.session_began(unit.0);
        if is_same_unit {
            self.doubtful_requests = self.requests.clone();
            return;
        }
        // A unit that was started anew has forgotten what was under way, and numbers anew.
        self.answered.clear();
        for report in self.arrivals.interrupted() {
            (thread.reports)(self.id, report);
        }
        for request in std::mem::take(&mut self.requests) {
            (thread.reports)(self.id, Report::Withdrawn { request });
        }
    }

    /// The unit says what the link is doing: in answer to a query, or because its plug-in has
    /// changed.
    pub(super) fn found(&mut self, number: u8, message: &ToServer<'_>, around: &mut Around<'_>) {
        let ToServer::Link { is_up: _, digest, job, pass, received, is_whole, .. } = *message
        else {
            return;
        };
        let is_news = self.number.replace(number) != Some(number);
        self.runs = digest;
        if self.change.as_ref().is_some_and(|change| {
            change.swap.is_none() && change.is_ordered && change.plugin.digest == digest
        }) {
            self.change = None;
        }
        if !is_news {
            return;
        }
        self.again_at = None;
        self.take_up_job(number, job, pass, received, is_whole, around);
        // A download goes on, and what was ordered is ordered again.
        if let Some(change) = &mut self.change {
            change.is_ordered = false;
        } else if self.job.as_ref().is_none_or(|job| !job.is_begun) {
            let plugin = self.setup.plugin.clone();
            self.change = Some(Change::to(plugin, None));
        }
        self.order(around);
    }

    pub(super) fn tell(&mut self, command: UnitCommand, around: &mut Around<'_>) {
        match command {
            UnitCommand::Begin(feed) => {
                feed.source.wake_with(around.thread.waker.clone());
                let number = (around.thread.identity << 32) | u64::from(feed.job.id.0);
                self.job = Some(UnitJob::new(number, feed));
            }
            UnitCommand::Refill { job, source } => {
                source.wake_with(around.thread.waker.clone());
                if let Some(active) = self.job_of(job) {
                    active.refill(source);
                }
            }
            UnitCommand::Pause(job) => self.pause(job, true, around),
            UnitCommand::Resume(job) => self.pause(job, false, around),
            UnitCommand::Abort(job) => self.abort(job, around),
            UnitCommand::ForceResume => self.plain(|link| ToUnit::ForceResume { link }, around),
            UnitCommand::CancelSwap => self.cancel_swap(around),
            UnitCommand::Reopen => self.plain(|link| ToUnit::Reopen { link }, around),
            UnitCommand::Answer { request, answer } => self.answer(request, answer, around),
            UnitCommand::Swap { plugin, when, probation } => {
                let swap = Some((when, probation));
                self.change = Some(Change::to(plugin, swap));
                self.order(around);
            }
            UnitCommand::Replace(plugin) => {
                self.setup.plugin = plugin.clone();
                self.change = Some(Change::to(plugin, None));
                self.order(around);
            }
            UnitCommand::Halt(why) => {
                let why = &why[..why.floor_char_boundary(600.min(piece(around.outbox)))];
                if let Some(link) = self.number {
                    around.say(&ToUnit::Halt { link, why });
                }
            }
            UnitCommand::Close => self.begin_to_close(around),
        }
    }

    fn plain(&mut self, message: impl FnOnce(u8) -> ToUnit<'static>, around: &mut Around<'_>) {
        if let Some(link) = self.number {
            around.say(&message(link));
        }
    }

    fn answer(
        &mut self,
        request: RequestId,
        answer: Result<Vec<u8>, Failure>,
        around: &mut Around<'_>,
    ) {
        if !self.requests.remove(&request) {
            return;
        }
        self.say_answer(request, &answer, around);
        if self.answered.len() >= MOST_ANSWERED {
            self.answered.pop_front();
        }
        self.answered.push_back((request, answer));
    }

    fn say_answer(
        &self,
        request: RequestId,
        answer: &Result<Vec<u8>, Failure>,
        around: &mut Around<'_>,
    ) {
        let Some(link) = self.number else { return };
        let bytes = match answer {
            Ok(bytes) => bytes,
            Err(failure) => {
                let refused = Some(*failure);
                around.say(&ToUnit::Answer {
                    link,
                    request: request.0,
                    refused,
                    is_last: true,
                    bytes: &[],
                });
                return;
            }
        };
        let piece = piece(around.outbox);
        let count = bytes.len().div_ceil(piece).max(1);
        for (number, part) in (1..=count).zip(bytes.chunks(piece).chain([&[][..]])) {
            let is_last = number == count;
            around.say(&ToUnit::Answer {
                link,
                request: request.0,
                refused: None,
                is_last,
                bytes: part,
            });
        }
    }

    /// A job is aborted first, as far as there is time: the unit would feed its machine further.
    fn begin_to_close(&mut self, around: &mut Around<'_>) {
        let id = self.job.as_ref().filter(|job| job.is_begun).map(|job| job.job.id);
        match id.filter(|_| self.number.is_some()) {
            Some(id) => {
                self.abort(id, around);
                self.closing_until = Some(around.thread.clock.now() + CLOSING);
                self.status.set_condition(Condition::Closing);
            }
            None => self.close(around),
        }
    }

    /// At once.
    pub(super) fn close(&mut self, around: &mut Around<'_>) {
        if self.is_closed {
            return;
        }
        if let Some(end) = self.job.as_ref().map(UnitJob::interrupted) {
            self.let_go(end, around);
        }
        self.arrivals.given_up();
        self.status.set_condition(Condition::Removed);
        self.is_closed = true;
    }

    /// The unit has named all its links, and this one is not among them.
    pub(super) fn is_unknown(&mut self, known: &[String], thread: &Thread) {
        if self.number.is_none() {
            let known = known.join(", ");
            let detail = match &self.setup.address.link {
                Some(link) => format!("the unit has no link \"{link}\"; it has {known}"),
                None => format!("the unit has several links; name one of them: {known}"),
            };
            self.down(LinkDownReason::Failed, detail, AGAIN, thread);
        }
    }

    /// The connection is gone.
    pub(super) fn lost(&mut self, detail: &str, retry_in: Micros, thread: &Thread) {
        self.number = None;
        self.down(LinkDownReason::Disconnected, detail.to_owned(), retry_in, thread);
    }

    fn down(&mut self, reason: LinkDownReason, detail: String, retry_in: Micros, thread: &Thread) {
        self.is_port_up = false;
        self.status.set_condition(Condition::Down);
        let differences = Vec::new();
        (thread.reports)(self.id, Report::Down { reason, detail, differences, retry_in });
    }

    fn up(&mut self, around: &Around<'_>) {
        if self.is_port_up {
            return;
        }
        self.is_port_up = true;
        self.status.set_condition(Condition::Up);
        self.report(Report::Opened { path: None, differences: Vec::new() }, around);
        self.report(Report::Up, around);
    }

    /// # Errors
    /// The unit sends more than it may: it is to be sent away.
    pub(super) fn hear(
        &mut self,
        message: &ToServer<'_>,
        around: &mut Around<'_>,
    ) -> Result<(), Flood> {
        match *message {
            ToServer::Downloaded { until, .. } => self.downloaded(until, around),
            ToServer::Installed { slot, .. } => self.installed(slot, around),
            ToServer::NotInstalled { why, .. } => self.not_taken(&plain_text(why), around),
            ToServer::Up { .. } | ToServer::Down { .. }
                if !self.changes.take(around.thread.clock.now()) =>
            {
                return Err(Flood);
            }
            ToServer::Up { .. } => {
                if self.change.is_none() || self.runs == self.setup.plugin.digest {
                    self.up(around);
                }
            }
            ToServer::Down { reason, retry_in, detail, .. } => {
                let retry_in = Micros(i64::try_from(retry_in).unwrap_or(i64::MAX));
                let detail = format!("the unit's port: {}", plain_text(detail));
                self.down(reason, detail, retry_in, around.thread);
            }
            ToServer::Credit { job, pass, received, until, .. } => {
                let now = around.thread.clock.now();
                let credited =
                    self.unit_job(job).map(|active| active.credit(pass, received, until, now));
                let capacity = self.unit_job(job).map(|active| active.capacity());
                self.capacity = capacity.unwrap_or(self.capacity);
                if let Some(Err(error)) = credited {
                    self.give_up_job(&error.to_string(), around);
                }
            }
            ToServer::Rewind { job, .. } => {
                if let Some(active) = self.unit_job(job).filter(|active| active.pass() == 0) {
                    active.rewound();
                    let job = active.job.id;
                    self.report(Report::Rewind { job }, around);
                }
            }
            ToServer::Progress { .. } => self.progress(message, around),
            ToServer::Ended { job, .. } => self.ended(job, message, around),
            ToServer::Delivery { delivery, job, at, name, .. } => {
                let job = self.unit_job(job).map(|active| active.job.id);
                let (room, waker) = (self.setup.delivery_room, &around.thread.waker);
                let reports =
                    self.arrivals.announced(DeliveryId(delivery), job, at, name, room, waker)?;
                for report in reports {
                    self.report(report, around);
                }
            }
            ToServer::Delivered { delivery, at, bytes, .. } => {
                self.arrivals.data(DeliveryId(delivery), at, bytes)?;
            }
            ToServer::DeliveryEnded { delivery, failure, status, size, .. } => {
                self.arrivals.ended(DeliveryId(delivery), failure, status, size);
            }
            ToServer::Request { request, kind, fields, .. } => {
                let request = RequestId(request);
                self.doubtful_requests.remove(&request);
                if let Some((_, answer)) = self.answered.iter().find(|(of, _)| *of == request) {
                    self.say_answer(request, answer, around);
                    return Ok(());
                }
                if self.requests.len() >= MOST_REQUESTS && !self.requests.contains(&request) {
                    return Err(Flood);
                }
                if self.requests.insert(request) {
                    let fields = fields.to_vec();
                    self.report(Report::Request { request, kind, fields }, around);
                }
            }
            ToServer::Withdrawn { request, .. } => {
                let request = RequestId(request);
                if self.requests.remove(&request) {
                    self.report(Report::Withdrawn { request }, around);
                }
            }
            ToServer::Note { .. } | ToServer::State { .. }
                if !self.words.take(around.thread.clock.now()) => {}
            ToServer::Note { level, code, text, .. } => {
                self.report(Report::Note { level, code, text: plain_text(text) }, around);
            }
            ToServer::State { name, .. } => self.report(Report::State(plain_text(name)), around),
            ToServer::Fault { what, .. } => {
                self.status.set_condition(Condition::Faulted);
                // It is up again when another plug-in has taken over the port.
                self.is_port_up = false;
                self.report(Report::Fault(Box::new(fault(what, false))), around);
            }
            ToServer::Swapped { outcome, pause, why, .. } => {
                self.swapped(
                    outcome,
                    Micros(i64::try_from(pause).unwrap_or(i64::MAX)),
                    why,
                    around,
                );
            }
            ToServer::Counters { .. } => self.count(message),
            ToServer::Told { .. } => {
                for request in std::mem::take(&mut self.doubtful_requests) {
                    if self.requests.remove(&request) {
                        self.report(Report::Withdrawn { request }, around);
                    }
                }
            }
            ToServer::Refused { message, job, why, .. } => self.refused(message, job, why, around),
            ToServer::Unit { .. } | ToServer::Slot { .. } | ToServer::Link { .. } => {}
        }
        Ok(())
    }

    fn count(&mut self, message: &ToServer<'_>) {
        if let ToServer::Counters {
            bytes_in, bytes_out, holds, held, starved, starved_for, ..
        } = *message
        {
            self.status.store_unit_counters([
                bytes_in,
                bytes_out,
                holds,
                held,
                starved,
                starved_for,
            ]);
        }
    }

    fn refused(&mut self, message: u8, number: u64, why: &str, around: &mut Around<'_>) {
        let why = &*plain_text(why);
        match message {
            ToUnit::OPEN | ToUnit::SWAP => self.not_taken(why, around),
            ToUnit::BEGIN => {
                let Some(active) = self.unit_job(number) else { return };
                let outcome = JobOutcome::Failed { failure: Failure::BadJob, status: 0 };
                let end = JobEnd { outcome, ..active.left.clone() };
                tracing::warn!(why, "the unit refuses a job");
                self.let_go(end, around);
            }
            _ => tracing::warn!(message, why, "the unit refuses"),
        }
    }

    /// The bus that says when its data may leave.
    pub(super) fn bus(&self) -> Option<&str> {
        self.setup.bus.as_deref()
    }

    /// What the bus is told of the unit; `fair` is what leaves it in a second while that is not
    /// known.
    pub(super) fn demand(&self, fair: f64, around: &Around<'_>) -> Unit {
        let Some(job) = self.job.as_ref().filter(|job| job.may_send()) else { return Unit::ABSENT };
        let drain = self.consumption.latest().unwrap_or(fair);
        let demand = job.demand(drain, around.thread.clock.now(), &around.thread.waker);
        let has_room = around.outbox.len() < MOST_WAITING && self.number.is_some();
        Unit { has_data: demand.has_data && around.is_up && has_room, ..demand }
    }

    /// Sends job data that may leave now, at most so many bytes. How many it were.
    pub(super) fn feed(&mut self, most: u64, around: &mut Around<'_>) -> u64 {
        let (Some(link), Some(job)) = (self.number, &mut self.job) else { return 0 };
        let mut allowed = most;
        if job.may_send() {
            job.pump(link, MOST_WAITING, &mut allowed, around.outbox);
        }
        most - allowed
    }

    /// As it is shown.
    pub(super) fn figures(&self) -> UnitLinkFigures {
        UnitLinkFigures {
            slots: self.slots.map(|(state, digest)| {
                let is_empty = state == SlotState::Empty;
                UnitSlotFigures { state, digest: (!is_empty).then_some(digest) }
            }),
            runs: (self.runs != [0; 32]).then_some(self.runs),
            buffer: self.capacity,
            consumes: self.consumption.most(),
        }
    }

    /// What is under way goes on, as far as there is room.
    pub(super) fn pump(&mut self, around: &mut Around<'_>) {
        let is_over = self.job.is_none() || self.number.is_none();
        if self.closing_until.is_some_and(|at| is_over || at <= around.thread.clock.now()) {
            self.close(around);
            return;
        }
        let Some(link) = self.number else { return };
        if self.again_at.is_some_and(|at| at <= around.thread.clock.now()) {
            self.again_at = None;
            self.order(around);
        }
        for report in self.arrivals.pump(link, around.outbox) {
            self.report(report, around);
        }
        let is_ready = self.change.is_none() && self.foreign_job.is_none();
        let Some(job) = &mut self.job else { return };
        if !job.is_begun && is_ready && job.job.fields.len() > longest_fields(around.outbox) {
            let outcome = JobOutcome::Failed { failure: Failure::BadJob, status: 0 };
            let end = JobEnd::unbegun(job.job.id, outcome, 0);
            self.let_go(end, around);
            return;
        }
        if !job.is_begun && is_ready {
            job.begin(link, around.outbox);
        }
        if job.may_send() {
            // On a bus only the end, which needs no turn.
            let mut allowed = if self.setup.bus.is_some() { 0 } else { u64::MAX };
            job.pump(link, MOST_WAITING, &mut allowed, around.outbox);
        }
    }
}
