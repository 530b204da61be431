//! A shop in virtual time: the bus serves the units, the units feed the controls, the controls
//! take what they take. Nothing here knows the constraints, the closed forms or the solver.
//!
//! Data flows like a fluid: levels are real numbers that go in straight lines from one event to
//! the next (a fill begins or ends, something is empty or full), and each line is followed
//! exactly, so that no step of time has to be chosen.

mod feeding;
mod outcome;

pub use outcome::{Dry, MachineOutcome, Outcome, Sample};

use softplug_unit_bus::{Bus as LiveBus, BusRates, Step, Unit};

use feeding::{Feeding, Inflow};

use crate::planning::Service;
use crate::shop::Shop;

/// Most services of a simulation unless more are asked for: 1,000 hours of a usual bus. What takes
/// more ends early, and says so.
const USUAL_SERVICES: u64 = 20_000_000;
/// Shortest rest of the bus, in seconds, so that time goes on where a level is nearly reached.
const SHORTEST_REST: f64 = 1e-6;

/// How the bus serves its units.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Discipline {
    /// The model's own: in turn, and each unit has the bus for as long as its whole buffer takes,
    /// however much of it is missing.
    Slots,
    /// As a gateway serves a live bus, by the [same code](softplug_unit_bus): only what is missing is
    /// sent, and the urgent go first.
    Scheduled,
    /// In turn, and each unit is sent as much as its buffer holds, without asking how much room
    /// there is. Shows why units are asked.
    Blind,
}

/// How it begins.
#[derive(Clone, PartialEq, Debug, Default)]
pub enum Start {
    /// All buffers are full, and all machines begin at once.
    #[default]
    Full,
    /// All buffers are full, and each machine begins at its own time, in seconds. Those for which
    /// there is no time begin at once.
    At(Vec<f64>),
    /// All buffers are empty, and each machine begins when its first fill ends: a shop that is switched
    /// on in the morning.
    Empty,
    /// Each machine begins when its first fill ends, with a full unit and an empty control: the
    /// worst that a fill can leave behind. Not for [`Discipline::Scheduled`], which takes it as
    /// [`Start::Full`].
    Worst,
}

/// What is simulated of a shop.
#[derive(Clone, PartialEq, Debug)]
pub struct Options {
    /// For how long, in seconds of virtual time.
    pub seconds: f64,
    /// For how many services at most; what is reached by then is in the outcome.
    pub most_services: u64,
    /// Whether a unit feeds its control also while it is filled. The model says it does not.
    pub feeds_while_filled: bool,
    /// How it begins.
    pub start: Start,
    /// Whether levels over time are kept: up to [`Outcome::MOST_SAMPLES`] of each machine.
    pub keeps_levels: bool,
}

impl Default for Options {
    /// Ten hours from full buffers, of units that do not feed while they are filled; no levels.
    fn default() -> Self {
        Self {
            seconds: 36_000.0,
            most_services: USUAL_SERVICES,
            feeds_while_filled: false,
            start: Start::Full,
            keeps_levels: false,
        }
    }
}

/// Simulates a shop whose units have these buffers and are served in this order. Indices that
/// the shop has not are left out; a machine without a buffer has one of 0 bits.
pub fn simulate(
    shop: &Shop,
    service: &Service,
    discipline: Discipline,
    options: &Options,
) -> Outcome {
    let mut bus = Bus::new(shop, service, options);
    let order: Vec<_> =
        service.order.iter().copied().filter(|unit| *unit < bus.feedings.len()).collect();
    match discipline {
        Discipline::Slots => bus.in_turn(&order, false),
        Discipline::Blind => bus.in_turn(&order, true),
        Discipline::Scheduled => bus.scheduled(&order),
    }
    bus.conclude()
}

/// A bus with all that hangs on it.
struct Bus<'a> {
    feedings: Vec<Feeding>,
    /// Data bits per second.
    payload: f64,
    switch: f64,
    options: &'a Options,
    now: f64,
    services: u64,
}

