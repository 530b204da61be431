//! A bus over time: whose turn it is, what may leave now, and what it came to.

use crate::measured::{BusFigures, Measured};
use crate::scheduler::{Decision, Grant, Line, Scheduler, Unit};

/// Whoever sends may be late by so many seconds and makes up for it: an uplink has a queue, from
/// which the bus goes on meanwhile.
const QUEUE: f64 = 0.05;
/// A unit to which nothing can be sent for so many seconds loses its turn: others wait.
const LINGER: f64 = 0.05;

/// What a bus is planned to carry.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct BusRates {
    /// All bits, per second.
    pub rate: f64,
    /// Data bits of all bits, above 0 and at most 1.
    pub efficiency: f64,
    /// Seconds to switch from one unit to the next.
    pub switch: f64,
}

impl BusRates {
    /// Data bits per second while a unit is served.
    pub const fn payload(&self) -> f64 {
        self.rate * self.efficiency
    }

    fn line(&self) -> Line {
        Line { bits_per_second: self.payload(), switch_seconds: self.switch }
    }
}

/// What the bus does now.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Step {
    /// This unit is served: up to so many bits may leave now. [`Bus::sent`] says how many did.
    Send(Grant),
    /// The bus is taken, or is being switched: nothing may leave before this time.
    Wait {
        /// When to ask again.
        until: f64,
    },
    /// Nobody wants anything that is worth a switch.
    Rest {
        /// When to ask again, or earlier if a level is other than it was told; infinite if no
        /// machine takes anything.
        until: f64,
    },
}

