//! What the plug-in has to do at this instant, and does.

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
}

impl Demands {
    /// This has to be done now.
    pub(super) fn add(&mut self, effect: Effect, clause: &'static str) {
        self.add_one_of(vec![effect], clause);
    }

    /// One of these has to be done now.
    pub(super) fn add_one_of(&mut self, one_of: Vec<Effect>, clause: &'static str) {
        self.0.push(Demand { one_of, clause });
    }

    /// This was done.
    ///
    /// # Errors
    /// Nothing demands it.
    pub(super) fn meet(&mut self, effect: &Effect) -> Result<(), Broken> {
        if let Some(at) = self.0.iter().position(|demand| demand.one_of.contains(effect)) {
            self.0.remove(at);
            return Ok(());
        }
        let kind = std::mem::discriminant(effect);
        let is_alike = |demanded: &Effect| std::mem::discriminant(demanded) == kind;
        for Demand { one_of, clause } in &self.0 {
            if let Some(demanded) = one_of.iter().find(|demanded| is_alike(demanded)) {
                let clause = differing(demanded, effect).unwrap_or(clause);
                return Err(Broken::new(clause, format!("{effect:?} where {one_of:?} had to be")));
            }
        }
        Err(Broken::new(unasked(effect), format!("{effect:?}, and nothing asks for it")))
    }

    /// The instant is over.
    ///
    /// # Errors
    /// Something was not done.
    pub(super) fn settled(&self) -> Result<(), Broken> {
        match self.0.first() {
            Some(Demand { one_of, clause }) => {
                Err(Broken::new(clause, format!("{one_of:?} had to be")))
            }
            None => Ok(()),
        }
    }
}

/// The clause of what differs in a delivery.
fn differing(demanded: &Effect, seen: &Effect) -> Option<&'static str> {
    let Effect::Delivered { id, bytes, failure, .. } = demanded else { return None };
    let Effect::Delivered { id: seen_id, bytes: seen_bytes, failure: seen_failure, .. } = seen
    else {
        return None;
    };
    if bytes != seen_bytes {
        Some("xon-xoff.rx.deliver")
    } else if id != seen_id {
        Some("xon-xoff.rx.several")
    } else {
        failure.or(*seen_failure).and_then(clause_of)
    }
}

/// The clause that comes nearest to an effect that nothing asks for.
fn unasked(effect: &Effect) -> &'static str {
    match effect {
        Effect::Failed { failure: Failure::Aborted, .. } => "xon-xoff.tx.abort-clean",
        Effect::Failed { failure, .. } => clause_of(*failure).unwrap_or("xon-xoff.tx.held-timeout"),
        Effect::Delivered { failure: Some(failure), .. } => {
            clause_of(*failure).unwrap_or("xon-xoff.rx.quiet-ends")
        }
        Effect::Delivered { .. } => "xon-xoff.rx.quiet-ends",
        Effect::Checked { .. } => "xon-xoff.tx.control-in-data",
        Effect::Done { .. } => "xon-xoff.tx.done-when-left",
        _ => "xon-xoff.rx.deliver",
    }
}

/// The clause that names a failure.
fn clause_of(failure: Failure) -> Option<&'static str> {
    Some(match failure {
        Failure::Overrun => "xon-xoff.rx.overrun",
        Failure::LineError => "xon-xoff.rx.line-error",
        Failure::NoEndMark => "xon-xoff.rx.no-end-mark",
        Failure::Aborted => "xon-xoff.rx.abort",
        Failure::LinkDown => "xon-xoff.link.down",
        Failure::Interrupted => "xon-xoff.link.close",
        Failure::HeldTooLong => "xon-xoff.tx.held-timeout",
        Failure::Busy => "xon-xoff.tx.one-job",
        Failure::UnsupportedCharacter => "xon-xoff.tx.control-in-data",
        _ => return None,
    })
}
