//! The host's side of a lane: where job data comes from, where deliveries go,
//! what is told.

use softplug_abi::{Action, DeliveryId, Failure, JobId, Micros, ModemLines};
use softplug_link::{LinkHost, Supply};
use std::collections::VecDeque;
use std::task::Waker;

use super::ENDPOINT_JOBS;
use super::Reports;
use super::endpoint::{EndpointNews, EndpointRequest, LaneEndpoint, LineNews};
use super::job_end::{JobEnd, JobOutcome};
use super::report::Report;
use super::setup::{Feed, LaneId};
use super::status::LaneCounters;
use super::watch::{Seen, Watch, WatchEvent};
use crate::allowance::Allowance;
use crate::channel::{ChannelHost, Place};
use crate::port::Input;
use crate::reservoir::{Drawn, ReservoirReader, ReservoirWriter, reservoir};

/// Reports of all kinds a lane may make in a second, and at once.
const REPORTS_A_SECOND: i64 = 10_000;
/// Deliveries that may wait to be put away. Their bytes have the link's room; each also costs
/// whoever puts it away a file and a line in a journal, however few bytes it has.
const DELIVERIES: usize = 256;
/// Notes and states a lane may tell in a second, and at once: people read them.
const WORDS_A_SECOND: i64 = 20;

/// What a lane knows beside its channel.
pub(super) struct LaneHost {
    id: LaneId,
    reports: Reports,
    /// Wakes this lane.
    wake: Waker,
    all: Allowance,
    words: Allowance,
    /// A plug-in that tells without end is at fault.
    pub(super) has_flooded: bool,
    pub(super) job: Option<Active>,
    /// The job has ended; to be told with what has left.
    pub(super) ended: Option<Ended>,
    deliveries: VecDeque<Delivery>,
    delivery_room: usize,
    pub(super) endpoint: Option<LaneEndpoint>,
    pub(super) watch: Option<Watch>,
    /// The latest state, if it was not told.
    state: Option<String>,
    pub(super) own: LaneCounters,
}

/// A job under way.
pub(super) struct Active {
    pub(super) id: JobId,
    pub(super) source: Source,
    pub(super) taken: u64,
    /// What the port was given before it began.
    pub(super) from: Place,
    /// It asked for data and there was none.
    pub(super) is_hungry: bool,
    /// Why its data ends before its end.
    pub(super) source_failed: Option<String>,
    pub(super) is_aborted: bool,
}

pub(super) enum Source {
    Reservoir(ReservoirReader),
    Endpoint,
    /// It was rewound and waits for its data.
    Awaited,
}

/// A job that the plug-in has ended.
pub(super) struct Ended {
    pub(super) active: Active,
    pub(super) outcome: JobOutcome,
    pub(super) sent: u64,
}

/// A delivery until all of it has been put away.
struct Delivery {
    id: DeliveryId,
    to: Option<ReservoirWriter>,
    bytes: u64,
    /// Bytes given back to the link as room.
    counted: u64,
    is_open: bool,
}

impl LaneHost {
    pub(super) fn new(
        id: LaneId,
        reports: Reports,
        wake: Waker,
        delivery_room: u32,
        endpoint: Option<LaneEndpoint>,
    ) -> Self {
        Self {
            id,
            reports,
            wake,
            all: Allowance::new(REPORTS_A_SECOND),
            words: Allowance::new(WORDS_A_SECOND),
            has_flooded: false,
            job: None,
            ended: None,
            deliveries: VecDeque::new(),
            delivery_room: delivery_room as usize,
            endpoint,
            watch: None,
            state: None,
            own: LaneCounters::default(),
        }
    }

    pub(super) fn tell(&self, report: Report) {
        (self.reports)(self.id, report);
    }

    /// A job is given to the plug-in next.
    pub(super) fn begin(&mut self, feed: Feed, from: Place) -> softplug_link::Job {
        feed.source.wake_with(self.wake.clone());
        self.job = Some(Active::new(feed.job.id, Source::Reservoir(feed.source), from));
        feed.job
    }

