//! What a plug-in has to do at this instant, besides characters.

use crate::model::{Broken, Effect};

/// Demands of one instant. They may be met in any order.
#[derive(Clone, Debug, Default)]
pub(crate) struct Demands(Vec<Demand>);

/// One of these, and the clause that demands it.
#[derive(Clone, Debug)]
struct Demand {
    one_of: Vec<Effect>,
    clause: &'static str,
    any_count: bool,
}

/// Which clause is broken by an effect that is not as it has to be.
pub(crate) struct Blame {
    /// By what differs from one that was demanded; `None`: the clause that demands it.
    pub(crate) differing: fn(&Effect, &Effect) -> Option<&'static str>,
    /// By one that nothing asks for.
    pub(crate) unasked: fn(&Effect) -> &'static str,
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
    pub(crate) fn add(&mut self, effect: Effect, clause: &'static str) {
        self.add_one_of(vec![effect], clause);
    }

    /// One of these has to be done now.
    pub(crate) fn add_one_of(&mut self, one_of: Vec<Effect>, clause: &'static str) {
        self.0.push(Demand { one_of, clause, any_count: false });
    }

    /// This has to be done now; what is said to have left is not looked at.
    pub(crate) fn add_uncounted(&mut self, effect: &Effect, clause: &'static str) {
        self.0.push(Demand { one_of: vec![without_count(effect)], clause, any_count: true });
    }

    /// This was done.
    ///
    /// # Errors
    /// Nothing demands it.
    pub(crate) fn meet(&mut self, effect: &Effect, blame: &Blame) -> Result<(), Broken> {
        if let Some(at) = self.0.iter().position(|demand| demand.is_met(effect)) {
            self.0.remove(at);
            return Ok(());
        }
        let kind = std::mem::discriminant(effect);
        let is_alike = |demanded: &Effect| std::mem::discriminant(demanded) == kind;
        for Demand { one_of, clause, .. } in &self.0 {
            if let Some(demanded) = one_of.iter().find(|demanded| is_alike(demanded)) {
                let clause = (blame.differing)(demanded, effect).unwrap_or(clause);
                return Err(Broken::new(clause, format!("{effect:?} where {one_of:?} had to be")));
            }
        }
        Err(Broken::new((blame.unasked)(effect), format!("{effect:?}, and nothing asks for it")))
    }

    /// The instant is over.
    ///
    /// # Errors
    /// Something was not done.
    pub(crate) fn settled(&self) -> Result<(), Broken> {
        match self.0.first() {
            Some(Demand { one_of, clause, .. }) => {
                Err(Broken::new(clause, format!("{one_of:?} had to be")))
            }
            None => Ok(()),
        }
    }
}
