//! A bus and its machines: what can be meant by them, and nothing else.

use std::collections::BTreeSet;

use crate::error::{ShopError, Wrong};
use crate::limits::{
    LEAST_RATE, MOST_BUFFER, MOST_MACHINES, MOST_MARGIN, MOST_NAME, MOST_RATE, MOST_SWITCH,
};

/// The bus.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Bus {
    /// Rate, in bit/s.
    pub rate: f64,
    /// Data bits of all bits on the bus, above 0 and at most 1.
    pub efficiency: f64,
    /// Time to switch from one unit to the next, in seconds.
    pub switch: f64,
    /// How much of each limit is left unused, as a part of 1: the shop is planned as if each
    /// machine took `1 / (1 - margin)` of what it takes.
    pub margin: f64,
}

impl Bus {
    /// Data bits per second while a unit is served: `rate × efficiency`.
    pub fn payload(&self) -> f64 {
        self.rate * self.efficiency
    }
}

/// One machine, or several that are alike.
#[derive(Clone, PartialEq, Debug)]
pub struct Machine {
    /// Its name; of several it is what their names begin with.
    pub name: String,
    /// Rate of the serial line between unit and control, in bit/s.
    pub rate: f64,
    /// Data bits of all bits on that line, above 0 and at most 1.
    pub efficiency: f64,
    /// What the control takes at most, in data bit/s.
    pub consumes: f64,
    /// The control's own receive buffer, in bytes.
    pub buffer: u64,
    /// How many there are.
    pub count: u64,
}

impl Machine {
    /// Data bits per second that the serial line can carry: `rate × efficiency`.
    pub fn line(&self) -> f64 {
        self.rate * self.efficiency
    }

    /// The control's own buffer, in bits.
    pub fn buffer_bits(&self) -> f64 {
        8.0 * self.buffer as f64
    }
}

/// A bus with its machines, all of whose numbers can be meant.
#[derive(Clone, PartialEq, Debug)]
pub struct Shop {
    bus: Bus,
    machines: Vec<Machine>,
}

impl Shop {
    /// A shop of this bus and these machines, in the order in which the bus serves them.
    ///
    /// # Errors
    ///
    /// The first number, name or count that cannot be meant; [`Wrong`] has all kinds.
    pub fn new(bus: Bus, machines: Vec<Machine>) -> Result<Self, ShopError> {
        let bare = |wrong| ShopError { place: None, wrong };
        check_bus(&bus).map_err(bare)?;
        for machine in &machines {
            check_machine(machine).map_err(bare)?;
        }
        check_together(&machines).map_err(|(_, wrong)| bare(wrong))?;
        Ok(Self { bus, machines })
    }

    /// The bus.
    pub fn bus(&self) -> &Bus {
        &self.bus
    }

    /// The machines as they were given: those that are alike once, with their count.
    pub fn machines(&self) -> &[Machine] {
        &self.machines
    }

    /// Each single machine with its name, in the order in which the bus serves them.
    pub fn each(&self) -> impl Iterator<Item = (String, &Machine)> {
        self.machines.iter().flat_map(|machine| {
            (1..=machine.count).map(move |number| (name_of(machine, number), machine))
        })
    }

    /// What all machines take of what the bus carries; below 1 where they can be fed at all.
    pub fn load(&self) -> f64 {
        let taken = self.machines.iter().map(|machine| machine.count as f64 * machine.consumes);
        taken.sum::<f64>() / self.bus.payload()
    }
}

fn name_of(machine: &Machine, number: u64) -> String {
    match machine.count {
        1 => machine.name.clone(),
        _ => format!("{}-{number}", machine.name),
    }
}

/// A number within bounds; `above` is the bound that it must exceed.
struct Range {
    above: f64,
    most: f64,
    needs: &'static str,
}

/// A whole number from 1 on.
pub(crate) struct WholeRange {
    pub(crate) most: u64,
    pub(crate) needs: &'static str,
}

pub(crate) const BUFFER: WholeRange =
    WholeRange { most: MOST_BUFFER, needs: "whole bytes from 1 to 1073741824" };
pub(crate) const COUNT: WholeRange =
    WholeRange { most: MOST_MACHINES, needs: "a whole number from 1 to 1000" };