impl<'a> Bus<'a> {
    fn new(shop: &Shop, service: &Service, options: &'a Options) -> Self {
        let feeding = |(index, (name, machine)): (usize, _)| {
            let begins = match &options.start {
                Start::Full => 0.0,
                Start::At(times) => times.get(index).copied().unwrap_or(0.0),
                Start::Empty | Start::Worst => f64::INFINITY,
            };
            let buffer = service.buffers.get(index).copied().unwrap_or(0.0);
            let mut feeding = Feeding::new(name, machine, buffer, begins, options.keeps_levels);
            if options.start == Start::Empty {
                feeding.empty();
            }
            feeding
        };
        Self {
            feedings: shop.each().enumerate().map(feeding).collect(),
            payload: shop.bus().payload(),
            switch: shop.bus().switch,
            options,
            now: 0.0,
            services: 0,
        }
    }

    fn goes_on(&self) -> bool {
        self.now < self.options.seconds && self.services < self.options.most_services
    }

    fn in_turn(&mut self, order: &[usize], is_blind: bool) {
        for &unit in order.iter().cycle() {
            if !self.goes_on() {
                return;
            }
            let takes = self.feedings[unit].unit_size() / self.payload;
            let inflow = Inflow { rate: self.payload, is_blind };
            self.serve(unit, inflow, takes);
            if self.options.start == Start::Worst && self.feedings[unit].has_not_begun() {
                self.feedings[unit].begin_at_worst();
            }
            self.now += self.switch;
        }
    }

    fn scheduled(&mut self, order: &[usize]) {
        let (rate, switch) = (self.payload, self.switch);
        let mut bus = LiveBus::new(BusRates { rate, efficiency: 1.0, switch }, self.now);
        if self.options.start == Start::Worst {
            self.feedings.iter_mut().for_each(Feeding::begin);
        }
        let mut units = Vec::with_capacity(order.len());
        while self.goes_on() {
            self.all_to(self.now);
            units.clear();
            units.extend(order.iter().map(|&index| self.feedings[index].as_unit()));
            match bus.poll(self.now, &units) {
                Step::Send(grant) => {
                    bus.sent(self.now, grant.bits);
                    let inflow = Inflow { rate: self.payload, is_blind: true };
                    self.serve(order[grant.unit], inflow, grant.bits / self.payload);
                }
                Step::Wait { until } => self.now = until,
                Step::Rest { until } => {
                    // A machine that begins is news, for which the bus does not sleep on.
                    let begins = self.feedings.iter().filter_map(Feeding::begins_in);
                    let rest = begins.fold(until - self.now, f64::min);
                    self.now += rest.max(SHORTEST_REST);
                    self.services += 1;
                }
            }
        }
    }

    /// Fills a unit for so long, in seconds.
    fn serve(&mut self, unit: usize, inflow: Inflow, seconds: f64) {
        let (end, last) = (self.now + seconds, self.options.seconds);
        let feeding = &mut self.feedings[unit];
        feeding.go_to(self.now);
        feeding.begin_fill(inflow, self.options.feeds_while_filled);
        feeding.go_to(end.min(last));
        feeding.end_fill();
        if self.options.start == Start::Empty && feeding.has_not_begun() {
            feeding.begin();
        }
        self.now = end;
        self.services += 1;
    }

    fn all_to(&mut self, time: f64) {
        self.feedings.iter_mut().for_each(|feeding| feeding.go_to(time));
    }

    fn conclude(mut self) -> Outcome {
        let seconds = self.now.min(self.options.seconds);
        self.all_to(seconds);
        Outcome {
            seconds,
            is_complete: seconds >= self.options.seconds,
            services: self.services,
            machines: self.feedings.into_iter().map(Feeding::conclude).collect(),
        }
    }
}

impl Feeding {
    /// As a scheduler is told of it.
    fn as_unit(&self) -> Unit {
        let (level, capacity) = (self.unit(), self.unit_size());
        Unit { level, has_begun: !self.has_not_begun(), ..Unit::working(capacity, self.drain()) }
    }
}
