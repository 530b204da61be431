//! One link of a unit, as the gateway sees it.

use std::collections::BTreeSet;
use std::sync::Arc;

use softplug_abi::{Failure, LinkDownReason, Micros};
use softplug_unit_protocol::{Digest, Outcome, SlotState, SwapOutcome, ToServer, ToUnit, WhenCode};
use softplug_unit_uplink::{Outbox, plain_text};

use super::delivery::{Arrivals, Flood};
use super::job::UnitJob;
use super::thread::Thread;
use super::{UnitCommand, UnitPlugin, UnitSetup};
use crate::allowance::Allowance;
use crate::reactor::{
    Condition, JobEnd, JobOutcome, LaneFault, LaneId, LaneStatus, Probation, Report, SwapReport,
    UnitFigures, When,
};
use crate::recorder::Recording;

/// Bytes of a module in one message.
const PIECE: usize = 960;
/// The longest fields of a job, and settings, in bytes: they must fit into a message.
const LONGEST_FIELDS: usize = 900;
/// Most requests of a machine that are not answered.
const MOST_REQUESTS: usize = 256;
/// Notes and states a second, and at once, as of a lane of this computer.
const WORDS_A_SECOND: i64 = 20;
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

impl Around<'_> {
    fn say(&mut self, message: &ToUnit<'_>) {
        if self.is_up {
            self.outbox.push(message, false);
        }
    }
}

/// A plug-in on its way into the unit.
struct Change {
    plugin: UnitPlugin,
    /// `None`: it is the link's first one, or has other settings.
    swap: Option<(When, Probation)>,
    is_ordered: bool,
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
    /// A job of nobody that is known here is aborted first.
    foreign_job: Option<u64>,
    arrivals: Arrivals,
    requests: BTreeSet<u32>,
    /// Those of an earlier session that the unit has not named again.
    doubtful_requests: BTreeSet<u32>,
    words: Allowance,
    is_port_up: bool,
    closing_until: Option<Micros>,
    is_closed: bool,
}

