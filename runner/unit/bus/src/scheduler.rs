//! Which unit the bus serves next, and with how many bits.
//!
//! No I/O, no clock, no allocation, and nothing of `std`: whoever drives a bus, in virtual time or
//! a live one, tells what the levels are and is told what to do. Units are served in turn, as long
//! as all others could still be served in time after the one in turn, whoever is dry first before
//! the rest; if not, the one that is dry first goes first. A machine that has not begun never runs
//! dry: it waits until those that work leave it the time.
//!
//! A unit that has room for less than a quarter of its buffer is passed over, so that the bus does
//! not spend its time switching. A larger part would not do: on a bus that is loaded to the full,
//! time in which it rests is lost, and while all others are served a unit loses up to e times what
//! it had lost. One whose machine stands is served when no other is worth it.
//!
//! ```
//! use softplug_unit_bus::{Decision, Grant, Line, Scheduler, Unit};
//!
//! let bus = Line { bits_per_second: 100_000.0, switch_seconds: 0.002 };
//! let unit = |level| Unit { level, ..Unit::working(10_000.0, 5_000.0) };
//! let mut scheduler = Scheduler::new();
//!
//! // All is well: in turn.
//! let first = scheduler.decide(&[unit(2_000.0), unit(4_000.0)], &bus);
//! assert_eq!(first, Decision::Serve(Grant { unit: 0, bits: 8_000.0 }));
//! // Unit 1 is in turn, but unit 0 has only 10 ms left.
//! let second = scheduler.decide(&[unit(50.0), unit(4_000.0)], &bus);
//! assert_eq!(second, Decision::Serve(Grant { unit: 0, bits: 9_950.0 }));
//! // Nobody has room enough: look again when the first one has.
//! let third = scheduler.decide(&[unit(9_000.0), unit(8_500.0)], &bus);
//! assert_eq!(third, Decision::Rest { seconds: 0.2 });
//! ```

use core::cmp::Ordering;

/// What the scheduler is told of a unit.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Unit {
    /// Bits in its buffer when it was last told, and those sent since.
    pub level: f64,
    /// Bits that are likely to have left it since then. There is room for them only when it is told.
    pub gone: f64,
    /// Bits that its buffer holds.
    pub capacity: f64,
    /// Bits per second that leave it at most while it waits; 0 if its machine stands.
    pub drain: f64,
    /// There is something that could be sent to it now.
    pub has_data: bool,
    /// Its machine has begun, and would stop without data.
    pub has_begun: bool,
}

/// A unit is worth a switch from this part of its buffer on.
const WORTH: f64 = 0.25;

impl Unit {
    /// One for which there is nothing.
    pub const ABSENT: Self = Self { has_data: false, ..Self::working(0.0, 0.0) };

    /// One with an empty buffer of so many bits, whose machine has begun and takes so many per
    /// second.
    pub const fn working(capacity: f64, drain: f64) -> Self {
        Self { level: 0.0, gone: 0.0, capacity, drain, has_data: true, has_begun: true }
    }

    /// Bits that it has room for.
    pub(crate) fn room(&self) -> f64 {
        (self.capacity - self.level).max(0.0)
    }

    fn is_worth_a_switch(&self) -> bool {
        self.has_data && self.room() >= WORTH * self.capacity
    }

    /// Seconds until it is dry.
    fn lasts(&self) -> f64 {
        if self.has_begun && self.drain > 0.0 {
            (self.level - self.gone).max(0.0) / self.drain
        } else {
            f64::INFINITY
        }
    }

    /// Bits that it will have room for after so many seconds.
    fn room_after(&self, seconds: f64) -> f64 {
        (self.room() + self.drain * seconds).min(self.capacity)
    }

    /// Seconds until it is worth a switch.
    fn rests(&self) -> f64 {
        let missing = (WORTH * self.capacity - self.room()).max(0.0);
        if self.has_data && self.drain > 0.0 { missing / self.drain } else { f64::INFINITY }
    }
}

/// What the scheduler is told of the bus.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Line {
    /// Data bits per second while a unit is served.
    pub bits_per_second: f64,
    /// Seconds to switch from one unit to another.
    pub switch_seconds: f64,
}