const RATE: Range = Range {
    above: 0.999_999 * LEAST_RATE,
    most: MOST_RATE,
    needs: "bits per second from 1 to 1e12",
};
const EFFICIENCY: Range =
    Range { above: 0.999e-3, most: 1.0, needs: "data bits of all bits, from 0.001 to 1" };
const SWITCH: Range = Range { above: -1e-12, most: MOST_SWITCH, needs: SWITCH_NEEDS };
/// What a span that is too long is told.
pub(crate) const SWITCH_NEEDS: &str = "at most \"60s\"";
const MARGIN: Range =
    Range { above: 0.999e-6, most: MOST_MARGIN, needs: "a part of 1 from 0.000001 to 0.9" };

fn within(key: &'static str, value: f64, range: &Range) -> Result<(), Wrong> {
    // A NaN compares as false, and so is refused.
    if value > range.above && value <= range.most {
        return Ok(());
    }
    Err(Wrong::Value { key, value: number(value), needs: range.needs.to_owned() })
}

/// A number as an error shows it: as it was written where it is short.
pub(crate) fn number(value: f64) -> String {
    match value {
        value if value.is_nan() => "not a number".to_owned(),
        value if value.abs() >= 1e15 || (value != 0.0 && value.abs() < 1e-6) => {
            format!("{value:e}")
        }
        value => value.to_string(),
    }
}

pub(crate) fn check_bus(bus: &Bus) -> Result<(), Wrong> {
    within("rate", bus.rate, &RATE)?;
    within("efficiency", bus.efficiency, &EFFICIENCY)?;
    within("switch", bus.switch, &SWITCH)?;
    within("margin", bus.margin, &MARGIN)
}

pub(crate) fn check_machine(machine: &Machine) -> Result<(), Wrong> {
    check_name(&machine.name)?;
    within("rate", machine.rate, &RATE)?;
    within("efficiency", machine.efficiency, &EFFICIENCY)?;
    within("consumes", machine.consumes, &RATE)?;
    let whole = |key, value: u64, range: &WholeRange| {
        let is_meant = (1..=range.most).contains(&value);
        let (value, needs) = (value.to_string(), range.needs.to_owned());
        if is_meant { Ok(()) } else { Err(Wrong::Value { key, value, needs }) }
    };
    whole("buffer", machine.buffer, &BUFFER)?;
    whole("count", machine.count, &COUNT)
}

/// Whether Unicode has promised that this never is a character. XML refuses some of them.
pub(crate) fn is_nothing(c: char) -> bool {
    matches!(c, '\u{fdd0}'..='\u{fdef}') || u32::from(c) & 0xfffe == 0xfffe
}

/// Characters that turn or hide what stands beside them, and what is no character.
fn is_unseen(c: char) -> bool {
    c.is_control()
        || is_nothing(c)
        || matches!(c, '\u{ad}' | '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
}

pub(crate) fn check_name(name: &str) -> Result<(), Wrong> {
    let is_long = name.chars().nth(MOST_NAME).is_some();
    if !is_long && !name.trim().is_empty() && !name.chars().any(is_unseen) {
        return Ok(());
    }
    let begin: String = name.chars().take(MOST_NAME).collect();
    let more = if is_long { "…" } else { "" };
    Err(Wrong::Name { name: format!("\"{}{more}\"", begin.escape_debug()) })
}

/// What machines may not be together; with the one at which it shows.
pub(crate) fn check_together(machines: &[Machine]) -> Result<(), (usize, Wrong)> {
    if machines.is_empty() {
        return Err((0, Wrong::NoMachines));
    }
    // Each count is bounded already, so neither this sum nor the names below grow large.
    let all = machines.iter().map(|machine| machine.count).fold(0, u64::saturating_add);
    if all > MOST_MACHINES {
        return Err((0, Wrong::TooMany { machines: all }));
    }
    let mut names = BTreeSet::new();
    for (at, machine) in machines.iter().enumerate() {
        for name in (1..=machine.count).map(|number| name_of(machine, number)) {
            let shown = format!("\"{}\"", name.escape_debug());
            if !names.insert(name) {
                return Err((at, Wrong::Twice { name: shown }));
            }
        }
    }
    Ok(())
}
