//! Receives a program.

use softplug_abi::{Action, Failure, Instance, JobId, Micros};
use softplug_link::LinkHost;
use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::unasked::{Reception, Unasked};
use super::{
    Note, PATIENCE, Progress, Quiet, Sink, TICK, TransferError, duration, is_unacknowledged, note,
    refuse_all, take_the_rest, tell_the_partner,
};
use crate::station::{Brake, Station, Turn};
use crate::store::Inbox;

/// How a reception ended.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum ReceiveOutcome {
    /// The whole program.
    Complete,
    /// What came is not a whole program.
    Failed {
        /// Why.
        failure: Failure,
        /// The protocol's own code, 0 without.
        status: u16,
    },
    /// It was asked to stop.
    Aborted,
    /// Nothing came in the time given.
    NothingCame,
}

/// What a reception came to.
#[derive(Clone, Debug)]
pub struct ReceiveReport {
    /// How it ended.
    pub outcome: ReceiveOutcome,
    /// Bytes written to the sink.
    pub bytes: u64,
    /// The program's name, if the protocol found one. From the line: nothing in
    /// it can be trusted.
    pub name: Option<String>,
    /// From the first byte to the end.
    pub elapsed: Duration,
    /// Time for which we held the partner.
    pub held: Duration,
    /// Deliveries that followed before the link was closed, and were kept.
    pub kept: Vec<Reception>,
    /// Deliveries that followed and had no place.
    pub dropped: u64,
    /// Bytes that the port brought, whatever they were.
    pub heard: u64,
    /// What the plug-in said.
    pub notes: Vec<Note>,
}

/// Receives one delivery into `out`. `stop` ends it: what came by then is in
/// `out`, and a partner that we hold is let go. Requests of the partner are refused. A delivery
/// that has begun when the first one ends, such as the next program of one punch, goes into
/// `besides` and is waited for; without that folder it is dropped and counted.
///
/// `out` is [completed](Sink::complete) when the delivery is, before the partner is told so. Where
/// writing or completing fails, what the plug-in said behind that does not leave: nothing is acknowledged that is
/// nowhere.
///
/// With `give_up_after` it ends when no character has come for so long and nothing has begun.
///
/// # Errors
/// The port, the plug-in, the sink or `besides` failed.
pub fn receive<I: Instance>(
    station: &mut Station<I>,
    out: &mut impl Sink,
    unasked: Option<&mut Inbox>,
    give_up_after: Option<Duration>,
    stop: &AtomicBool,
    progress: &mut dyn FnMut(&Progress<'_>),
) -> Result<ReceiveReport, TransferError<I::Fault>> {
    let mut catch = Catch::new(out, unasked, station.brake());
    station.open(&mut catch)?;
    let mut quiet = Quiet::new(station.now());
    while catch.outcome.is_none() {
        let now = station.now();
        if stop.load(Ordering::Relaxed) || catch.error.is_some() {
            let was_under_way = station.link().has_delivery();
            if catch.error.is_some() && was_under_way {
                // The abort is told, and nothing of what was said before it.
                station.drop_unsent();
            }
            station.abort(JobId::NONE, &mut catch)?;
            if was_under_way {
                tell_the_partner(station, &mut catch)?;
            }
            catch.outcome.get_or_insert(ReceiveOutcome::Aborted);
            break;
        }
        let since = quiet.since(station);
        let give_up_at = give_up_after.map_or(Micros::MAX, |span| {
            since + Micros(i64::try_from(span.as_micros()).unwrap_or(i64::MAX))
        });
        if catch.first_at.is_none() && now >= give_up_at {
            catch.outcome = Some(ReceiveOutcome::NothingCame);
            break;
        }
        progress(&Progress {
            bytes: catch.bytes,
            total: None,
            elapsed: duration(catch.elapsed(now)),
            held: duration(catch.held_at(now)),
            is_held: catch.held_since.is_some(),
            state: &catch.state,
        });
        let until = match catch.first_at {
            None => (now + TICK).min(give_up_at),
            Some(_) => now + TICK,
        };
        if let Turn::Gone(reason) = station.turns(until, &mut catch, Catch::has_work)? {
            tracing::debug!(%reason, "the port is gone");
            let failure = Failure::LinkDown;
            catch.outcome.get_or_insert(ReceiveOutcome::Failed { failure, status: 0 });
        }
        let requests = std::mem::take(&mut catch.requests);
        refuse_all(&requests, station, &mut catch)?;
    }
    let now = station.now();
    let (elapsed, held) = (duration(catch.elapsed(now)), duration(catch.held_at(now)));
    take_the_rest(station, &mut catch, |catch| catch.unasked.is_taking(), stop)?;
    let heard = station.counters().bytes_in;
    station.close(PATIENCE, &mut catch)?;
    catch.unasked.close();
    if catch.error.is_none() && catch.outcome != Some(ReceiveOutcome::Complete) {
        catch.error = catch.out.flush().err();
    }
    if let Some(error) = catch.error {
        return Err(TransferError::Sink(error));
    }
    if let Some(error) = catch.unasked.error {
        return Err(TransferError::Besides(error));
    }
    Ok(ReceiveReport {
        outcome: catch.outcome.unwrap_or(ReceiveOutcome::Aborted),
        bytes: catch.bytes,
        name: catch.name,
        elapsed,
        held,
        kept: catch.unasked.kept,
        dropped: catch.unasked.refused,
        heard,
        notes: catch.notes,
    })
}

/// The host's side of the delivery.
struct Catch<'a, W> {
    out: &'a mut W,
    /// What follows the first delivery.
    unasked: Unasked<'a>,
    brake: Brake,
    bytes: u64,
    drained: u32,
    requests: Vec<u32>,
    error: Option<io::Error>,
    outcome: Option<ReceiveOutcome>,
    name: Option<String>,
    first_at: Option<Micros>,
    held: Micros,
    held_since: Option<Micros>,
    notes: Vec<Note>,
    state: String,
}