/// So many bits to this unit, all in one go.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Grant {
    /// Index of the unit.
    pub unit: usize,
    /// Bits, never more than the unit had room for.
    pub bits: f64,
}

/// What the bus does next.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Decision {
    /// It serves a unit.
    Serve(Grant),
    /// Nothing for so long, or until a level is other than it was told; infinite if no machine
    /// takes anything.
    Rest {
        /// Seconds.
        seconds: f64,
    },
}

/// Serves in turn, the urgent first. Its whole state is whose turn it is.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct Scheduler {
    turn: usize,
}

impl Scheduler {
    /// Begins with the first unit.
    pub const fn new() -> Self {
        Self { turn: 0 }
    }

    /// What to do now that no unit is being served. `units` are always the same, in one order. The
    /// time that it takes grows with the square of how many there are.
    pub fn decide(&mut self, units: &[Unit], bus: &Line) -> Decision {
        let Some((in_turn, waits)) = next_in_turn(units, self.turn) else {
            let rests = units.iter().map(Unit::rests);
            return Decision::Rest { seconds: rests.fold(f64::INFINITY, f64::min) };
        };
        let chosen = match most_urgent(units) {
            Some((urgent, unit))
                if unit.lasts() < waits.lasts() && !leaves_time(units, in_turn, bus) =>
            {
                urgent
            }
            _ => in_turn,
        };
        if chosen == in_turn {
            self.turn = (in_turn + 1) % units.len();
        }
        Decision::Serve(Grant { unit: chosen, bits: units[chosen].room() })
    }
}

/// The next unit from the one whose turn it is that is worth a switch: one whose machine takes
/// something, if there is any.
fn next_in_turn(units: &[Unit], turn: usize) -> Option<(usize, &Unit)> {
    let in_turn = || {
        let behind = units.iter().enumerate().skip(turn);
        let before = units.iter().enumerate().take(turn);
        behind.chain(before).filter(|(_, unit)| unit.is_worth_a_switch())
    };
    in_turn().find(|(_, unit)| unit.drain > 0.0).or_else(|| in_turn().next())
}

/// Of those with room, the one that is dry first.
fn most_urgent(units: &[Unit]) -> Option<(usize, &Unit)> {
    let with_room = units.iter().enumerate().filter(|(_, unit)| unit.is_worth_a_switch());
    with_room.min_by(|(_, one), (_, other)| one.lasts().total_cmp(&other.lasts()))
}