    /// Begins the job of what comes in at the endpoint.
    pub(super) fn begin_endpoint(&mut self, id: JobId, from: Place) {
        self.job = Some(Active::new(id, Source::Endpoint, from));
        if let Some(lane) = &mut self.endpoint {
            lane.endpoint.job_begun();
        }
    }

    /// Data from the start, for a job that was rewound.
    pub(super) fn refill(&mut self, job: JobId, source: ReservoirReader) {
        if let Some(active) = self.job.as_mut().filter(|active| active.id == job) {
            source.wake_with(self.wake.clone());
            active.source = Source::Reservoir(source);
        }
    }

    pub(super) fn endpoint_news(&mut self) -> Option<EndpointNews> {
        self.endpoint.as_mut()?.endpoint.next_news()
    }

    pub(super) fn next_endpoint_request(&mut self) -> Option<EndpointRequest> {
        self.endpoint.as_mut()?.endpoint.next_request()
    }

    /// Whether a job waits for data that is there now.
    pub(super) fn is_supplied(&self) -> bool {
        let Some(active) = self.job.as_ref().filter(|active| active.is_hungry) else {
            return false;
        };
        match &active.source {
            Source::Reservoir(source) => source.is_ready(),
            Source::Endpoint => {
                self.endpoint.as_ref().is_some_and(|lane| lane.endpoint.has_supply())
            }
            Source::Awaited => false,
        }
    }

    /// Bytes that have come and are not put away.
    pub(super) fn to_put_away(&self) -> u64 {
        self.deliveries.iter().map(|delivery| delivery.bytes - delivery.counted).sum()
    }

    /// Bytes in the buffer of the job's source.
    pub(super) fn level(&self) -> u64 {
        match self.job.as_ref().map(|active| &active.source) {
            Some(Source::Reservoir(source)) => source.level() as u64,
            _ => 0,
        }
    }

    /// Tells a state that was held back, once it may.
    pub(super) fn tell_state(&mut self, now: Micros) {
        if self.state.is_some()
            && self.words.take(now)
            && let Some(state) = self.state.take()
        {
            self.tell(Report::State(state));
        }
    }

    /// When a state that was held back may be told.
    pub(super) fn poll_timeout(&self) -> Option<Micros> {
        self.state.as_ref().map(|_| self.words.next())
    }

    /// What is told for an action: all of it, or the lane is taken for flooding.
    fn tell_of_action(&mut self, now: Micros, report: Report) {
        if self.all.take(now) {
            self.tell(report);
        } else {
            self.has_flooded = true;
        }
    }

    fn show(&mut self, at: Micros, what: impl FnOnce() -> WatchEvent) {
        let Some(watch) = &self.watch else { return };
        match watch.show(Seen { at, what: what() }) {
            Some(true) => {}
            Some(false) => self.own.unseen += 1,
            None => self.watch = None,
        }
    }

    fn line_news(&mut self, news: &LineNews) {
        if let Some(lane) = &mut self.endpoint {
            lane.endpoint.line_news(news);
        }
    }

    fn job_ended(&mut self, now: Micros, job: JobId, outcome: JobOutcome, sent: u64) {
        match self.job.take_if(|active| active.id == job) {
            Some(active) => self.ended = Some(Ended { active, outcome, sent }),
            // It found another under way.
            None if job < ENDPOINT_JOBS => {
                let end = JobEnd::unbegun(job, outcome, sent);
                self.tell_of_action(now, Report::JobEnded(end));
            }
            None => {}
        }
    }

    fn begin_delivery(&mut self, now: Micros, id: DeliveryId, job: JobId) {
        let is_for_client = job == JobId::NONE || job >= ENDPOINT_JOBS;
        let client = self.endpoint.as_ref().filter(|lane| lane.endpoint.takes_deliveries());
        let to = if is_for_client && client.is_some() {
            None
        } else {
            let (writer, bytes) = reservoir(self.delivery_room, 0, self.delivery_room);
            writer.wake_with(self.wake.clone());
            let job = Some(job).filter(|job| *job != JobId::NONE);
            self.tell_of_action(
                now,
                Report::DeliveryBegun { delivery: id, job, unit: None, bytes },
            );
            Some(writer)
        };
        if self.deliveries.len() >= DELIVERIES {
            self.has_flooded = true;
        }
        self.deliveries.push_back(Delivery { id, to, bytes: 0, counted: 0, is_open: true });
    }