impl UnitLane {
    pub(super) fn new(id: LaneId, setup: UnitSetup, status: Arc<LaneStatus>) -> Self {
        status.set_condition(Condition::Opening);
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
            foreign_job: None,
            arrivals: Arrivals::default(),
            requests: BTreeSet::new(),
            doubtful_requests: BTreeSet::new(),
            words: Allowance::new(WORDS_A_SECOND),
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

    pub(super) fn is_called(&self, name: &str) -> bool {
        self.setup.address.link == name
    }

    pub(super) fn is_number(&self, number: u8) -> bool {
        self.number == Some(number)
    }

    pub(super) fn due(&self) -> Option<Micros> {
        let again_at = self.again_at.filter(|_| self.number.is_some());
        again_at.into_iter().chain(self.closing_until).min()
    }

    fn report(&self, report: Report, around: &Around<'_>) {
        (around.thread.reports)(self.id, report);
    }

    pub(super) fn session_began(&mut self, is_same_unit: bool, thread: &Thread) {
        self.number = None;
        if is_same_unit {
            self.doubtful_requests = self.requests.clone();
            return;
        }
        // A unit that was started anew has forgotten what was under way.
        for report in self.arrivals.interrupted() {
            (thread.reports)(self.id, report);
        }
        for request in std::mem::take(&mut self.requests) {
            (thread.reports)(self.id, Report::Withdrawn { request });
        }
    }

    pub(super) fn slot(&mut self, link: u8, slot: u8, state: SlotState, digest: Digest) {
        // The link itself follows, and says by its name which one it is.
        if self.number.is_none_or(|number| number == link)
            && let Some(place) = self.slots.get_mut(usize::from(slot))
        {
            *place = (state, digest);
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
            self.change = Some(Change { plugin, swap: None, is_ordered: false });
        }
        self.order(around);
    }

    fn take_up_job(
        &mut self,
        link: u8,
        job: u64,
        pass: u8,
        received: u64,
        is_whole: bool,
        around: &mut Around<'_>,
    ) {
        self.foreign_job = None;
        let ours = self.job.as_ref().filter(|ours| ours.is_begun).map(|ours| ours.number);
        if job != 0 && ours != Some(job) {
            // Its server is no more: as a local port's job ends with its gateway.
            self.foreign_job = Some(job);
            around.say(&ToUnit::Abort { link, job });
        }
        let Some(active) = self.job.as_mut().filter(|active| active.is_begun) else { return };
        if job != active.number {
            // It never came there, or the unit was started anew.
            let end = active.interrupted();
            if end.bytes_maybe_left == 0 && end.maybe_left == 0 && !active.is_aborted {
                active.is_begun = false;
            } else {
                self.job = None;
                self.report(Report::JobEnded(end), around);
            }
            return;
        }
        if pass != active.pass() {
            let id = active.job.id;
            active.rewound();
            self.report(Report::Rewind { job: id }, around);
        }
        let Some(active) = &mut self.job else { return };
        if let Err(error) = active.resume(link, received, is_whole, around.outbox) {
            self.give_up_job(&error.to_string(), around);
        }
    }

    /// Positions do not fit together: nothing more is given, and the unit aborts it.
    fn give_up_job(&mut self, why: &str, around: &mut Around<'_>) {
        let (Some(job), Some(link)) = (&mut self.job, self.number) else { return };
        tracing::error!(why, job = job.job.id, "a job is aborted: the unit and we disagree");
        job.is_aborted = true;
        around.say(&ToUnit::Abort { link, job: job.number });
    }

    /// Has the unit take the plug-in that it is to run: downloads it if it is not there.
    fn order(&mut self, around: &mut Around<'_>) {
        let Some(link) = self.number.filter(|_| self.foreign_job.is_none()) else { return };
        let slots = self.slots;
        let runs = self.runs;
        let Some(change) = self.change.as_mut().filter(|change| !change.is_ordered) else { return };
        change.is_ordered = true;
        let UnitPlugin { ref module, digest, ref signature, ref settings } = change.plugin;
        let is_there = digest == runs
            || slots.iter().any(|(state, there)| {
                *there == digest
                    && matches!(
                        state,
                        SlotState::Written | SlotState::OnTrial | SlotState::Confirmed
                    )
            });
        if !is_there {
            let signature = signature.as_deref().unwrap_or_default();
            let length = module.len() as u32;
            around.say(&ToUnit::Download { link, length, digest, signature });
            return;
        }
        let settings = &pairs(settings);
        if settings.len() > LONGEST_FIELDS {
            let text = format!(
                "its settings have {} bytes; {LONGEST_FIELDS} are the most",
                settings.len()
            );
            self.not_taken(&text, around);
            return;
        }
        match change.swap {
            None => around.say(&ToUnit::Open { link, digest, settings }),
            Some((when, probation)) => {
                let when = match when {
                    When::Now => WhenCode::Now,
                    When::Idle => WhenCode::Idle,
                    When::NowOrIdle => WhenCode::NowOrIdle,
                };
                let (events, span) = (probation.events, probation.span.0.max(0) as u64);
                around.say(&ToUnit::Swap { link, digest, when, events, span, settings });
            }
        }
    }

    fn downloaded(&mut self, until: u32, around: &mut Around<'_>) {
        let (Some(link), Some(change)) = (self.number, &self.change) else { return };
        let module = &change.plugin.module;
        let rest = module.get(until as usize..).unwrap_or_default();
        if rest.is_empty() {
            around.say(&ToUnit::Install { link });
        } else {
            let bytes = &rest[..rest.len().min(PIECE)];
            around.say(&ToUnit::Piece { link, at: until, bytes });
        }
    }

    fn installed(&mut self, slot: u8, around: &mut Around<'_>) {
        let Some(change) = &mut self.change else { return };
        if let Some(place) = self.slots.get_mut(usize::from(slot)) {
            *place = (SlotState::Written, change.plugin.digest);
        }
        change.is_ordered = false;
        self.order(around);
    }

    /// The unit does not take the plug-in.
    fn not_taken(&mut self, why: &str, around: &mut Around<'_>) {
        let Some(change) = &mut self.change else { return };
        if change.swap.is_some() {
            self.change = None;
            let sentence = format!("the unit does not take it: {why}");
            self.report(Report::Swapped(SwapReport::Refused { sentence }), around);
            return;
        }
        change.is_ordered = false;
        // What its slots hold is of no use, whatever they say: it is downloaded again then.
        let digest = change.plugin.digest;
        for place in self.slots.iter_mut().filter(|(_, there)| *there == digest) {
            *place = (SlotState::Empty, [0; 32]);
        }
        self.runs = [0; 32];
        self.again_at = Some(around.thread.clock.now() + AGAIN);
        let detail = format!("the unit does not take the plug-in: {why}");
        self.down(LinkDownReason::Failed, detail, AGAIN, around.thread);
    }

    pub(super) fn tell(&mut self, command: UnitCommand, around: &mut Around<'_>) {
        match command {
            UnitCommand::Begin(feed) => {
                feed.source.wake_with(around.thread.waker.clone());
                let number = (around.thread.identity << 32) | u64::from(feed.job.id);
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
                self.change = Some(Change { plugin, swap, is_ordered: false });
                self.order(around);
            }
            UnitCommand::Replace(plugin) => {
                self.setup.plugin = plugin.clone();
                self.change = Some(Change { plugin, swap: None, is_ordered: false });
                self.order(around);
            }
            UnitCommand::Halt(why) => {
                let why = &why[..why.floor_char_boundary(600)];
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

    fn job_of(&mut self, id: u32) -> Option<&mut UnitJob> {
        self.job.as_mut().filter(|active| active.job.id == id)
    }

    fn pause(&mut self, id: u32, is_paused: bool, around: &mut Around<'_>) {
        let number = self.number;
        let Some(active) = self.job_of(id) else { return };
        active.is_paused = is_paused;
        let Some(link) = number.filter(|_| active.is_begun) else { return };
        let job = active.number;
        let message =
            if is_paused { ToUnit::Pause { link, job } } else { ToUnit::Resume { link, job } };
        around.say(&message);
    }

    fn abort(&mut self, id: u32, around: &mut Around<'_>) {
        let number = self.number;
        if id == 0 {
            self.plain(|link| ToUnit::Abort { link, job: 0 }, around);
            return;
        }
        let Some(active) = self.job_of(id) else { return };
        active.is_aborted = true;
        if !active.is_begun {
            let end = active.interrupted();
            self.job = None;
            self.report(Report::JobEnded(end), around);
        } else if let Some(link) = number {
            around.say(&ToUnit::Abort { link, job: active.number });
        }
        // Else it is said when the unit is back: it feeds the machine meanwhile.
    }

    fn cancel_swap(&mut self, around: &mut Around<'_>) {
        let is_ordered =
            self.change.as_ref().map(|change| (change.swap.is_some(), change.is_ordered));
        match is_ordered {
            Some((true, true)) => self.plain(|link| ToUnit::CancelSwap { link }, around),
            Some((true, false)) => {
                self.change = None;
                let sentence = "it was given up".to_owned();
                self.report(Report::Swapped(SwapReport::Refused { sentence }), around);
            }
            Some((false, _)) | None => {}
        }
    }

    fn answer(&mut self, request: u32, answer: Result<Vec<u8>, Failure>, around: &mut Around<'_>) {
        let Some(link) = self.number.filter(|_| self.requests.remove(&request)) else { return };
        let bytes = match answer {
            Ok(bytes) => bytes,
            Err(failure) => {
                let refused = Some(failure);
                around.say(&ToUnit::Answer { link, request, refused, is_last: true, bytes: &[] });
                return;
            }
        };
        let count = bytes.len().div_ceil(PIECE).max(1);
        for (number, part) in (1..=count).zip(bytes.chunks(PIECE).chain([&[][..]])) {
            let is_last = number == count;
            around.say(&ToUnit::Answer { link, request, refused: None, is_last, bytes: part });
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
        if let Some(job) = self.job.take() {
            self.report(Report::JobEnded(job.interrupted()), around);
        }
        for report in self.arrivals.interrupted() {
            self.report(report, around);
        }
        self.status.set_condition(Condition::Removed);
        self.is_closed = true;
    }

    /// The unit has named all its links, and this one is not among them.
    pub(super) fn is_unknown(&mut self, known: &[String], thread: &Thread) {
        if self.number.is_none() {
            let link = &self.setup.address.link;
            let detail = format!("the unit has no link \"{link}\"; it has {}", known.join(", "));
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
                let credited =
                    self.unit_job(job).map(|active| active.credit(pass, received, until));
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
            ToServer::Progress { .. } => self.progress(message),
            ToServer::Ended { job, .. } => self.ended(job, message, around),
            ToServer::Delivery { delivery, job, at, name, .. } => {
                let job = self.unit_job(job).map(|active| active.job.id);
                let (room, waker) = (self.setup.delivery_room, &around.thread.waker);
                let reports = self.arrivals.announced(delivery, job, at, name, room, waker)?;
                for report in reports {
                    self.report(report, around);
                }
            }
            ToServer::Delivered { delivery, at, bytes, .. } => {
                self.arrivals.data(delivery, at, bytes)?;
            }
            ToServer::DeliveryEnded { delivery, failure, status, size, .. } => {
                self.arrivals.ended(delivery, failure, status, size);
            }
            ToServer::Request { request, kind, fields, .. } => {
                self.doubtful_requests.remove(&request);
                if self.requests.len() >= MOST_REQUESTS && !self.requests.contains(&request) {
                    return Err(Flood);
                }
                if self.requests.insert(request) {
                    let fields = fields.to_vec();
                    self.report(Report::Request { request, kind, fields }, around);
                }
            }
            ToServer::Withdrawn { request, .. } => {
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

    fn unit_job(&mut self, number: u64) -> Option<&mut UnitJob> {
        self.job.as_mut().filter(|active| active.number == number)
    }

    fn progress(&mut self, message: &ToServer<'_>) {
        let ToServer::Progress {
            job,
            taken,
            maybe_left,
            surely_left,
            bytes_left,
            level,
            is_held,
            is_starved,
            ..
        } = *message
        else {
            return;
        };
        let Some(active) = self.unit_job(job) else { return };
        active.left = JobEnd {
            taken,
            maybe_left,
            surely_left,
            bytes_surely_left: bytes_left,
            ..active.left.clone()
        };
        let id = active.job.id;
        self.status.store_unit_job(&UnitFigures {
            job: id,
            taken,
            maybe_left,
            surely_left,
            bytes_left,
            level: u64::from(level),
            is_held,
            is_starved,
        });
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

    fn ended(&mut self, number: u64, message: &ToServer<'_>, around: &mut Around<'_>) {
        let Some(link) = self.number else { return };
        around.say(&ToUnit::Noted { link, job: number });
        if self.foreign_job == Some(number) {
            self.foreign_job = None;
            self.order(around);
        }
        let Some(active) = self.unit_job(number) else { return };
        let end = active.ended(end_of(active.job.id, message));
        self.job = None;
        self.status.store_unit_job(&UnitFigures::default());
        self.report(Report::JobEnded(end), around);
    }

    fn swapped(&mut self, outcome: SwapOutcome, pause: Micros, why: &str, around: &mut Around<'_>) {
        let has_probation = self
            .change
            .as_ref()
            .and_then(|change| change.swap)
            .is_some_and(|(_, probation)| probation != Probation::default());
        let report = match outcome {
            SwapOutcome::Waiting => SwapReport::Waiting,
            SwapOutcome::DoneWithState | SwapOutcome::Done => {
                if let Some(change) = self.change.take() {
                    self.runs = change.plugin.digest;
                    self.former = Some(std::mem::replace(&mut self.setup.plugin, change.plugin));
                }
                let with_state = outcome == SwapOutcome::DoneWithState;
                let on_probation = with_state && has_probation;
                SwapReport::Done { pause, with_state, on_probation }
            }
            SwapOutcome::Refused => {
                self.change = None;
                SwapReport::Refused { sentence: plain_text(why) }
            }
            SwapOutcome::Kept => {
                self.former = None;
                SwapReport::Kept
            }
            SwapOutcome::Reverted => {
                if let Some(former) = self.former.take() {
                    self.runs = former.digest;
                    self.setup.plugin = former;
                }
                SwapReport::Reverted(Box::new(fault(why, true)))
            }
        };
        self.report(Report::Swapped(report), around);
    }

    fn refused(&mut self, message: u8, number: u64, why: &str, around: &mut Around<'_>) {
        const BEGIN: u8 = 7;
        const OPEN: u8 = 5;
        const SWAP: u8 = 18;
        let why = &*plain_text(why);
        match message {
            OPEN | SWAP => self.not_taken(why, around),
            BEGIN => {
                let Some(active) = self.unit_job(number) else { return };
                let outcome = JobOutcome::Failed { failure: Failure::BadJob, status: 0 };
                let end = JobEnd { outcome, ..active.left.clone() };
                self.job = None;
                tracing::warn!(why, "the unit refuses a job");
                self.report(Report::JobEnded(end), around);
            }
            _ => tracing::warn!(message, why, "the unit refuses"),
        }
    }

    /// What is under way goes on, as far as there is room.
    pub(super) fn pump(&mut self, most: usize, around: &mut Around<'_>) {
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
        if !job.is_begun && is_ready && job.job.fields.len() > LONGEST_FIELDS {
            let outcome = JobOutcome::Failed { failure: Failure::BadJob, status: 0 };
            let end = JobEnd::unbegun(job.job.id, outcome, 0);
            self.job = None;
            self.report(Report::JobEnded(end), around);
            return;
        }
        if !job.is_begun && is_ready {
            job.begin(link, around.outbox);
        }
        if job.is_begun && !job.is_aborted && !job.is_waiting_for_refill() {
            job.pump(link, most, around.outbox);
        }
    }
}

fn fault(sentence: &str, on_probation: bool) -> LaneFault {
    LaneFault {
        event: None,
        sentence: plain_text(sentence),
        last_words: None,
        recording: Recording::default(),
        on_probation,
    }
}

fn end_of(job: u32, message: &ToServer<'_>) -> JobEnd {
    let ToServer::Ended {
        outcome,
        failure,
        status,
        line,
        column,
        taken,
        sent,
        maybe_left,
        surely_left,
        bytes_maybe_left,
        bytes_surely_left,
        why,
        ..
    } = *message
    else {
        return JobEnd::unbegun(job, JobOutcome::Done, 0);
    };
    let failure = failure.unwrap_or(Failure::Internal);
    let outcome = match outcome {
        Outcome::Done => JobOutcome::Done,
        Outcome::Failed => JobOutcome::Failed { failure, status },
        Outcome::CheckFailed => JobOutcome::CheckFailed { failure, status, line, column },
        Outcome::SourceFailed => JobOutcome::SourceFailed(why.to_owned()),
    };
    JobEnd {
        job,
        outcome,
        taken,
        sent,
        maybe_left,
        surely_left,
        bytes_maybe_left,
        bytes_surely_left,
    }
}

/// Each text ended by a byte 00.
pub(super) fn pairs(settings: &[(String, String)]) -> Vec<u8> {
    let mut bytes = Vec::new();
    for text in settings.iter().flat_map(|(name, value)| [name, value]) {
        bytes.extend_from_slice(text.as_bytes());
        bytes.push(0);
    }
    bytes
}
