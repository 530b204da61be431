//! The host's side of the link while a station serves.

use softplug_abi::{Action, Failure, Instance, JobId, Micros};
use softplug_link::{Job, LinkHost, Supply};
use std::collections::VecDeque;
use std::io;

use super::{
    Delivered, JobReport, News, Program, Reply, Request, ServeEnd, ServeHandler, ServeReport,
};
use crate::station::{Brake, Station};
use crate::transfer::{
    PATIENCE, SendOutcome, TransferError, duration, is_unacknowledged, note, tell_the_partner,
};

/// A program under way.
struct ActiveJob {
    id: JobId,
    program: Program,
    begun_at: Micros,
    /// Bytes that the port had taken when it began.
    port_had: u64,
    is_superseded: bool,
    is_aborted: bool,
}

impl ActiveJob {
    /// Whether it has to be aborted, because its program cannot be read on.
    fn is_broken(&self) -> bool {
        self.program.source.error.is_some() && !self.is_aborted
    }
}

/// A delivery under way.
struct Arriving {
    name: Option<String>,
    begun_at: Micros,
    bytes: u64,
}

/// The host's side of the link.
pub(super) struct ServeHost<'d, D> {
    handler: &'d mut D,
    requests: VecDeque<Request>,
    delivery: Option<Arriving>,
    job: Option<ActiveJob>,
    /// How the job ended, until that is told.
    job_end: Option<(SendOutcome, u64)>,
    /// What is sent when the job that it supersedes has ended.
    next: Option<Program>,
    next_id: JobId,
    moved_at: Micros,
    drained: u32,
    error: Option<io::Error>,
    brake: Brake,
    /// What is under way is aborted.
    is_winding_up: bool,
    state: String,
    complete: u64,
    failed: u64,
    aborted: u64,
    sent: u64,
    not_sent: u64,
    refused: u64,
}

impl<'d, D: ServeHandler> ServeHost<'d, D> {
    pub(super) fn new(handler: &'d mut D, brake: Brake) -> Self {
        Self {
            handler,
            requests: VecDeque::new(),
            delivery: None,
            job: None,
            job_end: None,
            next: None,
            next_id: JobId(1),
            moved_at: Micros::ZERO,
            drained: 0,
            error: None,
            brake,
            is_winding_up: false,
            state: String::new(),
            complete: 0,
            failed: 0,
            aborted: 0,
            sent: 0,
            not_sent: 0,
            refused: 0,
        }
    }

    /// Whether something is to be done that an action cannot do by itself.
    pub(super) fn has_work(&self) -> bool {
        !self.requests.is_empty()
            || self.job_end.is_some()
            || self.error.is_some()
            || self.job.as_ref().is_some_and(ActiveJob::is_broken)
    }

    /// Whether the handler could not put something away.
    pub(super) fn has_failed(&self) -> bool {
        self.error.is_some()
    }

    pub(super) fn is_idle(&self) -> bool {
        self.delivery.is_none() && self.job.is_none()
    }

    /// When something last happened.
    pub(super) fn moved_at(&self) -> Micros {
        self.moved_at
    }

    pub(super) fn deliveries(&self) -> u64 {
        self.complete + self.failed
    }

    pub(super) fn state(&self) -> &str {
        &self.state
    }

    /// Bytes of the program under way, if known.
    pub(super) fn total(&self) -> Option<u64> {
        self.job.as_ref().filter(|_| self.delivery.is_none())?.program.size
    }

    pub(super) fn report(self, end: ServeEnd, heard: u64) -> io::Result<ServeReport> {
        let Self { error, complete, failed, aborted, sent, not_sent, refused, .. } = self;
        match error {
            Some(error) => Err(error),
            None => {
                Ok(ServeReport { end, complete, failed, aborted, sent, not_sent, refused, heard })
            }
        }
    }

    /// Answers requests, ends jobs and begins them.
    pub(super) fn attend<I: Instance>(
        &mut self,
        station: &mut Station<I>,
    ) -> Result<(), TransferError<I::Fault>> {
        loop {
            self.conclude(station.now());
            if let Some(job) = self.job.as_mut().filter(|job| job.is_broken()) {
                // What follows in the program is not known: the machine must not
                // take the half for the whole.
                job.is_aborted = true;
                let id = job.id;
                station.abort(id, self)?;
                continue;
            }
            if self.job.is_none()
                && let Some(program) = self.next.take()
            {
                self.begin(program, station)?;
            } else if let Some(request) = self.requests.pop_front() {
                self.answer(&request, station)?;
            } else {
                break;
            }
        }
        Ok(())
    }

