//! The layer: telegrams between jobs, requests and the procedure below.

use super::awaited::{Awaited, Due};
use super::job::{Job, Stage};
use super::series::{Request, Series};
use super::ways::{Wayfarer, Ways};
use crate::model::{Broken, Conditions, Effect, HostRequest, LineInput, Model};
use crate::r3964::Station;
use crate::r3964::room::Room;
use softplug_abi::{Failure, Micros};

/// Whose block the procedure has.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub(super) enum Sender {
    Nobody,
    Job,
    Reaction,
}

/// One station with RK512.
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Layer {
    /// 3964R or 3964.
    pub(super) station: Station,
    pub(super) reaction_time: Micros,
    pub(super) room: Room,
    pub(super) job: Option<Job>,
    /// The last id of a job.
    pub(super) jobs: u32,
    /// What the host was asked and has not answered.
    pub(super) request: Option<Request>,
    /// The partner's command that may go on.
    pub(super) series: Option<Series>,
    /// A command that has ended before it was whole: a partner may go on with it all the same.
    pub(super) ended: Option<Series>,
    /// Our reaction that waits for its turn.
    pub(super) reaction: Option<Vec<u8>>,
    pub(super) sender: Sender,
    pub(super) awaited: Awaited,
    is_open: bool,
    pub(super) is_down: bool,
    pub(super) ways: Ways,
}

impl Wayfarer for Layer {
    fn ways(&mut self) -> &mut Ways {
        &mut self.ways
    }
}

/// With 0 the time follows from the baud rate.
fn reaction_times(conditions: &Conditions) -> Vec<Micros> {
    let millis: &[i64] =
        match (conditions.settings.int("reaction_timeout", 20_000), conditions.line.baud) {
            (0, 0) => &[20_000],
            (0, 1..600) => &[10_000],
            (0, 600..1_200) => &[7_000],
            (0, 1_200..38_400) => &[5_000],
            (0, 38_400..) => &[3_000],
            (millis, _) => &[millis],
        };
    millis.iter().map(|millis| Micros::from_millis(*millis)).collect()
}

impl Layer {
    /// All that it may be in these conditions.
    pub(super) fn new(conditions: &Conditions) -> Option<Vec<Self>> {
        let station = Station::of_telegrams(conditions)?;
        let times = reaction_times(conditions).into_iter();
        Some(times.map(|time| Self::with(station.clone(), time, conditions)).collect())
    }

    fn with(station: Station, reaction_time: Micros, conditions: &Conditions) -> Self {
        Self {
            station,
            reaction_time,
            room: Room::new(conditions.delivery_room),
            job: None,
            jobs: 0,
            request: None,
            series: None,
            ended: None,
            reaction: None,
            sender: Sender::Nobody,
            awaited: Awaited::default(),
            is_open: false,
            is_down: false,
            ways: Ways::default(),
        }
    }

    pub(super) fn line(&mut self, at: Micros, input: &LineInput) {
        match input {
            LineInput::Down(_) => {
                self.is_down = true;
                self.station.line(at, input);
                self.go_down(at);
            }
            other => {
                self.look_at_room();
                self.is_down &= *other != LineInput::Up;
                self.station.line(at, other);
                self.hear(at);
            }
        }
    }

    fn go_down(&mut self, at: Micros) {
        self.withdraw("rk512.serve.withdrawn");
        self.end_series();
        self.reaction = None;
        self.hear(at);
        self.fail_job((Failure::LinkDown, 0, "rk512.job.abort"));
    }

    pub(super) fn left(&mut self, at: Micros, byte: u8) {
        self.station.left(at, byte);
        self.look_at_reaction();
        self.hear(at);
    }

    pub(super) fn due(&mut self, at: Micros) {
        // Data of a next telegram come behind what came from the line.
        self.feed(true);
        self.look_at_room();
        self.station.due(at);
        self.hear(at);
        if matches!(&self.job, Some(Job { stage: Stage::Awaiting(until), .. }) if *until <= at) {
            self.fail_job((Failure::NoAnswer, 0, "rk512.react.time-out"));
        }
        if self.request.as_ref().is_some_and(|request| request.until <= at) {
            self.request_ran_out();
        }
        self.room.tell();
        self.feed(true);
    }

