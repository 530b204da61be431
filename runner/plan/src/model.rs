//! The constraints of the model, and what follows from them in closed form.
//!
//! With R the bus's data rate, t the time to switch, and for machine i: p what it takes, L what its
//! line carries, Q the control's buffer and S the unit's, all in bits and seconds:
//!
//! 1. L > p
//! 2. p·T < S − Q, where T = Σ(S/R + t) over all machines, less S/R of its own
//! 3. p·S/R < Q
//! 4. S > 0, which follows from 2, as no Q is 0
//!
//! A **margin** μ makes strict what must be strict: everywhere p/(1−μ) stands for p, and ≤ for <.
//! So a margin means one thing only: how much more each machine could take.
//!
//! In seconds the constraints are simple. Let x = S/R be the time of a whole fill, C = Σ(x + t) the
//! **round**, ρ = p/R, and h = Q/p the time that a control **holds out** alone. Then 2 and 3 say
//!
//! ```text
//! (ρ·h + ρ·C)/(1 + ρ)  ≤  x  ≤  h
//! ```
//!
//! The left side grows with C, and C with every x. So there is one **least point**, which has the
//! smallest of all buffers at once: all left sides met with equality. Its round follows from
//! summing them up: C = (m·t + Σρh/(1+ρ)) / (1 − Σρ/(1+ρ)). And x ≤ h can be met where
//! (ρh + ρC)/(1+ρ) ≤ h, that is C ≤ h/ρ. A shop is feasible if and only if the least round is
//! no longer than the smallest h/ρ.

use crate::shop::{Machine, Shop};

/// A part of a round that is no wait: so much is lost in reckoning with 53 bits. A switch of the
/// bus is longer.
const LEAST_WAIT: f64 = 1e-12;

/// Machines that are alike, in seconds.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Group {
    /// How many.
    pub(crate) count: f64,
    /// Part of the bus that one of them takes: ρ.
    pub(crate) part: f64,
    /// Time that its control holds out alone: h.
    pub(crate) holds: f64,
    /// What it takes, in bit/s, with the margin.
    pub(crate) takes: f64,
    /// What its line carries, in bit/s.
    line: f64,
}

impl Group {
    fn new(machine: &Machine, payload: f64, margin: f64) -> Self {
        let takes = machine.consumes / (1.0 - margin);
        Self {
            count: machine.count as f64,
            part: takes / payload,
            holds: machine.buffer_bits() / takes,
            takes,
            line: machine.line(),
        }
    }

    /// Shortest fill that lasts this round: the left side above.
    pub(crate) fn least_fill(&self, round: f64) -> f64 {
        self.part * (self.holds + round) / (1.0 + self.part)
    }

    /// Longest round in which a fill can be long enough and yet not outlast the control.
    pub(crate) fn longest_round(&self) -> f64 {
        self.holds / self.part
    }

    /// Constraint 1.
    pub(crate) fn line_suffices(&self) -> bool {
        self.takes <= self.line
    }

    /// What the line must carry where a unit does not feed its control while it is filled: all
    /// that the control takes in a round, in what is left of it.
    ///
    /// `None` where the unit is filled all the time, but for what is lost in reckoning.
    pub(crate) fn line_needed(&self, fill: f64, round: f64) -> Option<f64> {
        let wait = round - fill;
        (wait > LEAST_WAIT * round).then(|| self.takes * round / wait)
    }
}

/// A shop in seconds.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Model {
    pub(crate) groups: Vec<Group>,
    /// Bus's data rate, in bit/s: R.
    pub(crate) payload: f64,
    /// Time in which a round only switches: m·t.
    pub(crate) switching: f64,
}

impl Model {
    pub(crate) fn new(shop: &Shop) -> Self {
        Self::of(shop.bus().payload(), shop.bus().switch, shop.bus().margin, shop.machines())
    }

