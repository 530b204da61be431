//! Levels that are known in sixteenths only, as credit tells them.

use softplug_unit_bus::{Bus, BusRates, Step, Unit};

const RATES: BusRates = BusRates { rate: 1_927_934.0, efficiency: 0.5, switch: 0.01 };
/// Bits of a unit's buffer, as the planner has it for 64 mills on that bus.
const BUFFER: f64 = 8.0 * 33_932.0;
/// Bits of a control's own buffer.
const CONTROL: f64 = 8.0 * 2_048.0;
/// What a line carries, and what a mill takes of it, in bits per second.
const LINE: f64 = 15_360.0;
const TAKES: f64 = 14_400.0;
/// Bits of a frame.
const FRAME: f64 = 8_000.0;
const STEP: f64 = 0.002;

/// A mill with its unit.
#[derive(Clone, Copy, Default)]
struct Mill {
    unit: f64,
    control: f64,
    /// When its first data came.
    begun_at: Option<f64>,
    /// What the bus knows of the unit's level, and since when.
    told: f64,
    told_at: f64,
    is_dry: bool,
    times_dry: u64,
}

impl Mill {
    fn comes(&mut self, now: f64, bits: f64) {
        self.begun_at.get_or_insert(now);
        self.unit += bits;
        self.told += bits;
    }

    fn go_on(&mut self, now: f64) {
        let fed = self.unit.min(LINE * STEP).min(CONTROL - self.control);
        self.unit -= fed;
        self.control += fed;
        // It begins to cut when its own buffer has been filled.
        if self.begun_at.is_some_and(|begun| now > begun + 0.3) {
            let is_dry = self.control < TAKES * STEP;
            self.times_dry += u64::from(is_dry && !self.is_dry);
            self.is_dry = is_dry;
            self.control -= self.control.min(TAKES * STEP);
        }
        if self.told - self.unit >= BUFFER / 16.0 {
            (self.told, self.told_at) = (self.unit, now);
        }
    }

    fn as_unit(&self, now: f64) -> Unit {
        Unit {
            level: self.told,
            gone: (TAKES * (now - self.told_at)).min(BUFFER / 16.0),
            has_begun: self.begun_at.is_some(),
            has_data: self.told < BUFFER,
            ..Unit::working(BUFFER, TAKES)
        }
    }
}

/// 64 mills whose jobs are begun one after the other, with so many seconds between them.
fn switch_on(between: f64) -> (usize, u64) {
    let mut mills = [Mill::default(); 64];
    let mut bus = Bus::new(RATES, 0.0);
    let mut now = 0.0;
    while now < 150.0 {
        loop {
            let of = |(at, mill): (usize, &Mill)| {
                let is_there = now >= between * at as f64;
                if is_there { mill.as_unit(now) } else { Unit::ABSENT }
            };
            let units: Vec<_> = mills.iter().enumerate().map(of).collect();
            let Step::Send(grant) = bus.poll(now, &units) else { break };
            let bits = grant.bits.min(FRAME);
            bus.sent(now, bits);
            mills[grant.unit].comes(now, bits);
        }
        for mill in &mut mills {
            mill.go_on(now);
        }
        now += STEP;
    }
    let begun = mills.iter().filter(|mill| mill.begun_at.is_some()).count();
    (begun, mills.iter().map(|mill| mill.times_dry).sum())
}

#[test]
fn a_hall_that_is_switched_on_runs_dry_nowhere() {
    for milliseconds in [0, 30, 100, 250, 400] {
        let between = f64::from(milliseconds) / 1e3;
        assert_eq!(switch_on(between), (64, 0), "{milliseconds} ms");
    }
}
