//! What would mend a shop that is not feasible: for each number in it the smallest change that
//! does, all others staying as they are.
//!
//! Feasible means that the least round is no longer than the longest (`model`). A faster bus, a
//! shorter switch, a machine that takes less and fewer machines each make the least round shorter
//! and no longest round shorter, so each is looked for by halving. A faster line matters to
//! constraint 1 alone. A control's buffer is another matter: its own constraint 3 wants it large,
//! and the round of all others wants it small, because a unit must be able to fill it at once.
//! Both limits are in closed form. Whatever comes out is planned again before it is said.

use std::fmt;

use serde::Serialize;

use crate::limits::{LEAST_RATE, MOST_BUFFER, MOST_RATE};
use crate::model::Model;
use crate::shop::{Machine, Shop};
use crate::span;

/// What is changed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Parameter {
    /// The bus's rate, in bit/s.
    BusRate,
    /// The bus's time to switch, in seconds.
    Switch,
    /// A machine's serial rate, in bit/s.
    Rate,
    /// What a machine takes, in bit/s.
    Consumes,
    /// A control's buffer, in bytes.
    Buffer,
    /// How many machines of a kind there are.
    Count,
    /// What every machine takes, as a part of what it takes now.
    ConsumesOfAll,
}

/// A change of one thing that makes a shop feasible. Prints as what is to be done.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct Change {
    /// What is changed.
    pub parameter: Parameter,
    /// The machine as the shop names it, with all of its `count`; `None` for the bus, or all.
    pub machine: Option<String>,
    /// What it is.
    pub from: f64,
    /// What it must be at least, or at most: the nearest value that will do, rounded to four
    /// digits away from `from`. In the parameter's own unit.
    pub to: f64,
    /// How large the change is, as a part of `from`.
    pub relative: f64,
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let way = if self.to > self.from { "up" } else { "down" };
        let of = |f: &mut fmt::Formatter<'_>| match &self.machine {
            Some(name) => write!(f, " of {name}"),
            None => Ok(()),
        };
        match self.parameter {
            Parameter::BusRate => write!(f, "rate of the bus {way} to {} bit/s", self.to)?,
            Parameter::Switch => {
                write!(f, "switch of the bus {way} to {}", span::shown(self.to))?;
            }
            Parameter::Rate => {
                f.write_str("rate")?;
                of(f)?;
                write!(f, " {way} to {} bit/s", self.to)?;
            }
            Parameter::Consumes => {
                f.write_str("consumes")?;
                of(f)?;
                write!(f, " {way} to {} bit/s", self.to)?;
            }
            Parameter::Buffer => {
                f.write_str("buffer")?;
                of(f)?;
                write!(f, " {way} to {} bytes", self.to)?;
            }
            Parameter::Count => {
                f.write_str("count")?;
                of(f)?;
                write!(f, " {way} to {}", self.to)?;
            }
            Parameter::ConsumesOfAll => {
                write!(f, "consumes of every machine {way} to {} of what it is", self.to)?;
            }
        }
        let sign = if self.to > self.from { '+' } else { '-' };
        let percent = match self.to {
            to if to > 0.0 && to < self.from => percent_of_some(self.relative),
            _ => percent(self.relative),
        };
        write!(f, " ({sign}{percent} %)")
    }
}

/// Less by so much, where something is left: with as many digits as say that something is.
fn percent_of_some(part: f64) -> String {
    /// Most decimals: a double has no more that mean anything.
    const MOST_DECIMALS: usize = 12;
    if 100.0 * part < 99.5 {
        return percent(part);
    }
    (1..=MOST_DECIMALS)
        .map(|decimals| format!("{:.decimals$}", 100.0 * part))
        .find(|text| !text.starts_with("100"))
        .unwrap_or_else(|| format!("99.{}", "9".repeat(MOST_DECIMALS)))
}

/// A part of 1 as per cent, with two digits that matter.
fn percent(part: f64) -> String {
    let percent = 100.0 * part;
    match percent {
        p if p >= 10.0 => format!("{p:.0}"),
        p if p >= 1.0 => format!("{p:.1}"),
        p => format!("{p:.2}"),
    }
}

