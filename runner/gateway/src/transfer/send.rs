//! Sends a program.

use softplug_abi::{Action, Failure, Instance, Micros};
use softplug_link::{Job, Outside, Supply};
use std::io::{self, Read, Seek, SeekFrom};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::{Note, PATIENCE, Progress, TICK, TransferError, duration, note};
use crate::station::{Station, Turn};

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

/// What a sending came to.
#[derive(Clone, Debug)]
pub struct SendReport {
    /// How it ended.
    pub outcome: SendOutcome,
    /// Bytes of the program that were taken.
    pub bytes: u64,
    /// Bytes that left for it, as the plug-in counts.
    pub sent: u64,
    /// From the job's begin to its end.
    pub elapsed: Duration,
    /// Time for which the partner held us.
    pub held: Duration,
    /// How often it did.
    pub holds: u64,
    /// Bytes that came back meanwhile; they were dropped.
    pub received: u64,
    /// What the plug-in said.
    pub notes: Vec<Note>,
}

/// Sends all of `source` as one job. `stop` aborts it cleanly: the queue is
/// dropped, and the partner gets what the protocol has for the case.
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
    let mut feed = Feed::new(source);
    station.open(&mut feed)?;
    let begin = station.now();
    let job = Job {
        id: JOB,
        kind: options.job_kind,
        size: options.size,
        fields: Vec::new(),
        check: options.check,
    };
    station.begin_job(job, &mut feed)?;
    let mut is_stopped = false;
    while feed.outcome.is_none() {
        if !is_stopped && (stop.load(Ordering::Relaxed) || feed.error.is_some()) {
            is_stopped = true;
            station.abort(JOB, &mut feed)?;
            continue;
        }
        let counters = station.counters();
        progress(&Progress {
            bytes: feed.supplied.saturating_sub(station.link().waiting() as u64),
            total: options.size,
            elapsed: duration(station.now() - begin),
            held: duration(counters.held),
            is_held: counters.is_held(),
            state: &feed.state,
        });
        let until = station.now() + TICK;
        while feed.outcome.is_none() && feed.error.is_none() && station.now() < until {
            let turn = station.turn(until, &mut feed)?;
            if matches!(turn, Turn::Gone(_)) && feed.outcome.is_none() {
                // The plug-in was told and did not end the job.
                feed.outcome = Some(SendOutcome::Failed { failure: Failure::LinkDown, status: 0 });
            }
        }
    }
    let elapsed = duration(station.now() - begin);
    let counters = station.counters();
    station.close(PATIENCE, &mut feed)?;
    if let Some(error) = feed.error {
        return Err(TransferError::Source(error));
    }
    Ok(SendReport {
        outcome: feed.outcome.unwrap_or(SendOutcome::Aborted),
        bytes: feed.supplied,
        sent: feed.sent,
        elapsed,
        held: duration(counters.held),
        holds: counters.holds,
        received: feed.received,
        notes: feed.notes,
    })
}

/// The host's side of the job.
struct Feed<'a, S> {
    source: &'a mut S,
    supplied: u64,
    error: Option<io::Error>,
    outcome: Option<SendOutcome>,
    sent: u64,
    received: u64,
    drained: u32,
    notes: Vec<Note>,
    state: String,
}

impl<'a, S: Read + Seek> Feed<'a, S> {
    fn new(source: &'a mut S) -> Self {
        Self {
            source,
            supplied: 0,
            error: None,
            outcome: None,
            sent: 0,
            received: 0,
            drained: 0,
            notes: Vec::new(),
            state: String::new(),
        }
    }
}

impl<S: Read + Seek> Outside for Feed<'_, S> {
    fn handle(&mut self, _now: Micros, action: &Action<'_>) {
        match action {
            Action::JobDone { sent, .. } => {
                self.sent = *sent;
                self.outcome = Some(SendOutcome::Done);
            }
            Action::JobFailed { failure, status, sent, .. } => {
                self.sent = *sent;
                let (failure, status) = (*failure, *status);
                self.outcome = Some(match failure {
                    Failure::Aborted => SendOutcome::Aborted,
                    _ => SendOutcome::Failed { failure, status },
                });
            }
            Action::CheckResult { failure: Some(failure), status, line, column, .. } => {
                let (failure, status, line, column) = (*failure, *status, *line, *column);
                self.outcome = Some(SendOutcome::CheckFailed { failure, status, line, column });
            }
            Action::Deliver { bytes, .. } => {
                self.received += bytes.len() as u64;
                self.drained += bytes.len() as u32;
            }
            Action::Note { level, code, text } => self.notes.push(note(*level, *code, text)),
            Action::State { name } => (*name).clone_into(&mut self.state),
            _ => {}
        }
    }

    fn supply(&mut self, _job: u32, buffer: &mut [u8]) -> Supply {
        if self.error.is_some() {
            return Supply::Later;
        }
        match read_some(self.source, buffer) {
            Ok(0) => Supply::End,
            Ok(count) => {
                self.supplied += count as u64;
                Supply::Bytes(count)
            }
            Err(error) => {
                // An end here would pass for the program's.
                self.error = Some(error);
                Supply::Later
            }
        }
    }

    fn rewind(&mut self, _job: u32) {
        self.supplied = 0;
        if let Err(error) = self.source.seek(SeekFrom::Start(0)) {
            self.error = Some(error);
        }
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }
}

fn read_some(source: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    loop {
        match source.read(buffer) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            read => return read,
        }
    }
}