    /// A model of parts that need not make a shop.
    pub(crate) fn of<'a>(
        payload: f64,
        switch: f64,
        margin: f64,
        machines: impl IntoIterator<Item = &'a Machine>,
    ) -> Self {
        let groups: Vec<_> =
            machines.into_iter().map(|machine| Group::new(machine, payload, margin)).collect();
        let machines: f64 = groups.iter().map(|group| group.count).sum();
        Self { groups, payload, switching: machines * switch }
    }

    fn sum(&self, of: impl Fn(&Group) -> f64) -> f64 {
        self.groups.iter().map(|group| group.count * of(group)).sum()
    }

    /// Round of the least point; `None` if constraint 2 can be met by no buffers at all.
    pub(crate) fn least_round(&self) -> Option<f64> {
        let left = 1.0 - self.sum(|group| group.part / (1.0 + group.part));
        let needed = self.sum(|group| group.part * group.holds / (1.0 + group.part));
        (left > 0.0).then(|| (self.switching + needed) / left)
    }

    /// Longest round that constraint 3 of every machine allows.
    pub(crate) fn longest_round(&self) -> f64 {
        let rounds = self.groups.iter().map(Group::longest_round);
        let whole = self.switching + self.sum(|group| group.holds);
        rounds.fold(whole, f64::min)
    }

    pub(crate) fn is_feasible(&self) -> bool {
        self.groups.iter().all(Group::line_suffices)
            && self.least_round().is_some_and(|round| round <= self.longest_round())
    }

    /// Which constraints of a machine fail, where the shop is not feasible. Constraint 2 is met by
    /// the least point, so that it is 3 that fails there; without a least point it is 2.
    pub(crate) fn violated(&self, group: &Group) -> Vec<u8> {
        let line = (!group.line_suffices()).then_some(1);
        let round = match self.least_round() {
            None => Some(2),
            Some(round) if round > group.longest_round() => Some(3),
            Some(_) => None,
        };
        line.into_iter().chain(round).collect()
    }

    /// The fills that make up a round: each as far between its least and its most as all others.
    ///
    /// `None` if the round is outside of what [`Self::least_round`] and [`Self::longest_round`]
    /// allow.
    pub(crate) fn shared(&self, round: f64) -> Option<Vec<f64>> {
        let filling = round - self.switching;
        let least = self.sum(|group| group.least_fill(round));
        let most = self.sum(|group| group.holds);
        let part = if most > least { (filling - least) / (most - least) } else { 0.0 };
        // What is lost in adding up many machines is no reason to refuse.
        let part =
            if (-1e-9..=1.0 + 1e-9).contains(&part) { part.clamp(0.0, 1.0) } else { return None };
        let fill = |group: &Group| {
            let least = group.least_fill(round);
            least + part * (group.holds - least)
        };
        Some(self.groups.iter().map(fill).collect())
    }

    /// Longest fill of one machine of a group over all feasible points: all others at their least
    /// in the longest round.
    pub(crate) fn most_fill(&self, group: &Group) -> f64 {
        let round = self.longest_round();
        let others = self.sum(|group| group.least_fill(round)) - group.least_fill(round);
        group.holds.min(round - self.switching - others)
    }
}

/// The most machines like this one that the bus can feed, all of them alike: the largest whole m
/// with m < Q·R / (p²·t + p·Q).
pub(crate) fn largest_equal(shop: &Shop) -> u64 {
    let Some(first) = shop.machines().first() else { return 0 };
    let bus = shop.bus();
    let one = Group::new(first, bus.payload(), bus.margin);
    if !one.line_suffices() {
        return 0;
    }
    let bits = first.buffer_bits();
    let bound = bits * bus.payload() / (one.takes * one.takes * bus.switch + one.takes * bits);
    // With the margin the bound itself is allowed.
    bound as u64
}

/// Whether buffers meet the four constraints as they stand, strictly and without any margin.
/// `buffers` are in bits, one of each group. Written apart from all above: this is what a solver is held to.
pub(crate) fn holds(shop: &Shop, buffers: &[f64]) -> bool {
    let bus = shop.bus().payload();
    let with = || shop.machines().iter().zip(buffers);
    let round: f64 =
        with().map(|(machine, s)| machine.count as f64 * (s / bus + shop.bus().switch)).sum();
    buffers.len() == shop.machines().len()
        && with().all(|(machine, s)| {
            let wait = round - s / bus;
            let bits = machine.buffer_bits();
            let takes = machine.consumes;
            machine.line() > takes
                && wait < (s - bits) / takes
                && s / bus < bits / takes
                && *s > 0.0
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shop::Bus;

    /// Sixteen mills, whose buffers lie between 22,400 and 34,133 bit; the bounds by hand.
    #[test]
    fn each_constraint_by_itself_refuses_what_does_not_meet_it() {
        let shop = |line: f64| {
            let bus = Bus { rate: 100_000.0, efficiency: 1.0, switch: 0.002, margin: 0.5 };
            let machine = Machine {
                name: "mill".to_owned(),
                rate: line,
                efficiency: 1.0,
                consumes: 6_000.0,
                buffer: 256,
                count: 16,
            };
            Shop::new(bus, vec![machine]).unwrap()
        };
        let cases = [
            (6_001.0, 22_399.9, false),
            (6_001.0, 22_400.1, true),
            (6_001.0, 34_133.3, true),
            (6_001.0, 34_133.4, false),
            (6_000.0, 30_000.0, false),
            (6_001.0, 0.0, false),
            (6_001.0, -1.0, false),
            (6_001.0, f64::NAN, false),
        ];
        for (line, buffer, is_held) in cases {
            assert_eq!(holds(&shop(line), &[buffer]), is_held, "{line}, {buffer}");
        }
        assert!(!holds(&shop(6_001.0), &[]));
    }
}