/// All changes of one thing that would mend this shop, the smallest for its size first.
pub(crate) fn changes(shop: &Shop) -> Vec<Change> {
    let mut changes = of_bus(shop);
    for index in 0..shop.machines().len() {
        changes.extend(of_machine(shop, index));
    }
    changes.sort_by(|one, other| one.relative.total_cmp(&other.relative));
    changes
}

/// A shop of which one thing is another.
#[derive(Clone)]
struct Changed {
    payload: f64,
    switch: f64,
    margin: f64,
    machines: Vec<Machine>,
}

impl Changed {
    fn new(shop: &Shop) -> Self {
        let bus = shop.bus();
        let machines = shop.machines().to_vec();
        Self { payload: bus.payload(), switch: bus.switch, margin: bus.margin, machines }
    }

    fn model(&self) -> Model {
        Model::of(self.payload, self.switch, self.margin, &self.machines)
    }

    fn is_feasible(&self) -> bool {
        self.machines.iter().any(|machine| machine.count > 0) && self.model().is_feasible()
    }
}

fn of_bus(shop: &Shop) -> Vec<Change> {
    let bus = shop.bus();
    let mut changed = Changed::new(shop);
    let rate = nearest(bus.rate, MOST_RATE, |rate| {
        changed.payload = rate * bus.efficiency;
        changed.is_feasible()
    });
    let mut changed = Changed::new(shop);
    let switch = nearest(bus.switch, 0.0, |switch| {
        changed.switch = switch;
        changed.is_feasible()
    });
    let all = part_of_all(shop);
    let change = |parameter, from, to: Option<f64>| to.map(|to| made(parameter, None, from, to));
    [
        change(Parameter::BusRate, bus.rate, rate),
        change(Parameter::Switch, bus.switch, switch),
        change(Parameter::ConsumesOfAll, 1.0, all),
    ]
    .into_iter()
    .flatten()
    .collect()
}

/// The part of what it takes now that each machine may take. `None` also where there is one kind
/// of machine, of which it is the same as its own change, and where some machine would have to take
/// less than can be meant.
fn part_of_all(shop: &Shop) -> Option<f64> {
    let machines = shop.machines();
    if machines.len() == 1 {
        return None;
    }
    let slowest = machines.iter().map(|machine| machine.consumes).fold(f64::INFINITY, f64::min);
    let least = LEAST_RATE / slowest;
    let mut changed = Changed::new(shop);
    let mut is_feasible = |part: f64| {
        for (machine, as_it_is) in changed.machines.iter_mut().zip(machines) {
            machine.consumes = part * as_it_is.consumes;
        }
        changed.is_feasible()
    };
    if least < 1.0 { nearest(1.0, least, &mut is_feasible) } else { None }
}

fn of_machine(shop: &Shop, index: usize) -> Vec<Change> {
    let machine = &shop.machines()[index];
    let name = Some(machine.name.clone());
    let mut changed = Changed::new(shop);
    let mut found = Vec::new();
    let mut add = |parameter, from, to: Option<f64>| {
        found.extend(to.map(|to| made(parameter, name.clone(), from, to)));
    };

    let to = nearest(machine.rate, MOST_RATE, |rate| {
        changed.machines[index].rate = rate;
        changed.is_feasible()
    });
    changed.machines[index].rate = machine.rate;
    add(Parameter::Rate, machine.rate, to);

    let to = nearest(machine.consumes, LEAST_RATE, |consumes| {
        changed.machines[index].consumes = consumes;
        changed.is_feasible()
    });
    changed.machines[index].consumes = machine.consumes;
    add(Parameter::Consumes, machine.consumes, to);

    let to = buffer(&changed, index).map(|bytes| bytes as f64);
    add(Parameter::Buffer, machine.buffer as f64, to);

    let to = count(&mut changed, index).map(|count| count as f64);
    add(Parameter::Count, machine.count as f64, to);
    found
}

