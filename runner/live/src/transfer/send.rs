//! Sends a program.

use softplug_abi::{Action, Failure, Instance, JobId, Micros};
use softplug_link::{Job, LinkHost, Supply};
use std::io::{self, Read, Seek};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::source::Source;
use super::unasked::{Reception, Unasked};
use super::{
    Note, PATIENCE, Progress, Sink, TICK, TransferError, duration, is_unacknowledged, note,
    refuse_all, take_the_rest,
};
use crate::channel::Left;
use crate::station::{Brake, Station, Turn};
use crate::store::Inbox;

/// The only job of such a station.
const JOB: u32 = 1;

/// What to send, beside the bytes.
#[derive(Clone, Debug, Default)]
pub struct SendOptions {
    /// Feed the data once as a check first; the manifest says whether the
    /// plug-in needs that.
    pub check: bool,
    /// Bytes of the program, if known.
    pub size: Option<u64>,
    /// Place of the kind of job in the manifest.
    pub job_kind: u16,
    /// The job's fields as value records.
    pub fields: Vec<u8>,
}

/// How a sending ended.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum SendOutcome {
    /// The last bit has left.
    Done,
    /// The plug-in gave up.
    Failed {
        /// Why.
        failure: Failure,
        /// The protocol's own code, 0 without.
        status: u16,
    },
    /// The program cannot be sent; nothing was.
    CheckFailed {
        /// Why.
        failure: Failure,
        /// The protocol's own code, 0 without.
        status: u16,
        /// Line of the fault, from 1; 0 without.
        line: u32,
        /// Column of the fault in bytes, from 1; 0 without.
        column: u32,
    },
    /// It was asked to stop.
    Aborted,
}

impl SendOutcome {
    /// How this action of the plug-in ends a job, and the bytes that left for it; `None`: it
    /// ends none.
    pub(super) fn of(action: &Action<'_>) -> Option<(Self, u64)> {
        Some(match *action {
            Action::JobDone { sent, .. } => (Self::Done, sent),
            Action::JobFailed { failure: Failure::Aborted, sent, .. } => (Self::Aborted, sent),
            Action::JobFailed { failure, status, sent, .. } => {
                (Self::Failed { failure, status }, sent)
            }
            Action::CheckResult { failure: Some(failure), status, line, column, .. } => {
                (Self::CheckFailed { failure, status, line, column }, 0)
            }
            _ => return None,
        })
    }
}

/// What a sending came to.
#[derive(Clone, Debug)]
pub struct SendReport {
    /// How it ended.
    pub outcome: SendOutcome,
    /// Bytes of the program that were taken.
    pub bytes: u64,
    /// Bytes that left for it, as the plug-in counts; of a job that is not done
    /// no more than surely have.
    pub sent: u64,
    /// Characters that left for it, the protocol's own included: whatever the
    /// job's end, no more than `maybe` ever will.
    pub left: Left,
    /// From the job's begin to its end.
    pub elapsed: Duration,
    /// Time for which the partner held us.
    pub held: Duration,
    /// How often it did.
    pub holds: u64,
    /// How often the line stood still for a character or longer although bytes waited.
    pub gaps: u64,
    /// The longest of these times.
    pub longest_gap: Duration,
    /// Bytes of the answer to the job, for kinds of job that have one.
    pub answered: u64,
    /// Deliveries that came meanwhile, are no answer, and were kept.
    pub kept: Vec<Reception>,
    /// Deliveries that came meanwhile and had no place: the partner was refused, as far as its
    /// protocol has a way to.
    pub refused: u64,
    /// Bytes of them that were dropped all the same.
    pub received: u64,
    /// What the plug-in said.
    pub notes: Vec<Note>,
}

