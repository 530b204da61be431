//! What has to be seen at this instant, besides characters.

use super::rules::Rule;
use crate::model::Effect;
use std::collections::VecDeque;
use std::mem::discriminant;

/// Deliveries and ends of jobs that are due now.
#[derive(Clone, PartialEq, Debug, Default)]
pub(super) struct Awaited(VecDeque<(Rule, Effect)>);

impl Awaited {
    pub(super) fn push(&mut self, rule: Rule, effect: Effect) {
        self.0.push_back((rule, effect));
    }

    /// One is seen.
    ///
    /// # Errors
    /// Another one had to be, or none of its kind.
    pub(super) fn seen(&mut self, effect: &Effect) -> Result<(), Option<(Rule, String)>> {
        let is_alike = |(_, own): &(Rule, Effect)| discriminant(own) == discriminant(effect);
        let place = self.0.iter().position(is_alike).ok_or(None)?;
        match self.0.remove(place) {
            Some((rule, own)) if own != *effect => {
                Err(Some((rule, format!("{own:?} had to come, and not {effect:?}"))))
            }
            _ => Ok(()),
        }
    }

    /// A layer on top takes what it is told instead of it being seen.
    pub(super) fn take(&mut self) -> Vec<(Rule, Effect)> {
        self.0.drain(..).collect()
    }

    /// The first that was not seen.
    pub(super) fn missing(&self) -> Option<(Rule, String)> {
        self.0.front().map(|(rule, own)| (*rule, format!("{own:?} had to come, and did not")))
    }
}