    fn deliver(&mut self, bytes: &[u8]) {
        // The one that is open is the latest.
        let Some(delivery) = self.deliveries.back_mut() else { return };
        delivery.bytes += bytes.len() as u64;
        let Some(to) = &mut delivery.to else {
            delivery.counted = delivery.bytes;
            if let Some(lane) = &mut self.endpoint {
                lane.endpoint.deliver(bytes);
            }
            return;
        };
        if to.is_abandoned() {
            return;
        }
        // The link's room for deliveries is the reservoir's size.
        let _ = to.write(bytes);
        delivery.wake_when_read(self.delivery_room);
    }

    fn end_delivery(&mut self, now: Micros, id: DeliveryId, failure: Option<Failure>, status: u16) {
        let Some(delivery) = self.deliveries.back_mut().filter(|delivery| delivery.id == id) else {
            return;
        };
        delivery.is_open = false;
        let bytes = delivery.bytes;
        match &mut delivery.to {
            Some(to) => {
                to.finish();
                let end = Report::DeliveryEnded { delivery: id, failure, status, bytes };
                self.tell_of_action(now, end);
            }
            None => {
                if let Some(lane) = &mut self.endpoint {
                    lane.endpoint.delivery_ended();
                }
            }
        }
    }
}

impl Active {
    fn new(id: JobId, source: Source, from: Place) -> Self {
        Self {
            id,
            source,
            taken: 0,
            from,
            is_hungry: false,
            source_failed: None,
            is_aborted: false,
        }
    }

    /// Whether nothing comes for now, and that is meant.
    pub(super) fn is_source_stopped(&self) -> bool {
        matches!(&self.source, Source::Reservoir(source) if source.is_stopped())
    }
}

impl Delivery {
    /// Has the lane woken when enough is put away to tell of it, as long as there
    /// is something to be put away.
    fn wake_when_read(&self, room: usize) {
        let Some(to) = self.to.as_ref().filter(|to| !to.is_armed()) else { return };
        if self.counted < self.bytes {
            to.wake_at(to.level().saturating_sub(room / 8));
        }
    }

    /// Whether somebody still has to do with it.
    fn is_under_way(&self) -> bool {
        let is_kept = self.to.as_ref().is_some_and(|to| !to.is_abandoned());
        self.is_open || self.counted < self.bytes || is_kept
    }

    /// Bytes put away since the last call.
    fn drained(&mut self) -> u64 {
        let Some(to) = &self.to else { return 0 };
        let away = if to.is_abandoned() { self.bytes } else { to.consumed().min(self.bytes) };
        let fresh = away.saturating_sub(self.counted);
        self.counted += fresh;
        fresh
    }
}

impl ChannelHost for LaneHost {
    fn heard(&mut self, now: Micros, input: &Input<'_>) {
        match input {
            Input::Bytes(bytes) => self.show(now, || WatchEvent::Heard(bytes.to_vec())),
            Input::LineError { kind, byte, .. } => {
                let (kind, byte) = (*kind, *byte);
                self.show(now, || WatchEvent::LineError { kind, byte });
                self.line_news(&LineNews::LineError(kind));
            }
        }
    }

    fn wrote(&mut self, now: Micros, bytes: &[u8]) {
        self.show(now, || WatchEvent::Sent(bytes.to_vec()));
    }