/// Sends all of `source` as one job. `stop` aborts it cleanly: the queue is
/// dropped, and the partner gets what the protocol has for the case. Requests of
/// the partner meanwhile are refused. What it delivers is dropped: a station without any
/// `delivery_room` has it refused instead where the protocol can.
///
/// # Errors
/// The port, the plug-in or the source failed. What the partner got by then is
/// in the error's place only; a job that fails is no error but a
/// [`SendOutcome`].
pub fn send<I: Instance>(
    station: &mut Station<I>,
    source: &mut (impl Read + Seek),
    options: &SendOptions,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(&Progress<'_>),
) -> Result<SendReport, TransferError<I::Fault>> {
    ask(station, source, &mut io::sink(), None, options, stop, progress)
}

/// Carries out a job with all that it may bring: what answers it (it reads) goes to `answer`, and
/// what the partner sends besides into `besides`; one that is under way when the job ends is
/// waited for. Without that folder it is dropped: see [`send`]. `answer` is
/// [completed](Sink::complete) when the answer is, before the partner is told so. What cannot be put
/// away is not acknowledged, and ends the job.
///
/// # Errors
/// The port, the plug-in, the source, `answer` or `besides` failed.
pub fn ask<I: Instance>(
    station: &mut Station<I>,
    source: &mut (impl Read + Seek),
    answer: &mut impl Sink,
    unasked: Option<&mut Inbox>,
    options: &SendOptions,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(&Progress<'_>),
) -> Result<SendReport, TransferError<I::Fault>> {
    let brake = station.brake();
    let mut feed = Feed::new(source, answer, unasked, brake.clone());
    station.open(&mut feed)?;
    let begin = station.now();
    let place = station.place();
    let job = Job {
        id: JobId(JOB),
        kind: options.job_kind,
        size: options.size,
        fields: options.fields.clone(),
        check: options.check,
    };
    station.begin_job(job, &mut feed)?;
    let mut is_stopped = false;
    while feed.outcome.is_none() {
        if !is_stopped && (stop.load(Ordering::Relaxed) || feed.has_error()) {
            is_stopped = true;
            if brake.is_pulled() {
                station.drop_unsent();
            }
            station.abort(JobId(JOB), &mut feed)?;
            continue;
        }
        if is_stopped && brake.is_pulled() {
            // Nothing leaves any more, last words least of all.
            feed.outcome = Some(SendOutcome::Aborted);
            break;
        }
        let counters = station.counters();
        progress(&Progress {
            bytes: feed.moved(station.link().waiting() as u64),
            total: options.size,
            elapsed: duration(station.now() - begin),
            held: duration(counters.held),
            is_held: counters.is_held(),
            state: &feed.state,
        });
        let until = station.now() + TICK;
        let has_work = |feed: &Feed<'_, _, _>| {
            let is_to_stop = feed.has_error() && (!is_stopped || feed.brake.is_pulled());
            feed.outcome.is_some() || is_to_stop || !feed.requests.is_empty()
        };
        if let Turn::Gone(_) = station.turns(until, &mut feed, has_work)? {
            // Unless the plug-in, which was told, has ended the job.
            let gone = SendOutcome::Failed { failure: Failure::LinkDown, status: 0 };
            feed.outcome.get_or_insert(gone);
        }
        let requests = std::mem::take(&mut feed.requests);
        refuse_all(&requests, station, &mut feed)?;
    }
    let elapsed = duration(station.now() - begin);
    let counters = station.counters();
    take_the_rest(station, &mut feed, |feed| feed.unasked.is_taking(), stop)?;
    station.close(PATIENCE, &mut feed)?;
    feed.unasked.close();
    if feed.answer_error.is_none() {
        feed.answer_error = feed.answer.flush().err();
    }
    if let Some(error) = feed.source.error {
        return Err(TransferError::Source(error));
    }
    if let Some(error) = feed.answer_error {
        return Err(TransferError::Sink(error));
    }
    if let Some(error) = feed.unasked.error {
        return Err(TransferError::Besides(error));
    }
    let left = station.left(place);
    let outcome = feed.outcome.unwrap_or(SendOutcome::Aborted);
    let is_done = outcome == SendOutcome::Done;
    Ok(SendReport {
        outcome,
        bytes: feed.source.supplied,
        sent: if is_done { feed.sent } else { feed.sent.min(left.surely) },
        left,
        elapsed,
        held: duration(counters.held),
        holds: counters.holds,
        gaps: counters.gaps,
        longest_gap: duration(counters.longest_gap),
        answered: feed.answered,
        kept: feed.unasked.kept,
        refused: feed.unasked.refused,
        received: feed.unasked.dropped,
        notes: feed.notes,
    })
}

/// The host's side of the job.
struct Feed<'a, S, W> {
    source: Source<&'a mut S>,
    answer: &'a mut W,
    answer_error: Option<io::Error>,
    /// The delivery under way answers the job.
    is_answer: bool,
    unasked: Unasked<'a>,
    brake: Brake,
    requests: Vec<u32>,
    outcome: Option<SendOutcome>,
    sent: u64,
    answered: u64,
    drained: u32,
    notes: Vec<Note>,
    state: String,
}