    fn answer<I: Instance>(
        &mut self,
        request: &Request,
        station: &mut Station<I>,
    ) -> Result<(), TransferError<I::Fault>> {
        let mut reply = self.handler.asked(request);
        if matches!(reply, Reply::Program(_)) && !self.is_replaceable(station) {
            reply = Reply::Refused(Failure::Busy);
        }
        let refused = match &reply {
            Reply::Refused(failure) => Some(*failure),
            Reply::Data(_) | Reply::Program(_) => None,
        };
        self.refused += u64::from(refused.is_some());
        self.handler.tell(&News::Answered { request, refused });
        match reply {
            Reply::Refused(failure) => station.answer(request.id, Err(failure), self)?,
            Reply::Data(bytes) => station.answer(request.id, Ok(&bytes), self)?,
            Reply::Program(program) => {
                station.answer(request.id, Ok(&[]), self)?;
                self.next = Some(program);
                if let Some(job) = &mut self.job {
                    job.is_superseded = true;
                    job.is_aborted = true;
                    let id = job.id;
                    station.abort(id, self)?;
                }
            }
        }
        Ok(())
    }

    /// Whether another program may be sent now, or in the place of this one.
    fn is_replaceable<I: Instance>(&self, station: &Station<I>) -> bool {
        let has_left = |job: &ActiveJob| station.counters().bytes_out > job.port_had;
        self.next.is_none() && !self.job.as_ref().is_some_and(has_left)
    }

    fn begin<I: Instance>(
        &mut self,
        program: Program,
        station: &mut Station<I>,
    ) -> Result<(), TransferError<I::Fault>> {
        let id = self.next_id;
        self.next_id = id.next();
        self.handler.tell(&News::JobBegins { name: &program.name, size: program.size });
        let job = Job {
            id,
            kind: program.job_kind,
            size: program.size,
            fields: Vec::new(),
            check: program.check,
        };
        self.job = Some(ActiveJob {
            id,
            program,
            begun_at: station.now(),
            port_had: station.counters().bytes_out,
            is_superseded: false,
            is_aborted: false,
        });
        station.begin_job(job, self)?;
        Ok(())
    }

    /// Tells how the job ended, if it has.
    fn conclude(&mut self, now: Micros) {
        let Some((outcome, sent)) = self.job_end.take() else { return };
        let Some(job) = self.job.take() else { return };
        self.moved_at = now;
        match outcome {
            SendOutcome::Done => self.sent += 1,
            _ if job.is_superseded => {}
            outcome => {
                self.not_sent += 1;
                let is_ours = self.is_winding_up && outcome == SendOutcome::Aborted;
                self.aborted += u64::from(is_ours);
            }
        }
        let elapsed = duration(now - job.begun_at);
        self.handler.tell(&News::JobEnds(JobReport {
            name: &job.program.name,
            outcome,
            unreadable: job.program.source.error.as_ref(),
            is_superseded: job.is_superseded,
            sent,
            elapsed,
        }));
    }

    /// Ends what is under way, lets last words leave, closes.
    pub(super) fn wind_up<I: Instance>(
        &mut self,
        station: &mut Station<I>,
    ) -> Result<(), TransferError<I::Fault>> {
        self.next = None;
        self.requests.clear();
        self.is_winding_up = true;
        if self.has_failed() && self.delivery.is_some() {
            // The abort is told, and nothing of what was said before it.
            station.drop_unsent();
        }
        if let Some(job) = &self.job {
            let id = job.id;
            station.abort(id, self)?;
        }
        if self.delivery.is_some() {
            station.abort(JobId::NONE, self)?;
            tell_the_partner(station, self)?;
        }
        station.close(PATIENCE, self)?;
        self.conclude(station.now());
        Ok(())
    }