/// Whether, after this one, all others can be served before they are dry, each in the order in
/// which they will be.
fn leaves_time(units: &[Unit], first: usize, bus: &Line) -> bool {
    let takes = |bits: f64| bits / bus.bits_per_second + bus.switch_seconds;
    let all: f64 = units.iter().map(|unit| takes(unit.capacity)).sum();
    let mut begins = takes(units[first].room()) + bus.switch_seconds;
    let mut before = (f64::NEG_INFINITY, 0);
    loop {
        let later = |(index, unit): (usize, &Unit)| {
            let due = (unit.lasts(), index);
            (unit.has_data && index != first && due > before).then_some(due)
        };
        let next = units.iter().enumerate().filter_map(later);
        let Some(due) = next.min_by(|one, other| one.partial_cmp(other).unwrap_or(Ordering::Equal))
        else {
            return true;
        };
        let (lasts, index) = due;
        if lasts < begins {
            return false;
        }
        if lasts >= all {
            return true;
        }
        begins += takes(units[index].room_after(begins));
        before = due;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BUS: Line = Line { bits_per_second: 1e5, switch_seconds: 1e-3 };

    fn unit(level: f64) -> Unit {
        Unit { level, ..Unit::working(1_000.0, 100.0) }
    }

    fn served(decision: Decision) -> Option<usize> {
        match decision {
            Decision::Serve(grant) => Some(grant.unit),
            Decision::Rest { .. } => None,
        }
    }

    #[test]
    fn units_are_served_in_turn_and_full_ones_are_passed_over() {
        let mut scheduler = Scheduler::new();
        let units = [unit(300.0), unit(900.0), unit(400.0), unit(300.0)];
        let order: Vec<_> = (0..5).map(|_| served(scheduler.decide(&units, &BUS))).collect();
        assert_eq!(order, [0, 2, 3, 0, 2].map(Some));
    }

    #[test]
    fn the_urgent_go_first_and_the_turn_stays() {
        let mut scheduler = Scheduler::new();
        let units = [unit(300.0), unit(400.0), unit(0.5), unit(0.1)];
        assert_eq!(served(scheduler.decide(&units, &BUS)), Some(3));
        let units = [unit(300.0), unit(400.0), unit(0.4), unit(1_000.0)];
        assert_eq!(served(scheduler.decide(&units, &BUS)), Some(2));
        let units = [unit(300.0), unit(400.0), unit(1_000.0), unit(999.0)];
        assert_eq!(served(scheduler.decide(&units, &BUS)), Some(0));
        assert_eq!(served(scheduler.decide(&units, &BUS)), Some(1));
    }

    #[test]
    fn a_machine_that_has_not_begun_waits_until_those_that_work_leave_it_the_time() {
        let mut scheduler = Scheduler::new();
        let new = Unit { has_begun: false, ..unit(0.0) };
        // Its fill takes 11 ms and a switch; 0.01 s is what unit 2 has left.
        let units = [new, unit(400.0), unit(1.0)];
        assert_eq!(served(scheduler.decide(&units, &BUS)), Some(2));
        let units = [new, unit(400.0), unit(999.0)];
        assert_eq!(served(scheduler.decide(&units, &BUS)), Some(0));
    }

    #[test]
    fn all_that_are_nearly_dry_are_looked_at_and_not_the_first_alone() {
        let mut scheduler = Scheduler::new();
        let new = Unit { has_begun: false, ..unit(0.0) };
        // One of them could wait for the new one, both cannot.
        let units = [new, unit(1.5), unit(1.6)];
        assert_eq!(served(scheduler.decide(&units, &BUS)), Some(1));
        assert_eq!(served(scheduler.decide(&[new, unit(1.5), unit(500.0)], &BUS)), Some(0));
    }

    #[test]
    fn what_is_likely_to_have_left_counts_and_is_no_room_yet() {
        let mut scheduler = Scheduler::new();
        let units = [unit(300.0), Unit { gone: 60.0, ..unit(60.5) }, unit(40.0)];
        let decision = scheduler.decide(&units, &BUS);
        assert_eq!(decision, Decision::Serve(Grant { unit: 1, bits: 939.5 }));
    }

    #[test]
    fn a_unit_whose_machine_stands_waits_for_the_others() {
        let mut scheduler = Scheduler::new();
        let stands = Unit { drain: 0.0, ..unit(0.0) };
        let units = [stands, unit(300.0), unit(400.0)];
        let order: Vec<_> = (0..3).map(|_| served(scheduler.decide(&units, &BUS))).collect();
        assert_eq!(order, [1, 2, 1].map(Some));
        assert_eq!(served(scheduler.decide(&[stands, unit(800.0)], &BUS)), Some(0));
    }

    #[test]
    fn a_unit_for_which_there_is_nothing_is_passed_over() {
        let mut scheduler = Scheduler::new();
        let units = [Unit { has_data: false, ..unit(0.0) }, unit(300.0), Unit::ABSENT];
        assert_eq!(served(scheduler.decide(&units, &BUS)), Some(1));
        assert_eq!(served(scheduler.decide(&units, &BUS)), Some(1));
        let forever = Decision::Rest { seconds: f64::INFINITY };
        assert_eq!(scheduler.decide(&[units[0], Unit::ABSENT], &BUS), forever);
    }

    #[test]
    fn the_bus_rests_until_somebody_has_room() {
        let mut scheduler = Scheduler::new();
        let decision = scheduler.decide(&[unit(900.0), unit(850.0)], &BUS);
        assert_eq!(decision, Decision::Rest { seconds: 1.0 });
        let still = Unit { drain: 0.0, ..unit(900.0) };
        let forever = Decision::Rest { seconds: f64::INFINITY };
        assert_eq!(scheduler.decide(&[still], &BUS), forever);
        assert_eq!(scheduler.decide(&[], &BUS), forever);
    }
}
