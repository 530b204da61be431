//! The plan: how large each unit's buffer must be, or why no size will do.

use serde::Serialize;

use crate::change::{Change, changes};
use crate::model::{Model, holds, largest_equal};
use crate::programme::{Goal, solve};
use crate::shop::{Bus, Machine, Shop};

/// What a shop needs. As JSON it is stable: keys may be added, none changes.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Plan {
    /// Whether there are buffers with which no machine runs dry.
    pub feasible: bool,
    /// The most machines that the bus could feed if all were like the first.
    pub largest_equal: u64,
    /// The bus.
    pub bus: BusPlan,
    /// Each machine, in the order in which the bus serves them.
    pub machines: Vec<MachinePlan>,
    /// The smallest change that would mend the shop, as a part of what is changed; `None` if it is
    /// feasible, or if no change of one thing within what can be meant would do.
    pub advice: Option<Change>,
    /// All changes of one thing that would mend it, the smallest first; the first is the advice.
    pub changes: Vec<Change>,
    /// Buffer of each unit: the chosen ones, else what might be tried.
    #[serde(skip)]
    buffers: Vec<f64>,
}

/// The bus in a plan.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct BusPlan {
    /// Data bits per second while a unit is served.
    pub payload_bits_per_second: f64,
    /// What all machines take of that; at 1 and above no buffers suffice.
    pub load: f64,
    /// The margin that was planned with, as a part of 1.
    pub margin: f64,
    /// How long a round takes with the chosen buffers, each of them filled whole; `None` if the
    /// shop is not feasible.
    pub round_seconds: Option<f64>,
}

/// One machine in a plan. Buffers are those of its unit, in bits; they are `None` if the shop is
/// not feasible.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct MachinePlan {
    /// Its name.
    pub name: String,
    /// The smallest buffer that this unit can have. All units can have their smallest at once.
    pub unit_buffer_min_bits: Option<f64>,
    /// The largest buffer that this unit can have, the others having what suits it. Only where all
    /// machines are alike can all units have their largest at once.
    pub unit_buffer_max_bits: Option<f64>,
    /// The buffer that is chosen: of all that make the sum as large as it can be, those that are
    /// all as far between what their constraints allow.
    pub unit_buffer_bits: Option<f64>,
    /// How long a whole fill of the chosen buffer takes.
    pub fill_seconds: Option<f64>,
    /// How long the unit waits between two fills.
    pub wait_seconds: Option<f64>,
    /// What the serial line would have to carry, in data bit/s, if the unit did not feed its
    /// control while it is filled. It is more than constraint 1 asks for. `None` also where the unit
    /// never waits, being alone on a bus that does not switch.
    pub line_needed_bits_per_second: Option<f64>,
    /// Whether the unit must feed its control while it is filled, because the line does not carry
    /// that much.
    pub must_feed_while_filled: Option<bool>,
    /// Constraints that fail, by number.
    pub violated: Vec<u8>,
}

/// What is built and simulated: buffers, and in which order they are filled.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Service {
    /// Buffer of each unit, in bits.
    pub buffers: Vec<f64>,
    /// Indices of the units in the order in which the bus serves them.
    pub order: Vec<usize>,
}

impl Service {
    /// Seconds in which the bus fills each whole buffer once.
    pub fn round_seconds(&self, bus: &Bus) -> f64 {
        self.buffers.iter().map(|bits| bits / bus.payload() + bus.switch).sum()
    }
}

impl Plan {
    /// Buffers and order of service, to be held against a simulation. Where the shop is not
    /// feasible the buffers are the largest that constraint 3 allows: what might be tried.
    pub fn service(&self) -> Service {
        Service { buffers: self.buffers.clone(), order: (0..self.machines.len()).collect() }
    }

    /// Whether the plan holds only for units that feed their controls while they are filled.
    pub fn must_feed_while_filled(&self) -> bool {
        self.machines.iter().any(|machine| machine.must_feed_while_filled == Some(true))
    }
}

