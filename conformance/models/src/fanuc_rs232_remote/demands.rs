//! What the plug-in has to do at this instant, besides characters.

use crate::model::{Broken, Effect};
use softplug_abi::Failure;

/// Demands of one instant. They may be met in any order.
#[derive(Clone, Debug, Default)]
pub(super) struct Demands(Vec<Demand>);

/// One of these, and the clause that demands it.
#[derive(Clone, Debug)]
struct Demand {
    one_of: Vec<Effect>,
    clause: &'static str,
    any_count: bool,
}

impl Demand {
    fn is_met(&self, effect: &Effect) -> bool {
        let any = self.any_count && self.one_of.contains(&without_count(effect));
        any || self.one_of.contains(effect)
    }
}

/// An end of a job, whatever is said to have left for it.
fn without_count(effect: &Effect) -> Effect {
    match effect.clone() {
        Effect::Done { job, .. } => Effect::Done { job, sent: 0 },
        Effect::Failed { job, failure, status, .. } => {
            Effect::Failed { job, failure, status, sent: 0 }
        }
        other => other,
    }
}

impl Demands {
    /// This has to be done now.
    pub(super) fn add(&mut self, effect: Effect, clause: &'static str) {
        self.add_one_of(vec![effect], clause);
    }

    /// One of these has to be done now.
    pub(super) fn add_one_of(&mut self, one_of: Vec<Effect>, clause: &'static str) {
        self.0.push(Demand { one_of, clause, any_count: false });
    }

    /// This has to be done now; what is said to have left is not looked at.
    pub(super) fn add_uncounted(&mut self, effect: &Effect, clause: &'static str) {
        self.0.push(Demand { one_of: vec![without_count(effect)], clause, any_count: true });
    }

    /// This was done.
    ///
    /// # Errors
    /// Nothing demands it.
    pub(super) fn meet(&mut self, effect: &Effect) -> Result<(), Broken> {
        if let Some(at) = self.0.iter().position(|demand| demand.is_met(effect)) {
            self.0.remove(at);
            return Ok(());
        }
        match self.0.first() {
            Some(Demand { one_of, clause, .. }) => {
                Err(Broken::new(clause, format!("{effect:?} where {one_of:?} had to be")))
            }
            None => {
                Err(Broken::new(unasked(effect), format!("{effect:?}, and nothing asks for it")))
            }
        }
    }

    /// The instant is over.
    ///
    /// # Errors
    /// Something was not done.
    pub(super) fn settled(&self) -> Result<(), Broken> {
        match self.0.first() {
            Some(Demand { one_of, clause, .. }) => {
                Err(Broken::new(clause, format!("{one_of:?} had to be")))
            }
            None => Ok(()),
        }
    }
}

/// The clause that comes nearest to an effect that nothing asks for.
fn unasked(effect: &Effect) -> &'static str {
    match effect {
        Effect::Failed { failure: Failure::Aborted, .. } => "fanuc-rs232.remote.abort",
        Effect::Failed { failure: Failure::PartnerReset, .. } => "fanuc-rs232.remote.reset",
        Effect::Failed { failure: Failure::PartnerAlarm, .. } => "fanuc-rs232.remote.alarm",
        Effect::Failed { failure: Failure::PartnerGone, .. } => "fanuc-rs232.feed.dsr",
        Effect::Failed { failure: Failure::AttemptsUsedUp, .. } => "fanuc-rs232.remote.repeat",
        Effect::Failed { failure: Failure::Checksum | Failure::Protocol, .. } => {
            "fanuc-rs232.remote.ask-again"
        }
        Effect::Failed { failure: Failure::LinkDown, .. } => "fanuc-rs232.link.down",
        Effect::Failed { failure: Failure::Busy, .. } => "fanuc-rs232.feed.one-job",
        Effect::Failed { .. } => "fanuc-rs232.remote.silence",
        Effect::Checked { .. } => "fanuc-rs232.tape.unsupported",
        Effect::Done { .. } => "fanuc-rs232.remote.end",
        _ => "fanuc-rs232.remote.sum",
    }
}