/// A bus that serves one unit after the other, each for as long as what it lacks takes.
///
/// It is polled: [`Bus::poll`] after anything has changed and at the time that it named; spurious
/// polls do nothing. Units are always the same, in one order; one that is gone is
/// [absent](Unit::ABSENT) until its place is taken.
///
/// ```
/// use softplug_unit_bus::{Bus, BusRates, Grant, Step, Unit};
///
/// let mut bus = Bus::new(BusRates { rate: 250_000.0, efficiency: 0.4, switch: 0.002 }, 0.0);
/// let unit = |level| Unit { level, ..Unit::working(10_000.0, 5_000.0) };
/// let units = [unit(2_000.0), unit(4_000.0)];
///
/// let send = Step::Send(Grant { unit: 0, bits: 8_000.0 });
/// assert_eq!(bus.poll(0.0, &units), send);
/// bus.sent(0.0, 8_000.0);
/// // At 100,000 bit/s of data that takes 80 ms; then comes the switch.
/// let units = [unit(9_600.0), unit(3_600.0)];
/// assert_eq!(bus.poll(0.01, &units), Step::Wait { until: 0.082 });
/// assert_eq!(bus.poll(0.082, &units), Step::Send(Grant { unit: 1, bits: 6_400.0 }));
/// ```
#[derive(Clone, PartialEq, Debug)]
pub struct Bus {
    rates: BusRates,
    scheduler: Scheduler,
    state: State,
    /// When the last bit that was sent has left.
    free_at: f64,
    measured: Measured,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum State {
    /// It may begin a turn at once.
    Resting,
    /// A unit is served.
    Serving(Turn),
    /// The last bit of a turn leaves, and then the bus switches.
    Switching,
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Turn {
    unit: usize,
    left: f64,
    /// When the turn before ended, until the first bit of this one has left; `None`: the bus rested.
    switches_since: Option<f64>,
    /// Since when nothing can be sent.
    lingers_since: Option<f64>,
}

impl Bus {
    /// One that has served nobody yet.
    pub const fn new(rates: BusRates, now: f64) -> Self {
        Self {
            rates,
            scheduler: Scheduler::new(),
            state: State::Resting,
            free_at: now,
            measured: Measured::new(now),
        }
    }

    /// What it is planned to carry.
    pub const fn rates(&self) -> &BusRates {
        &self.rates
    }

    /// It is planned to carry something else from now on. What is on its way leaves at the new rate,
    /// too: a rate that was wrong for a moment must not hold the bus for hours.
    pub fn set_rates(&mut self, now: f64, rates: BusRates) {
        let waits = (self.free_at - now).max(0.0);
        self.free_at = self.free_at.min(now) + waits * self.rates.payload() / rates.payload();
        self.rates = rates;
    }

    /// Whose turn it is.
    pub const fn serves(&self) -> Option<usize> {
        match self.state {
            State::Serving(turn) => Some(turn.unit),
            State::Resting | State::Switching => None,
        }
    }

    /// What to do now.
    pub fn poll(&mut self, now: f64, units: &[Unit]) -> Step {
        self.measured.go_to(now);
        loop {
            match self.state {
                State::Resting => match self.decide(units) {
                    Ok(grant) => self.begin(grant, now, None),
                    Err(seconds) => return Step::Rest { until: now + seconds },
                },
                State::Switching => {
                    let ready = self.free_at + self.rates.switch;
                    if now < ready {
                        return Step::Wait { until: ready };
                    }
                    match self.decide(units) {
                        Ok(grant) => self.begin(grant, ready, Some(self.free_at)),
                        Err(_) => self.state = State::Resting,
                    }
                }
                State::Serving(_) if now < self.free_at => {
                    return Step::Wait { until: self.free_at };
                }
                State::Serving(mut turn) => {
                    let unit = units.get(turn.unit).copied().unwrap_or(Unit::ABSENT);
                    let bits = turn.left.min(unit.room());
                    if unit.has_data && bits > 0.0 {
                        turn.lingers_since = None;
                        self.state = State::Serving(turn);
                        return Step::Send(Grant { unit: turn.unit, bits });
                    }
                    let until = *turn.lingers_since.get_or_insert(now) + LINGER;
                    self.state = State::Serving(turn);
                    if now < until {
                        return Step::Wait { until };
                    }
                    self.free_at = now;
                    self.state = State::Switching;
                }
            }
        }
    }

    /// The unit whose turn it is was sent so many bits. More than its turn has ends it, too.
    pub fn sent(&mut self, now: f64, bits: f64) {
        let State::Serving(mut turn) = self.state else { return };
        if let Some(ended) = turn.switches_since.take() {
            self.measured.switched(now - ended);
        }
        self.measured.sent(bits);
        self.free_at = self.free_at.max(now - QUEUE) + bits / self.rates.payload();
        turn.left -= bits;
        self.state = if turn.left > 0.0 { State::Serving(turn) } else { State::Switching };
    }

    /// So many bits of all kinds went over the bus, both ways: data, and what goes with it.
    pub const fn carried(&mut self, bits: f64) {
        self.measured.carried(bits);
    }

    /// What was measured in about the last minute.
    pub fn figures(&self, now: f64) -> BusFigures {
        self.measured.figures(now, self.rates.payload())
    }

    /// A turn, or for how many seconds there is none.
    fn decide(&mut self, units: &[Unit]) -> Result<Grant, f64> {
        match self.scheduler.decide(units, &self.rates.line()) {
            Decision::Serve(grant) => Ok(grant),
            Decision::Rest { seconds } => Err(seconds),
        }
    }

    fn begin(&mut self, grant: Grant, at: f64, switches_since: Option<f64>) {
        self.free_at = at;
        let Grant { unit, bits: left } = grant;
        self.state = State::Serving(Turn { unit, left, switches_since, lingers_since: None });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATES: BusRates = BusRates { rate: 1e6, efficiency: 0.1, switch: 0.01 };

    fn unit(level: f64) -> Unit {
        Unit { level, ..Unit::working(10_000.0, 1_000.0) }
    }

    fn send(unit: usize, bits: f64) -> Step {
        Step::Send(Grant { unit, bits })
    }

    #[track_caller]
    fn waits(step: Step, wanted: f64) {
        let Step::Wait { until } = step else { panic!("{step:?}") };
        assert!((until - wanted).abs() < 1e-9, "{until}");
    }

    #[test]
    fn data_leaves_in_pieces_at_the_rate_of_the_bus() {
        let mut bus = Bus::new(RATES, 0.0);
        let mut units = [unit(5_000.0), unit(5_000.0)];
        assert_eq!(bus.poll(0.0, &units), send(0, 5_000.0));
        assert_eq!(bus.serves(), Some(0));
        bus.sent(0.0, 3_000.0);
        units[0].level = 8_000.0;
        waits(bus.poll(0.001, &units), 0.03);
        assert_eq!(bus.poll(0.0301, &units), send(0, 2_000.0));
        bus.sent(0.0301, 2_000.0);
        waits(bus.poll(0.0302, &units), 0.06);
        assert_eq!(bus.serves(), None);
        assert_eq!(bus.poll(0.0601, &units), send(1, 5_000.0));
    }

    #[test]
    fn who_is_late_by_less_than_the_queue_makes_up_for_it() {
        let mut bus = Bus::new(RATES, 0.0);
        let units = [unit(0.0)];
        assert_eq!(bus.poll(0.0, &units), send(0, 10_000.0));
        bus.sent(0.0, 1_000.0);
        // The first piece has left at 0.01, so that the second one has at 0.02.
        bus.sent(0.03, 1_000.0);
        assert!(matches!(bus.poll(0.0301, &units), Step::Send(_)));
        // Time of long ago is lost.
        bus.sent(1.0, 6_000.0);
        waits(bus.poll(1.0, &units), 1.01);
    }

    #[test]
    fn a_unit_to_which_nothing_can_be_sent_loses_its_turn() {
        let mut bus = Bus::new(RATES, 0.0);
        let mut units = [unit(0.0), unit(5_000.0)];
        assert_eq!(bus.poll(0.0, &units), send(0, 10_000.0));
        bus.sent(0.0, 1_000.0);
        units[0].has_data = false;
        waits(bus.poll(0.02, &units), 0.02 + LINGER);
        // It comes back in time …
        units[0].has_data = true;
        assert_eq!(bus.poll(0.03, &units), send(0, 9_000.0));
        units[0] = Unit::ABSENT;
        waits(bus.poll(0.04, &units), 0.04 + LINGER);
        // … and does not; the place may be gone altogether.
        waits(bus.poll(0.1, &units), 0.11);
        assert_eq!(bus.poll(0.1101, &units), send(1, 5_000.0));
        assert!(matches!(bus.poll(0.12, &[]), Step::Wait { .. }));
        waits(bus.poll(0.2, &[]), 0.21);
        assert_eq!(bus.poll(0.2101, &[]), Step::Rest { until: f64::INFINITY });
    }

    #[test]
    fn a_rate_that_was_wrong_for_a_moment_does_not_hold_the_bus() {
        let mut bus = Bus::new(RATES, 0.0);
        let units = [unit(0.0), unit(0.0)];
        bus.set_rates(0.0, BusRates { rate: 1.0, ..RATES });
        assert_eq!(bus.poll(0.0, &units), send(0, 10_000.0));
        bus.sent(0.0, 8_000.0);
        waits(bus.poll(0.0, &units), 80_000.0);
        // A tenth of it has left when somebody repairs the rate.
        bus.set_rates(8_000.0, RATES);
        waits(bus.poll(8_000.0, &units), 8_000.072);
        assert_eq!(bus.poll(8_000.073, &units), send(0, 2_000.0));
    }

    #[test]
    fn load_efficiency_and_switching_are_measured() {
        let mut bus = Bus::new(RATES, 0.0);
        let units = [unit(0.0), unit(0.0)];
        let mut now = 0.0;
        for _ in 0..20 {
            let Step::Send(grant) = bus.poll(now, &units) else { panic!("it serves") };
            bus.sent(now, grant.bits);
            bus.carried(4.0 * grant.bits);
            let Step::Wait { until } = bus.poll(now, &units) else { panic!("it is taken") };
            // Each switch takes 2 ms more than was planned.
            now = until + 0.002;
        }
        let figures = bus.figures(now);
        let is = |measured: Option<f64>, wanted: f64| (measured.unwrap() - wanted).abs() < 1e-6;
        assert!(is(figures.efficiency, 0.25), "{figures:?}");
        assert!(is(figures.switch, 0.012), "{figures:?}");
        assert!((figures.load.unwrap() - 0.9).abs() < 0.02, "{figures:?}");
    }

    proptest::proptest! {
        /// However late whoever sends is: over any time no more leaves than the bus carries and its
        /// queue holds, and no unit is sent more than it has room for.
        #[test]
        fn no_more_leaves_than_the_bus_carries(
            lates in proptest::collection::vec((0_u32..100_000, 1_u32..3_000), 1..300),
        ) {
            let mut bus = Bus::new(RATES, 0.0);
            let mut units = [unit(0.0), unit(9_000.0), unit(3_000.0)];
            let (mut now, mut sent) = (0.0, Vec::new());
            for (late, most) in lates {
                match bus.poll(now, &units) {
                    Step::Send(Grant { unit, bits }) => {
                        let bits = bits.min(f64::from(most));
                        bus.sent(now, bits);
                        units[unit].level += bits;
                        proptest::prop_assert!(units[unit].level <= units[unit].capacity);
                        sent.push((now, bits));
                    }
                    Step::Wait { until } => now = until + f64::from(late) / 1e6,
                    Step::Rest { .. } => units.iter_mut().for_each(|unit| unit.level = 100.0),
                }
            }
            for (first, (from, _)) in sent.iter().enumerate() {
                let mut sum = 0.0;
                for (to, bits) in &sent[first..] {
                    let most = RATES.payload() * (to - from + QUEUE) + 3_000.0;
                    proptest::prop_assert!(sum <= most + 1e-6, "{sum} bits in {} s", to - from);
                    sum += bits;
                }
            }
        }
    }
}
