//! The sender: one job, and the reasons to stand still.

use super::program::on_the_wire;
use super::rules::{Control, Rules};
use super::wire::Wire;
use crate::demands::Demands;
use crate::model::Effect;
use softplug_abi::{Failure, Micros};

/// *Held*, *waiting* and *paused* come and go apart from each other; bytes leave when
/// none is left.
#[derive(Clone, Debug, Default)]
pub(super) struct Sender {
    /// Since when the machine holds us.
    held: Option<Micros>,
    /// The job waits for its first XON.
    is_waiting: bool,
    is_paused: bool,
    job: Option<Job>,
}

/// A job whose check was good.
#[derive(Clone, Debug)]
struct Job {
    id: u32,
    began: Micros,
    /// Characters that leave for it.
    length: usize,
    /// Which character of all that leave its last one is, as soon as the port has it.
    last: Option<u64>,
}

impl Sender {
    /// The job under way.
    pub(super) fn job(&self) -> Option<u32> {
        self.job.as_ref().map(|job| job.id)
    }

    pub(super) fn is_held(&self) -> bool {
        self.held.is_some()
    }

    pub(super) fn is_waiting(&self) -> bool {
        self.is_waiting
    }

    pub(super) fn is_paused(&self) -> bool {
        self.is_paused
    }

    fn stands_still(&self) -> bool {
        self.is_held() || self.is_waiting || self.is_paused
    }

    /// A control byte of the machine.
    pub(super) fn heed(&mut self, at: Micros, control: Control) {
        match control {
            Control::Xoff => self.held = self.held.or(Some(at)),
            Control::Xon => (self.held, self.is_waiting) = (None, false),
        }
    }

    /// As far as the port is concerned; after all that may have changed it.
    pub(super) fn update(&self, wire: &mut Wire) {
        wire.port.hold(self.stands_still());
    }

    /// A job: its check, then its run.
    pub(super) fn begin(
        &mut self,
        at: Micros,
        id: u32,
        data: &[u8],
        rules: &Rules,
        wire: &mut Wire,
        demands: &mut Demands,
    ) {
        if self.job.is_some() {
            let (failure, status, sent) = (Failure::Busy, 0, 0);
            let failed = Effect::Failed { job: id, failure, status, sent };
            return demands.add(failed, "xon-xoff.tx.one-job");
        }
        let checked = on_the_wire(rules, data);
        let place = checked.as_ref().err().copied();
        let effect = Effect::Checked {
            job: id,
            failure: place.map(|_| Failure::UnsupportedCharacter),
            status: 0,
            line: place.map_or(0, |place| place.line),
            column: place.map_or(0, |place| place.column),
        };
        demands.add(effect, "xon-xoff.tx.control-in-data");
        let Ok(bytes) = checked else { return };
        if bytes.is_empty() && wire.port.waiting() + wire.port.inside() == 0 {
            return demands.add(Effect::Done { job: id, sent: 0 }, "xon-xoff.tx.done-when-left");
        }
        wire.port.send(&bytes);
        self.is_waiting = rules.wait_for_xon;
        // One without bytes is done when what is there before it has left; the page
        // does not say so.
        self.job = Some(Job { id, began: at, length: bytes.len(), last: None });
    }

    /// The host pauses the job, or ends the pause.
    pub(super) fn pause(&mut self, id: u32, is_paused: bool) {
        if self.job() == Some(id) {
            self.is_paused = is_paused;
        }
    }

    /// The host ends a hold, and the wait for the first XON.
    pub(super) fn force_resume(&mut self) {
        (self.held, self.is_waiting) = (None, false);
    }

    pub(super) fn abort(&mut self, id: u32, rules: &Rules, wire: &mut Wire, demands: &mut Demands) {
        if id != 0 && self.job() == Some(id) {
            self.fail(Failure::Aborted, "xon-xoff.tx.abort-clean", rules, wire, demands);
            wire.port.send(&rules.abort_send);
        }
    }

    /// The port is gone: so is the machine's hold.
    pub(super) fn link_down(&mut self, rules: &Rules, wire: &mut Wire, demands: &mut Demands) {
        self.fail(Failure::LinkDown, "xon-xoff.link.down", rules, wire, demands);
        self.held = None;
    }

    /// Nothing is left. The link itself interrupts a job.
    pub(super) fn close(&mut self, demands: &mut Demands) {
        if let Some(job) = self.job() {
            let (failure, status, sent) = (Failure::Interrupted, 0, 0);
            let failed = Effect::Failed { job, failure, status, sent };
            demands.add(failed, "xon-xoff.link.close");
        }
        *self = Self::default();
    }

    /// When a hold has lasted too long.
    pub(super) fn deadline(&self, rules: &Rules) -> Option<Micros> {
        let job = self.job.as_ref()?;
        Some(self.held?.max(job.began) + rules.held_timeout?)
    }

    /// A hold that lasts longer than `held_timeout` fails the job.
    pub(super) fn due(
        &mut self,
        at: Micros,
        rules: &Rules,
        wire: &mut Wire,
        demands: &mut Demands,
    ) {
        if self.deadline(rules).is_some_and(|deadline| deadline <= at) {
            self.fail(Failure::HeldTooLong, "xon-xoff.tx.held-timeout", rules, wire, demands);
        }
    }

    /// A character has left.
    pub(super) fn left(&mut self, number: u64, demands: &mut Demands) {
        if let Some(job) = self.job.take_if(|job| job.last == Some(number)) {
            let done = Effect::Done { job: job.id, sent: job.length as u64 };
            demands.add(done, "xon-xoff.tx.done-when-left");
            self.end_job();
        }
    }

    /// The instant is over: the port has what it could take.
    pub(super) fn settled(&mut self, wire: &Wire) {
        if let Some(job) = &mut self.job
            && wire.port.waiting() == 0
        {
            job.last = job.last.or(Some(wire.last_inside()));
        }
    }

    fn fail(
        &mut self,
        failure: Failure,
        clause: &'static str,
        rules: &Rules,
        wire: &mut Wire,
        demands: &mut Demands,
    ) {
        let Some(job) = self.job.take() else { return };
        // The job's bytes are the last that wait. Before them there is what follows an abort.
        let waiting = wire.port.waiting();
        let sent = job.length.saturating_sub(waiting) as u64;
        demands.add(Effect::Failed { job: job.id, failure, status: 0, sent }, clause);
        wire.port.discard();
        if failure != Failure::Aborted {
            let last = rules.abort_send.len() - waiting.saturating_sub(job.length);
            wire.port.send(&rules.abort_send[last..]);
        }
        self.end_job();
    }

    /// Its pause and its waiting end with it.
    fn end_job(&mut self) {
        (self.is_waiting, self.is_paused) = (false, false);
    }
}