    pub(super) fn host(&mut self, at: Micros, request: &HostRequest) {
        match request {
            HostRequest::Open => {
                self.is_open = true;
                self.is_down = false;
                self.room.open();
                self.station.host(at, request);
            }
            HostRequest::Close => self.close(at),
            HostRequest::Job { id, kind, fields, data } => self.take_job(*id, kind, fields, data),
            HostRequest::Pause(id) => self.pause(*id, true),
            HostRequest::Resume(id) => self.pause(*id, false),
            HostRequest::Abort(0) => self.abort_delivery(at),
            HostRequest::Abort(id) => self.abort(at, *id),
            HostRequest::Keep => self.room.keep(true),
            HostRequest::PutAway(bytes) => self.room.put_away(*bytes as usize),
            HostRequest::PutAllAway => self.room.keep(false),
            HostRequest::Answer(id, answer) => {
                self.answer(*id, answer);
                self.feed(true);
            }
            HostRequest::ForceResume => {}
        }
        if self.is_open {
            self.room.tell();
        }
    }

    fn close(&mut self, at: Micros) {
        self.is_open = false;
        self.station.host(at, &HostRequest::Close);
        let _ = self.station.reports();
        self.sender = Sender::Nobody;
        (self.series, self.reaction, self.request) = (None, None, None);
        if let Some(job) = self.job.take() {
            let failure = Failure::Interrupted;
            // Whether its delivery is under way before all has come is left open.
            if !job.fetched.is_empty() && self.ways.is_other() {
                self.deliver(job.fetched.to_vec(), Some(failure), 0, "rk512.fetch.follow-up");
            }
            let due = Due::Failed { job: job.id, failure, status: 0, sent: 0 };
            self.awaited.push("rk512.line.telegram", due);
        }
    }

    pub(super) fn deliver(
        &mut self,
        bytes: Vec<u8>,
        failure: Option<Failure>,
        status: u16,
        clause: &'static str,
    ) {
        self.awaited.push(clause, Due::Delivered { bytes, failure, status });
    }

    pub(super) fn seen(&mut self, at: Micros, effect: &Effect) -> Result<(), Broken> {
        if matches!(effect, Effect::Byte(_)) {
            return self.station.seen(at, effect);
        }
        self.awaited.seen(effect).map_err(|wrong| {
            let (clause, message) =
                wrong.unwrap_or_else(|| (unasked(effect), format!("nothing asked for {effect:?}")));
            Broken::new(clause, message)
        })?;
        if let (Effect::Requested { id, .. }, Some(request)) = (effect, &mut self.request) {
            request.id = Some(*id);
        }
        Ok(())
    }

    pub(super) fn settled(&mut self, at: Micros) -> Result<(), Broken> {
        if let Some((clause, message)) = self.awaited.missing() {
            return Err(Broken::new(clause, message));
        }
        self.station.settled(at)
    }

    pub(super) fn next(&self) -> Option<Micros> {
        let job = self.job.as_ref().and_then(|job| match job.stage {
            Stage::Awaiting(until) => Some(until),
            Stage::Ready | Stage::OnLine => None,
        });
        let request = self.request.as_ref().map(|request| request.until);
        [self.station.next(), job, request].into_iter().flatten().min()
    }
}

/// The clause that this breaks, as nothing asked for it.
fn unasked(effect: &Effect) -> &'static str {
    match effect {
        Effect::Done { .. } => "rk512.react.good",
        Effect::Failed { .. } => "rk512.react.unasked",
        Effect::Delivered { .. } => "rk512.serve.write",
        Effect::Requested { .. } => "rk512.serve.malformed",
        Effect::Withdrawn(_) => "rk512.serve.withdrawn",
        Effect::Checked { .. } | Effect::Byte(_) | Effect::Break(_) | Effect::ModemLines(..) => {
            "rk512.line.telegram"
        }
    }
}