impl<'a, S: Read + Seek, W: Sink> Feed<'a, S, W> {
    fn new(
        source: &'a mut S,
        answer: &'a mut W,
        unasked: Option<&'a mut Inbox>,
        brake: Brake,
    ) -> Self {
        Self {
            source: Source::new(source),
            answer,
            answer_error: None,
            is_answer: false,
            unasked: Unasked::new(unasked),
            brake,
            requests: Vec::new(),
            outcome: None,
            sent: 0,
            answered: 0,
            drained: 0,
            notes: Vec::new(),
            state: String::new(),
        }
    }

    fn has_error(&self) -> bool {
        self.source.error.is_some() || self.has_failed()
    }

    /// Whether something that came could not be put away.
    fn has_failed(&self) -> bool {
        self.answer_error.is_some() || self.unasked.error.is_some()
    }

    /// Bytes of the program that have left, or of the answer that came.
    fn moved(&self, waiting: u64) -> u64 {
        self.source.supplied.saturating_sub(waiting) + self.answered
    }

    fn deliver(&mut self, bytes: &[u8]) {
        if self.answer_error.is_none() {
            match self.answer.write_all(bytes) {
                Ok(()) => {
                    self.answered += bytes.len() as u64;
                    self.drained += bytes.len() as u32;
                }
                Err(error) => self.answer_error = Some(error),
            }
        }
    }
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl<S: Read + Seek, W: Sink> Feed<'_, S, W> {
    fn take(&mut self, action: &Action<'_>) {
        match action {
            Action::JobDone { .. } | Action::JobFailed { .. } | Action::CheckResult { .. } => {
                if let Some((outcome, sent)) = SendOutcome::of(action) {
                    (self.outcome, self.sent) = (Some(outcome), sent);
                }
            }
            Action::DeliveryBegin { job, .. } => {
                self.is_answer = *job == JobId(JOB);
                if !self.is_answer {
                    self.unasked.take(action);
                }
            }
            Action::Deliver { bytes, .. } if self.is_answer => self.deliver(bytes),
            Action::Deliver { bytes, .. } => {
                self.unasked.take(action);
                if self.unasked.error.is_none() {
                    self.drained += bytes.len() as u32;
                }
            }
            Action::DeliveryEnd { failure: None, .. } if self.is_answer => {
                if self.answer_error.is_none() {
                    self.answer_error = self.answer.complete().err();
                }
            }
            Action::DeliveryName { .. } | Action::DeliveryEnd { .. } if !self.is_answer => {
                self.unasked.take(action);
            }
            Action::Request { request, .. } => self.requests.push(request.0),
            Action::Note { level, code, text } => self.notes.push(note(*level, *code, text)),
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
            | Action::DeliveryName { .. }
            | Action::DeliveryEnd { .. }
            | Action::Withdraw { .. }
            | Action::Saved { .. } => {}
        }
    }
}

impl<S: Read + Seek, W: Sink> LinkHost for Feed<'_, S, W> {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        let had_failed = self.has_failed();
        self.take(action);
        if is_unacknowledged(action, had_failed, self.has_failed()) {
            self.brake.pull();
        }
    }

    fn supply(&mut self, _job: JobId, buffer: &mut [u8]) -> Supply {
        self.source.supply(buffer)
    }

    fn rewind(&mut self, _job: JobId) {
        self.source.rewind();
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }
}