fn made(parameter: Parameter, machine: Option<String>, from: f64, to: f64) -> Change {
    Change { parameter, machine, from, to, relative: (to - from).abs() / from }
}

/// The value nearest to `from`, on the way to `end`, for which it is feasible; `from` is not. From
/// there on to `end` it must be feasible.
fn nearest(from: f64, end: f64, mut is_feasible: impl FnMut(f64) -> bool) -> Option<f64> {
    const HALVINGS: u32 = 80;
    if !is_feasible(end) {
        return None;
    }
    // By orders of magnitude, where there are any.
    let on_the_way = |part: f64| match end {
        0.0 => from * (1.0 - part),
        _ => from * (end / from).powf(part),
    };
    let (mut not, mut feasible) = (0.0, 1.0);
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(not, feasible);
        if is_feasible(on_the_way(middle)) { feasible = middle } else { not = middle }
    }
    let exact = on_the_way(feasible);
    let exact = if is_feasible(exact) { exact } else { end };
    let rounded = rounded(exact, end > from);
    let is_between = (rounded - from) * (rounded - end) <= 0.0;
    Some(if is_between && is_feasible(rounded) { rounded } else { exact })
}

/// With four digits, up or down.
fn rounded(value: f64, up: bool) -> f64 {
    if value == 0.0 {
        return value;
    }
    let digit = 10f64.powi(value.abs().log10().floor() as i32 - 3);
    let digits = value / digit;
    let whole = if up { digits.ceil() } else { digits.floor() };
    // Through text, so that it is the number that a person would write.
    format!("{whole}e{}", digit.log10().round() as i32).parse().unwrap_or(value)
}

/// The buffer of this control, in bytes, that is nearest to what it is and will do.
fn buffer(shop: &Changed, index: usize) -> Option<u64> {
    let (model, now) = (shop.model(), shop.machines[index].buffer);
    let group = model.groups[index];
    // The least round is a line over what the control holds out: `still` without any buffer, and
    // `slope` more for each second.
    let mut without = model.clone();
    without.groups[index].holds = 0.0;
    let still = without.least_round()?;
    let slope = (model.least_round()? - still) / group.holds;
    let own = 1.0 / group.part - slope;
    let mut others = model.clone();
    others.groups.remove(index);
    let longest = others.groups.iter().map(crate::model::Group::longest_round);
    let longest = longest.fold(f64::INFINITY, f64::min);
    let bytes = |holds: f64| holds * group.takes / 8.0;
    let least = if own > 0.0 { bytes(still / own).ceil() } else { return None };
    let most = bytes((longest - still) / slope).floor();
    let now_is_small = (now as f64) < least;
    // Rounding may hide the last bit, so a byte more is looked at too.
    let near = if now_is_small { [least, least + 1.0] } else { [most, most - 1.0] };
    let is_meant = |bytes: &f64| (1.0..=MOST_BUFFER as f64).contains(bytes);
    near.into_iter().filter(is_meant).map(|bytes| bytes as u64).find(|bytes| {
        let mut changed = shop.clone();
        changed.machines[index].buffer = *bytes;
        changed.is_feasible()
    })
}

/// How many machines of this kind are the most; 0 if the others can do without none of them.
fn count(changed: &mut Changed, index: usize) -> Option<u64> {
    let now = changed.machines[index].count;
    let mut is_feasible = |count: u64| {
        changed.machines[index].count = count;
        // A kind of which there are none is no matter, whatever its numbers are.
        let mut left = changed.clone();
        left.machines.retain(|machine| machine.count > 0);
        left.is_feasible()
    };
    let (mut feasible, mut not) = (0, now);
    let mut found = is_feasible(0).then_some(0);
    while not - feasible > 1 {
        let middle = u64::midpoint(feasible, not);
        if is_feasible(middle) {
            (feasible, found) = (middle, Some(middle));
        } else {
            not = middle;
        }
    }
    changed.machines[index].count = now;
    found
}