    fn modem_lines(&mut self, now: Micros, known: ModemLines, on: ModemLines) {
        self.show(now, || WatchEvent::ModemLines(known, on));
        self.line_news(&LineNews::ModemLines(known, on));
    }
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl LinkHost for LaneHost {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        match action {
            Action::DeliveryBegin { delivery, job } => self.begin_delivery(now, *delivery, *job),
            Action::Deliver { bytes, .. } => self.deliver(bytes),
            Action::DeliveryName { delivery, name }
                if self.deliveries.back().is_some_and(|delivery| delivery.to.is_some()) =>
            {
                let (delivery, name) = (*delivery, (*name).to_owned());
                self.tell_of_action(now, Report::DeliveryNamed { delivery, name });
            }
            Action::DeliveryEnd { delivery, failure, status } => {
                self.end_delivery(now, *delivery, *failure, *status);
            }
            Action::JobDone { job, sent } => self.job_ended(now, *job, JobOutcome::Done, *sent),
            Action::JobFailed { job, failure, status, sent } => {
                let outcome = JobOutcome::Failed { failure: *failure, status: *status };
                self.job_ended(now, *job, outcome, *sent);
            }
            Action::CheckResult { job, failure: Some(failure), status, line, column } => {
                let (failure, status, line, column) = (*failure, *status, *line, *column);
                let outcome = JobOutcome::CheckFailed { failure, status, line, column };
                self.job_ended(now, *job, outcome, 0);
            }
            Action::Request { request, kind, fields } => {
                let (request, kind, fields) = (*request, *kind, fields.as_bytes().to_vec());
                self.tell_of_action(now, Report::Request { request, kind, fields });
            }
            Action::Withdraw { request } => {
                self.tell_of_action(now, Report::Withdrawn { request: *request });
            }
            Action::Note { level, code, text } => {
                if self.words.take(now) {
                    let (level, code, text) = (*level, *code, (*text).to_owned());
                    self.tell(Report::Note { level, code, text });
                } else {
                    self.own.left_out += 1;
                }
            }
            Action::State { name } => {
                self.show(now, || WatchEvent::State((*name).to_owned()));
                if self.state.replace((*name).to_owned()).is_some() {
                    self.own.left_out += 1;
                }
                self.tell_state(now);
            }
            Action::Hold => {
                self.show(now, || WatchEvent::Held);
                self.line_news(&LineNews::Held(true));
            }
            Action::Release => {
                self.show(now, || WatchEvent::Released);
                self.line_news(&LineNews::Held(false));
            }
            Action::Transmit { .. }
            | Action::TransmitUrgent { .. }
            | Action::Discard
            | Action::SetTimer { .. }
            | Action::CancelTimer { .. }
            | Action::ModemLines { .. }
            | Action::Break { .. }
            | Action::Want { .. }
            | Action::DeliveryName { .. }
            | Action::CheckResult { .. }
            | Action::Saved { .. } => {}
        }
    }

    fn supply(&mut self, job: JobId, buffer: &mut [u8]) -> Supply {
        let Some(active) = self.job.as_mut().filter(|active| active.id == job) else {
            return Supply::End;
        };
        let supply = match &mut active.source {
            Source::Awaited => Supply::Later,
            Source::Endpoint => {
                self.endpoint.as_mut().map_or(Supply::End, |lane| lane.endpoint.supply(buffer))
            }
            Source::Reservoir(source) => match source.read(buffer) {
                Drawn::Bytes(count) => Supply::Bytes(count),
                Drawn::Later => Supply::Later,
                Drawn::End => Supply::End,
                // Never an end: it would pass for the program's.
                Drawn::Failed => {
                    let why = source.failure().unwrap_or("its source failed");
                    active.source_failed.get_or_insert_with(|| why.to_owned());
                    Supply::Later
                }
            },
        };
        active.is_hungry = supply == Supply::Later;
        if let Supply::Bytes(count) = supply {
            active.taken += count as u64;
        }
        supply
    }

    fn rewind(&mut self, job: JobId) {
        let Some(active) = self.job.as_mut().filter(|active| active.id == job) else { return };
        active.taken = 0;
        if matches!(active.source, Source::Endpoint) {
            if let Some(lane) = &mut self.endpoint {
                lane.endpoint.rewind();
            }
            return;
        }
        active.source = Source::Awaited;
        self.tell(Report::Rewind { job });
    }

    fn drained(&mut self) -> u32 {
        let mut drained = self.endpoint.as_mut().map_or(0, |lane| lane.endpoint.drained());
        for delivery in &mut self.deliveries {
            drained += delivery.drained() as u32;
            delivery.wake_when_read(self.delivery_room);
        }
        self.deliveries.retain(Delivery::is_under_way);
        drained
    }
}
