//! What happened in a state, held against the promises.

use super::{End, Outcome, World};
use crate::end::{PlugIn, Told};
use crate::promise::Breach;
use crate::scenario::Scenario;

impl World {
    /// A breach with the end whose data it is about.
    pub(super) fn told(&mut self, end: usize, told: &Told) -> Option<(Breach, usize)> {
        let other = 1 - end;
        if let End::Partner(partner) = &mut self.ends[other] {
            let sender = if matches!(told, Told::Delivered { .. }) { other } else { end };
            return partner.told(told, &self.wrong).map(|breach| (breach, sender));
        }
        if self.scenario.has_pieces {
            return None;
        }
        match told {
            Told::Failed(_) if self.scenario.may_conflict => None,
            Told::Delivered { bytes, failure: None } => {
                let jobs = &self.scenario.jobs[other];
                self.courses[other].delivered(bytes, jobs).map(|breach| (breach, other))
            }
            told => self.courses[end].told(told, &self.wrong).map(|breach| (breach, end)),
        }
    }

    pub(super) fn judge(&self, breach: Option<(Breach, usize)>, outcome: &mut Outcome) {
        let Some((breach, sender)) = breach else { return };
        if self.is_unavoidable(&breach, sender) {
            outcome.unavoidable.push(breach.name());
        } else if outcome.breach.is_none() {
            outcome.breach = Some(breach);
        }
    }

    fn is_unavoidable(&self, breach: &Breach, sender: usize) -> bool {
        let Scenario { guard, ambiguous, .. } = &*self.scenario;
        guard.is_unavoidable(breach, &self.wrong, sender, ambiguous[sender])
    }

    /// Nothing is due any more.
    pub(super) fn at_rest(&mut self) -> Option<Breach> {
        let is_hosts_turn = |(_, plugin): (usize, &PlugIn)| {
            plugin.is_paused() || plugin.is_down() || plugin.keeps()
        };
        if self.plugins().any(is_hosts_turn) {
            return None;
        }
        for end in &mut self.ends {
            if let End::PlugIn(plugin) = end
                && let Some(broken) = plugin.at_rest()
            {
                return Some(Breach::from(broken));
            }
        }
        let mut with_job = self.plugins().filter(|(_, plugin)| plugin.job().is_some());
        let stands =
            with_job.next().map(|(_, plugin)| Breach::StandsStill { is_held: plugin.is_held() });
        let partners = self.ends.iter().filter_map(|end| match end {
            End::Partner(partner) => partner.at_rest(&self.wrong),
            End::PlugIn(_) => None,
        });
        let breach = partners.chain(stands).next();
        breach.filter(|breach| !self.is_unavoidable(breach, 0))
    }
}
