//! One program in one direction over one station, or all that comes and is
//! asked for: what the command does, and what a small gateway may do.

mod receive;
mod send;
mod serve;
mod sink;
mod source;
mod unasked;

pub use receive::{ReceiveOutcome, ReceiveReport, receive};
pub use send::{SendOptions, SendOutcome, SendReport, ask, send};
pub use serve::{
    Delivered, JobReport, News, Program, Reply, Request, ServeEnd, ServeHandler, ServeOptions,
    ServeReport, serve,
};
pub use sink::Sink;
pub use source::ReadSeek;
pub use unasked::Reception;

use softplug_abi::{Action, Failure, Instance, JobId, Micros, NoteLevel, RequestId};
use softplug_link::LinkHost;
use std::error::Error;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;
use thiserror::Error;

use crate::error::PortError;
use crate::station::{Station, StationError, Turn};

/// How often progress is told and a stop is looked for.
const TICK: Micros = Micros::from_millis(100);
/// How long last words to the partner may take to leave.
const PATIENCE: Micros = Micros::from_secs(2);
/// For so long a plug-in may wait with its last words.
const LAST_WORDS: Micros = Micros::from_secs(5);

/// How far a transfer has come.
#[derive(Clone, Debug)]
pub struct Progress<'a> {
    /// Bytes of the program that have been sent or received.
    pub bytes: u64,
    /// Bytes of the whole program, if known.
    pub total: Option<u64>,
    /// Since the beginning.
    pub elapsed: Duration,
    /// Time for which the partner held us, or we held it.
    pub held: Duration,
    /// Whether that is so now.
    pub is_held: bool,
    /// The plug-in's name for its state.
    pub state: &'a str,
}

/// Something that the plug-in said for the log.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Note {
    /// How much it matters.
    pub level: NoteLevel,
    /// The protocol's own code, 0 without.
    pub code: u16,
    /// What it says.
    pub text: String,
}

/// Why a transfer could not be carried to an end.
#[derive(Debug, Error)]
pub enum TransferError<F: Error + 'static> {
    /// The port or the plug-in.
    #[error(transparent)]
    Station(#[from] StationError<F>),
    /// The program could not be read.
    #[error("the program cannot be read: {0}")]
    Source(#[source] io::Error),
    /// What came could not be written. Nothing that would have acknowledged it has left.
    #[error("what was received cannot be written: {0}")]
    Sink(#[source] io::Error),
    /// What came besides could not be written. Nothing that would have acknowledged it has left.
    #[error("what came besides cannot be written: {0}")]
    Besides(#[source] io::Error),
}

impl<F: Error + 'static> From<PortError> for TransferError<F> {
    fn from(error: PortError) -> Self {
        Self::Station(StationError::Port(error))
    }
}

/// Requests that nobody is there for are refused at once: the partner need not
/// wait until it gives up.
fn refuse_all<I: Instance>(
    requests: &[u32],
    station: &mut Station<I>,
    host: &mut dyn LinkHost,
) -> Result<(), TransferError<I::Fault>> {
    for request in requests {
        station.answer(RequestId(*request), Err(Failure::NotSupported), host)?;
    }
    Ok(())
}

/// A delivery that is under way besides when a transfer ends is waited for, unless `stop`.
fn take_the_rest<I: Instance, H: LinkHost>(
    station: &mut Station<I>,
    host: &mut H,
    is_taking: impl Fn(&H) -> bool,
    stop: &AtomicBool,
) -> Result<(), TransferError<I::Fault>> {
    let mut turn = Turn::Live;
    while turn == Turn::Live && is_taking(host) && !stop.load(Ordering::Relaxed) {
        turn = station.turn(station.now() + TICK, host)?;
    }
    if is_taking(host) {
        station.abort(JobId::NONE, host)?;
    }
    Ok(())
}

/// What a protocol says to its partner behind an abort may have to wait until the line is clear: the
/// plug-in has a timer then.
fn tell_the_partner<I: Instance>(
    station: &mut Station<I>,
    host: &mut dyn LinkHost,
) -> Result<(), TransferError<I::Fault>> {
    let until = station.now() + LAST_WORDS;
    let brake = station.brake();
    let before = station.counters().bytes_out;
    while station.now() < until
        && !brake.is_pulled()
        && station.counters().bytes_out == before
        && station.link().poll_timeout().is_some()
    {
        let turn = station.turn((station.now() + TICK).min(until), host)?;
        if let Turn::Gone(_) = turn {
            break;
        }
    }
    Ok(())
}

/// Whether what the plug-in says behind this action must not leave, because the host could not, or
/// can no longer, put away what was delivered: as soon as that is so, and with each delivery that
/// begins or is complete from then on. What an abort brings is told: of that delivery nobody is led to
/// believe that it arrived.
fn is_unacknowledged(action: &Action<'_>, had_failed: bool, has_failed: bool) -> bool {
    let claims =
        matches!(action, Action::DeliveryBegin { .. } | Action::DeliveryEnd { failure: None, .. });
    has_failed && (claims || !had_failed)
}

/// Time without a character from the port.
struct Quiet {
    heard: u64,
    since: Micros,
}

impl Quiet {
    fn new(now: Micros) -> Self {
        Self { heard: 0, since: now }
    }

    /// Since when nothing has come.
    fn since<I: Instance>(&mut self, station: &Station<I>) -> Micros {
        let heard = station.counters().bytes_in;
        if std::mem::replace(&mut self.heard, heard) != heard {
            self.since = station.now();
        }
        self.since
    }
}

fn duration(span: Micros) -> Duration {
    Duration::from_micros(span.0.max(0) as u64)
}

fn note(level: NoteLevel, code: u16, text: &str) -> Note {
    tracing::debug!(%level, code, "plug-in: {text}");
    Note { level, code, text: text.to_owned() }
}