    /// Bytes of what is under way.
    pub(super) fn moved(&self, waiting: u64) -> u64 {
        let supplied =
            self.job.as_ref().map(|job| job.program.source.supplied.saturating_sub(waiting));
        self.delivery.as_ref().map_or(supplied.unwrap_or(0), |delivery| delivery.bytes)
    }

    pub(super) fn elapsed(&self, now: Micros) -> Micros {
        let delivery = self.delivery.as_ref().map(|delivery| delivery.begun_at);
        let job = self.job.as_ref().map(|job| job.begun_at);
        delivery.or(job).map_or(Micros::ZERO, |begun_at| now - begun_at)
    }

    /// An error of the handler ends serving; later ones follow from it.
    fn try_handler(&mut self, result: io::Result<()>) {
        if let Err(error) = result {
            self.error.get_or_insert(error);
        }
    }
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl<D: ServeHandler> ServeHost<'_, D> {
    fn take(&mut self, now: Micros, action: &Action<'_>) {
        match action {
            Action::DeliveryBegin { .. } => {
                self.moved_at = now;
                self.delivery = Some(Arriving { name: None, begun_at: now, bytes: 0 });
                let begun = self.handler.begin();
                self.try_handler(begun);
            }
            Action::Deliver { bytes, .. } => {
                self.moved_at = now;
                if let Some(delivery) = &mut self.delivery {
                    delivery.bytes += bytes.len() as u64;
                }
                if self.error.is_none() {
                    let put = self.handler.deliver(bytes);
                    self.try_handler(put);
                }
                if self.error.is_none() {
                    self.drained += bytes.len() as u32;
                }
            }
            Action::DeliveryName { name, .. } => {
                if let Some(delivery) = &mut self.delivery {
                    delivery.name = Some((*name).to_owned());
                }
            }
            Action::DeliveryEnd { failure, status, .. } => {
                self.moved_at = now;
                let Some(delivery) = self.delivery.take() else { return };
                // What could not be written is not all there.
                let failure = match (failure, &self.error) {
                    (Some(failure), _) => Some((*failure, *status)),
                    (None, Some(_)) => Some((Failure::Internal, 0)),
                    (None, None) => None,
                };
                let elapsed = duration(now - delivery.begun_at);
                let counted = if failure.is_none() { &mut self.complete } else { &mut self.failed };
                *counted += 1;
                let is_ours = failure.is_some_and(|(failure, _)| failure == Failure::Aborted);
                self.aborted += u64::from(is_ours && self.is_winding_up);
                let ended = self.handler.end(&Delivered { name: delivery.name, failure, elapsed });
                self.try_handler(ended);
            }
            Action::JobDone { .. } | Action::JobFailed { .. } | Action::CheckResult { .. } => {
                self.job_end = SendOutcome::of(action).or(self.job_end);
            }
            Action::Request { request, kind, fields } => {
                self.moved_at = now;
                let (id, kind, fields) = (*request, *kind, fields.as_bytes().to_vec());
                self.requests.push_back(Request { id, kind, fields });
            }
            Action::Withdraw { request } => self.requests.retain(|asked| asked.id != *request),
            Action::Note { level, code, text } => {
                self.handler.tell(&News::Note(&note(*level, *code, text)));
            }
            Action::State { name } => (*name).clone_into(&mut self.state),
            Action::Transmit { .. }
            | Action::TransmitUrgent { .. }
            | Action::Hold
            | Action::Release
            | Action::Discard
            | Action::SetTimer { .. }
            | Action::CancelTimer { .. }
            | Action::ModemLines { .. }
            | Action::Break { .. }
            | Action::Want { .. }
            | Action::Saved { .. } => {}
        }
    }
}

impl<D: ServeHandler> LinkHost for ServeHost<'_, D> {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        let had_failed = self.has_failed();
        self.take(now, action);
        if is_unacknowledged(action, had_failed, self.has_failed()) {
            self.brake.pull();
        }
    }

    fn supply(&mut self, job: JobId, buffer: &mut [u8]) -> Supply {
        let Some(active) = self.job.as_mut().filter(|active| active.id == job) else {
            return Supply::End;
        };
        active.program.source.supply(buffer)
    }

    fn rewind(&mut self, job: JobId) {
        if let Some(active) = self.job.as_mut().filter(|active| active.id == job) {
            active.program.source.rewind();
        }
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }
}