impl<'a, W: Sink> Catch<'a, W> {
    fn new(out: &'a mut W, unasked: Option<&'a mut Inbox>, brake: Brake) -> Self {
        Self {
            out,
            unasked: Unasked::new(unasked),
            brake,
            bytes: 0,
            drained: 0,
            requests: Vec::new(),
            error: None,
            outcome: None,
            name: None,
            first_at: None,
            held: Micros::ZERO,
            held_since: None,
            notes: Vec::new(),
            state: String::new(),
        }
    }

    fn has_work(&self) -> bool {
        self.outcome.is_some() || self.error.is_some() || !self.requests.is_empty()
    }

    /// Whether something could not be put away.
    fn has_failed(&self) -> bool {
        self.error.is_some() || self.unasked.error.is_some()
    }

    fn elapsed(&self, now: Micros) -> Micros {
        self.first_at.map_or(Micros::ZERO, |first| now - first)
    }

    fn held_at(&self, now: Micros) -> Micros {
        self.held_since.map_or(self.held, |since| self.held + (now - since))
    }

    /// Plug-ins call the state in which they hold the partner "stopped".
    fn enter(&mut self, now: Micros, state: &str) {
        self.held = self.held_at(now);
        self.held_since = (state == "stopped").then_some(now);
        state.clone_into(&mut self.state);
    }
}

// A new action has to be decided on here.
#[deny(clippy::wildcard_enum_match_arm)]
impl<W: Sink> Catch<'_, W> {
    fn take(&mut self, now: Micros, action: &Action<'_>) {
        match action {
            Action::DeliveryBegin { .. }
            | Action::Deliver { .. }
            | Action::DeliveryName { .. }
            | Action::DeliveryEnd { .. }
                if self.outcome.is_some() =>
            {
                self.unasked.take(action);
                if let Action::Deliver { bytes, .. } = action
                    && !self.has_failed()
                {
                    self.drained += bytes.len() as u32;
                }
            }
            Action::DeliveryBegin { .. } => {
                self.first_at.get_or_insert(now);
            }
            Action::Deliver { bytes, .. } => {
                if self.error.is_some() {
                    return;
                }
                match self.out.write_all(bytes) {
                    Ok(()) => {
                        self.bytes += bytes.len() as u64;
                        self.drained += bytes.len() as u32;
                    }
                    Err(error) => self.error = Some(error),
                }
            }
            Action::DeliveryName { name, .. } => {
                self.name = Some((*name).to_owned());
            }
            Action::DeliveryEnd { failure, status, .. } => {
                if failure.is_none() && self.error.is_none() {
                    self.error = self.out.complete().err();
                }
                self.outcome = Some(match failure {
                    None => ReceiveOutcome::Complete,
                    Some(Failure::Aborted) => ReceiveOutcome::Aborted,
                    Some(failure) => ReceiveOutcome::Failed { failure: *failure, status: *status },
                });
            }
            Action::Request { request, .. } => self.requests.push(request.0),
            Action::Note { level, code, text } => self.notes.push(note(*level, *code, text)),
            Action::State { name } => self.enter(now, name),
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
            | Action::JobDone { .. }
            | Action::JobFailed { .. }
            | Action::CheckResult { .. }
            | Action::Withdraw { .. }
            | Action::Saved { .. } => {}
        }
    }
}

impl<W: Sink> LinkHost for Catch<'_, W> {
    fn handle(&mut self, now: Micros, action: &Action<'_>) {
        let had_failed = self.has_failed();
        self.take(now, action);
        if is_unacknowledged(action, had_failed, self.has_failed()) {
            self.brake.pull();
        }
    }

    fn drained(&mut self) -> u32 {
        std::mem::take(&mut self.drained)
    }
}
