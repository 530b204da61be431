//! The reader: one job, from its first DC1 to its end.

use super::rules::Rules;
use super::select::Start;
use super::tape::{self, Tape};
use super::wire::Wire;
use crate::demands::Demands;
use crate::model::Effect;
use softplug_abi::{Failure, Micros};

/// *Idle*, or a job in one of its states.
#[derive(Clone, Debug, Default)]
pub(super) struct Feed {
    /// A DC1 came while there was no job.
    is_dc1_remembered: bool,
    job: Option<Job>,
    /// A transfer has ended.
    pub(super) has_ended: bool,
}

/// A job whose check was good.
#[derive(Clone, Debug)]
struct Job {
    id: u32,
    began: Micros,
    tape: Tape,
    is_paused: bool,
    state: State,
}

#[derive(Clone, Debug)]
enum State {
    /// For the first DC1.
    Waiting,
    Transfer(Transfer),
    /// All has left; the final DC3 is awaited until then.
    Ending(Micros),
    /// A job without characters, to which no DC1 has come, awaits the final DC3 until
    /// then: it has no character to wait with; the page does not say so.
    Empty(Micros),
}

#[derive(Clone, Debug)]
struct Transfer {
    /// Since when the control holds us.
    held: Option<Micros>,
    /// Number of the last character that was in the port when it began.
    before: u64,
    /// Characters of the job that have left.
    left: usize,
}

impl Feed {
    /// The job under way.
    pub(super) fn job(&self) -> Option<u32> {
        self.job.as_ref().map(|job| job.id)
    }

    fn state(&self) -> Option<&State> {
        self.job.as_ref().map(|job| &job.state)
    }

    pub(super) fn is_waiting(&self) -> bool {
        matches!(self.state(), Some(State::Waiting))
    }

    pub(super) fn is_held(&self) -> bool {
        matches!(self.state(), Some(State::Transfer(Transfer { held: Some(_), .. })))
    }

    pub(super) fn is_paused(&self) -> bool {
        self.job.as_ref().is_some_and(|job| job.is_paused)
    }

    pub(super) fn is_ending(&self) -> bool {
        matches!(self.state(), Some(State::Ending(_) | State::Empty(_)))
    }

    /// From the first DC1 to the end.
    pub(super) fn is_transfer(&self) -> bool {
        matches!(self.state(), Some(State::Transfer(_) | State::Ending(_)))
    }

    /// The control reads: it does not punch now.
    pub(super) fn is_reading(&self) -> bool {
        self.is_transfer() && !self.is_held()
    }

    /// Characters of the job that have not left.
    pub(super) fn missing(&self) -> usize {
        match self.job.as_ref().map(|job| (&job.state, job.tape.closed)) {
            Some((State::Transfer(transfer), closed)) => closed.saturating_sub(transfer.left),
            Some((State::Waiting, closed)) => closed,
            Some((State::Ending(_) | State::Empty(_), _)) | None => 0,
        }
    }

    /// As far as the port is concerned; after all that may have changed it.
    pub(super) fn update(&self, wire: &mut Wire) {
        wire.port.hold(self.is_held() || self.is_paused());
    }