/// Plans a shop.
pub fn plan(shop: &Shop) -> Plan {
    let model = Model::new(shop);
    let chosen = choose(shop, &model);
    let changes = if chosen.is_some() { Vec::new() } else { changes(shop) };
    let bus = BusPlan {
        payload_bits_per_second: model.payload,
        load: shop.load(),
        margin: shop.bus().margin,
        round_seconds: chosen.as_ref().map(|chosen| chosen.round),
    };
    let fills = |chosen: &Chosen| chosen.fills.clone();
    let tried = || model.groups.iter().map(|group| group.holds).collect();
    let fills: Vec<f64> = chosen.as_ref().map_or_else(tried, fills);
    let single = |(machine, fill): (&Machine, f64)| {
        std::iter::repeat_n(fill * model.payload, machine.count as usize)
    };
    Plan {
        buffers: shop.machines().iter().zip(fills).flat_map(single).collect(),
        feasible: chosen.is_some(),
        largest_equal: largest_equal(shop),
        bus,
        machines: machines(shop, &model, chosen.as_ref()),
        advice: changes.first().cloned(),
        changes,
    }
}

/// Fills in seconds, one of each group, and the round that they make.
struct Chosen {
    least_round: f64,
    round: f64,
    fills: Vec<f64>,
}

/// The buffers whose sum is largest. What the solver says is held to the constraints as they
/// stand; if it does not meet them, or finds nothing, the least point is taken, which does.
fn choose(shop: &Shop, model: &Model) -> Option<Chosen> {
    if !model.is_feasible() {
        return None;
    }
    let least_round = model.least_round()?;
    // What the solver's tolerance adds to either end is taken off again.
    let within = |round: f64| round.clamp(least_round, model.longest_round());
    let solved = solve(model, Goal::Sum).map(|point| within(point.round));
    for round in solved.into_iter().chain([least_round]) {
        let Some(fills) = model.shared(round) else { continue };
        let buffers: Vec<_> = fills.iter().map(|fill| fill * model.payload).collect();
        if holds(shop, &buffers) {
            return Some(Chosen { least_round, round, fills });
        }
    }
    None
}

fn machines(shop: &Shop, model: &Model, chosen: Option<&Chosen>) -> Vec<MachinePlan> {
    let of_group = |(index, machine): (usize, &Machine)| {
        let group = &model.groups[index];
        let mut plan = MachinePlan {
            name: machine.name.clone(),
            unit_buffer_min_bits: None,
            unit_buffer_max_bits: None,
            unit_buffer_bits: None,
            fill_seconds: None,
            wait_seconds: None,
            line_needed_bits_per_second: None,
            must_feed_while_filled: None,
            violated: Vec::new(),
        };
        let Some(Chosen { least_round, round, fills }) = chosen else {
            plan.violated = model.violated(group);
            return plan;
        };
        let fill = fills[index];
        let needed = group.line_needed(fill, *round);
        plan.unit_buffer_min_bits = Some(model.payload * group.least_fill(*least_round));
        plan.unit_buffer_max_bits = Some(model.payload * model.most_fill(group));
        plan.unit_buffer_bits = Some(model.payload * fill);
        plan.fill_seconds = Some(fill);
        plan.wait_seconds = Some(if needed.is_some() { round - fill } else { 0.0 });
        plan.line_needed_bits_per_second = needed;
        plan.must_feed_while_filled = Some(needed.is_none_or(|needed| needed > machine.line()));
        plan
    };
    let groups: Vec<_> = shop.machines().iter().enumerate().map(of_group).collect();
    let single = |(machine, plan): (&Machine, MachinePlan)| {
        std::iter::repeat_n(plan, machine.count as usize)
    };
    let plans = shop.machines().iter().zip(groups).flat_map(single);
    plans.zip(shop.each()).map(|(plan, (name, _))| MachinePlan { name, ..plan }).collect()
}