    /// A job: its check, then its run.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn begin(
        &mut self,
        at: Micros,
        id: u32,
        start: &Start,
        data: &[u8],
        rules: &Rules,
        wire: &mut Wire,
        demands: &mut Demands,
    ) {
        if self.job.is_some() {
            let (failure, status, sent) = (Failure::Busy, 0, 0);
            let failed = Effect::Failed { job: id, failure, status, sent };
            return demands.add(failed, "fanuc-rs232.feed.one-job");
        }
        let encoded = tape::encode(data, start, rules);
        let fault = encoded.as_ref().err();
        let effect = Effect::Checked {
            job: id,
            failure: fault.map(|fault| fault.failure),
            status: fault.map_or(0, |fault| fault.status),
            line: fault.map_or(0, |fault| fault.line),
            column: fault.map_or(0, |fault| fault.column),
        };
        demands.add(effect, "fanuc-rs232.tape.unsupported");
        let Ok(tape) = encoded else { return };
        let state = State::Waiting;
        self.job = Some(Job { id, began: at, tape, is_paused: false, state });
        if std::mem::take(&mut self.is_dc1_remembered) {
            self.start(wire);
        }
        if self.is_empty() {
            self.all_left(at, rules, demands);
        }
    }

    fn is_empty(&self) -> bool {
        self.job.as_ref().is_some_and(|job| job.tape.bytes.is_empty())
    }

    /// DC1: send, or go on.
    pub(super) fn dc1(&mut self, wire: &mut Wire) {
        match self.job.as_mut().map(|job| &mut job.state) {
            None => self.is_dc1_remembered = true,
            Some(State::Waiting) => self.start(wire),
            Some(State::Transfer(transfer)) => transfer.held = None,
            Some(State::Ending(_) | State::Empty(_)) => {}
        }
    }

    fn start(&mut self, wire: &mut Wire) {
        if let Some(job) = &mut self.job {
            let before = wire.last_inside() + wire.port.urgent() as u64;
            job.state = State::Transfer(Transfer { held: None, before, left: 0 });
            wire.port.send(&job.tape.bytes);
        }
    }

    /// DC3: a hold, or the end.
    pub(super) fn dc3(&mut self, at: Micros, wire: &mut Wire, demands: &mut Demands) {
        self.is_dc1_remembered = false;
        let Some(job) = &mut self.job else { return };
        match &mut job.state {
            State::Waiting => {}
            State::Transfer(transfer) if transfer.left >= job.tape.closed => {
                self.done("fanuc-rs232.feed.final-dc3", wire, demands);
            }
            State::Transfer(transfer) => transfer.held = transfer.held.or(Some(at)),
            State::Ending(_) | State::Empty(_) => {
                self.done("fanuc-rs232.feed.final-dc3", wire, demands);
            }
        }
    }

    /// DC2, SYN, NAK and a lost link take a remembered DC1 back.
    pub(super) fn take_dc1_back(&mut self) {
        self.is_dc1_remembered = false;
    }

    /// SYN, NAK, or DSR off.
    pub(super) fn partner_ends(
        &mut self,
        failure: Failure,
        wire: &mut Wire,
        demands: &mut Demands,
    ) {
        if self.is_transfer() {
            let clause = match failure {
                Failure::PartnerReset => "fanuc-rs232.feed.reset",
                Failure::PartnerAlarm => "fanuc-rs232.feed.alarm",
                _ => "fanuc-rs232.feed.dsr",
            };
            self.fail(failure, clause, wire, demands);
        }
    }

    /// The host pauses the job, or ends the pause.
    pub(super) fn pause(&mut self, id: u32, is_paused: bool) {
        if let Some(job) = self.job.as_mut().filter(|job| job.id == id) {
            job.is_paused = is_paused;
        }
    }

    /// The host does as if a DC1 had come.
    pub(super) fn force_resume(&mut self, wire: &mut Wire) {
        if self.job.is_some() {
            self.dc1(wire);
        }
    }

    pub(super) fn abort(&mut self, id: u32, wire: &mut Wire, demands: &mut Demands) {
        if id != 0 && self.job() == Some(id) {
            self.fail(Failure::Aborted, "fanuc-rs232.feed.abort-clean", wire, demands);
        }
    }

    /// The port is gone.
    pub(super) fn link_down(&mut self, wire: &mut Wire, demands: &mut Demands) {
        self.fail(Failure::LinkDown, "fanuc-rs232.link.down", wire, demands);
        self.is_dc1_remembered = false;
    }

    /// Nothing is left. The link itself interrupts a job.
    pub(super) fn close(&mut self, demands: &mut Demands) {
        if let Some(job) = self.job() {
            let (failure, status, sent) = (Failure::Interrupted, 0, 0);
            let failed = Effect::Failed { job, failure, status, sent };
            demands.add(failed, "fanuc-rs232.link.close");
        }
        *self = Self::default();
    }

    /// When something is due.
    pub(super) fn deadline(&self, rules: &Rules) -> Option<Micros> {
        let job = self.job.as_ref()?;
        match &job.state {
            State::Waiting => Some(job.began + rules.dc1_timeout?),
            State::Transfer(transfer) => Some(transfer.held? + rules.held_timeout?),
            State::Ending(end) | State::Empty(end) => Some(*end),
        }
    }

    pub(super) fn due(
        &mut self,
        at: Micros,
        rules: &Rules,
        wire: &mut Wire,
        demands: &mut Demands,
    ) {
        if self.deadline(rules).is_none_or(|deadline| deadline > at) {
            return;
        }
        match self.state() {
            Some(State::Waiting) => {
                let clause = "fanuc-rs232.feed.dc1-timeout";
                self.fail(Failure::NoAnswer, clause, wire, demands);
            }
            Some(State::Transfer(_)) => {
                let clause = "fanuc-rs232.feed.held-timeout";
                self.fail(Failure::HeldTooLong, clause, wire, demands);
            }
            Some(State::Ending(_) | State::Empty(_)) => {
                self.done("fanuc-rs232.feed.end-wait", wire, demands);
            }
            None => {}
        }
    }

    /// A character with this number has left that is no control code of ours.
    pub(super) fn left(&mut self, at: Micros, number: u64, rules: &Rules, demands: &mut Demands) {
        let Some(job) = &mut self.job else { return };
        let State::Transfer(transfer) = &mut job.state else { return };
        if number > transfer.before {
            transfer.left += 1;
            if transfer.left == job.tape.bytes.len() {
                self.all_left(at, rules, demands);
            }
        }
    }

    fn all_left(&mut self, at: Micros, rules: &Rules, demands: &mut Demands) {
        let Some(job) = &mut self.job else { return };
        if let Some(wait) = rules.end_wait {
            job.state = match job.state {
                State::Waiting => State::Empty(at + wait),
                _ => State::Ending(at + wait),
            };
            return;
        }
        let done = Effect::Done { job: job.id, sent: job.tape.bytes.len() as u64 };
        demands.add(done, "fanuc-rs232.feed.done-when-left");
        self.end();
    }

    fn done(&mut self, clause: &'static str, wire: &mut Wire, demands: &mut Demands) {
        let Some(sent) = self.sent(wire) else { return };
        if let Some(job) = self.job() {
            demands.add(Effect::Done { job, sent }, clause);
        }
        wire.port.discard();
        self.end();
    }

    fn fail(
        &mut self,
        failure: Failure,
        clause: &'static str,
        wire: &mut Wire,
        demands: &mut Demands,
    ) {
        let Some(sent) = self.sent(wire) else { return };
        if let Some(job) = self.job() {
            demands.add(Effect::Failed { job, failure, status: 0, sent }, clause);
        }
        wire.port.discard();
        self.end();
    }

    /// Bytes that have left or are in the port.
    fn sent(&self, wire: &Wire) -> Option<u64> {
        let job = self.job.as_ref()?;
        let given = match job.state {
            State::Waiting => 0,
            State::Transfer(_) | State::Ending(_) | State::Empty(_) => {
                job.tape.bytes.len().saturating_sub(wire.port.waiting())
            }
        };
        Some(given as u64)
    }

    fn end(&mut self) {
        *self = Self { has_ended: self.is_transfer(), ..Self::default() };
    }
}
