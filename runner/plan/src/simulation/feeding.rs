//! One machine: its unit, its line, its control. Levels go in straight lines between events.

use super::outcome::{Dry, MachineOutcome, Outcome, Sample};
use crate::shop::Machine;

/// Less than this part of a buffer is rounding.
const ROUNDING: f64 = 1e-7;

/// What comes in over the bus.
#[derive(Clone, Copy, Debug)]
pub(super) struct Inflow {
    /// Bits per second.
    pub(super) rate: f64,
    /// Whether it comes also where there is no room, and is lost.
    pub(super) is_blind: bool,
}

/// A buffer with its level, in bits.
#[derive(Clone, Copy, Debug)]
struct Store {
    level: f64,
    size: f64,
}

impl Store {
    fn full(size: f64) -> Self {
        Self { level: size, size }
    }

    fn is_full(&self) -> bool {
        self.level >= self.size
    }

    fn is_empty(&self) -> bool {
        self.level <= 0.0
    }

    /// Seconds until it is full or empty, at this many bits per second more or less.
    fn until_end(&self, slope: f64) -> f64 {
        if slope > 0.0 {
            (self.size - self.level) / slope
        } else if slope < 0.0 {
            self.level / -slope
        } else {
            f64::INFINITY
        }
    }

    /// After so long; exactly at its end if it is the end that was waited for.
    fn go(&mut self, slope: f64, seconds: f64) {
        let is_end = self.until_end(slope) <= seconds;
        self.level = match slope {
            slope if is_end && slope > 0.0 => self.size,
            slope if is_end && slope < 0.0 => 0.0,
            slope => (self.level + slope * seconds).clamp(0.0, self.size),
        };
    }
}

/// Bits per second from here on, until something is full or empty.
#[derive(Clone, Copy, Debug)]
struct Slopes {
    unit: f64,
    control: f64,
    lost: f64,
    lacking: f64,
}

/// A dry spell that goes on.
#[derive(Clone, Copy, Debug)]
struct Spell {
    from: f64,
    until: f64,
    lacks: f64,
}

/// One machine on the bus.
#[derive(Clone, Debug)]
pub(super) struct Feeding {
    unit: Store,
    control: Store,
    /// What the line carries and what the machine takes, in bits per second.
    line: f64,
    takes: f64,
    now: f64,
    /// When the machine begins.
    begins: f64,
    inflow: Option<Inflow>,
    feeds: bool,
    spell: Option<Spell>,
    keeps_levels: bool,
    lost: f64,
    outcome: MachineOutcome,
}

impl Feeding {
    pub(super) fn new(
        name: String,
        machine: &Machine,
        buffer: f64,
        begins: f64,
        keeps_levels: bool,
    ) -> Self {
        let control = machine.buffer_bits();
        let outcome = MachineOutcome {
            name,
            times_dry: 0,
            seconds_dry: 0.0,
            dry: Vec::new(),
            overflow_bits: 0.0,
            short_fills: 0,
            lowest_control_bits: control,
            unit_size_bits: buffer,
            control_size_bits: control,
            levels: Vec::new(),
        };
        let mut feeding = Self {
            unit: Store::full(buffer),
            control: Store::full(control),
            line: machine.line(),
            takes: machine.consumes,
            now: 0.0,
            begins,
            inflow: None,
            feeds: true,
            spell: None,
            keeps_levels,
            lost: 0.0,
            outcome,
        };
        feeding.keep_level();
        feeding
    }

    pub(super) fn unit(&self) -> f64 {
        self.unit.level
    }

    pub(super) fn unit_size(&self) -> f64 {
        self.unit.size
    }

    /// What leaves the unit now, in bits per second, if it is not empty.
    pub(super) fn drain(&self) -> f64 {
        let takes = if self.now >= self.begins { self.takes } else { 0.0 };
        if self.control.is_full() { takes.min(self.line) } else { self.line }
    }

    pub(super) fn has_not_begun(&self) -> bool {
        self.begins.is_infinite()
    }

    /// Seconds until the machine begins, if it has not.
    pub(super) fn begins_in(&self) -> Option<f64> {
        (self.now < self.begins).then_some(self.begins - self.now)
    }

    pub(super) fn begin(&mut self) {
        self.begins = self.now;
    }

    /// It has nothing yet.
    pub(super) fn empty(&mut self) {
        (self.unit.level, self.control.level) = (0.0, 0.0);
        self.outcome.levels.clear();
        self.keep_level();
    }

    /// The machine begins, and finds the worst that a fill can leave.
    pub(super) fn begin_at_worst(&mut self) {
        self.begin();
        self.unit = Store::full(self.unit.size);
        self.control.level = 0.0;
        self.keep_level();
    }

    pub(super) fn begin_fill(&mut self, inflow: Inflow, feeds: bool) {
        let lacks = self.control.size - self.control.level;
        if self.now >= self.begins && lacks > ROUNDING * self.control.size {
            self.outcome.short_fills += 1;
        }
        self.inflow = Some(inflow);
        self.feeds = feeds;
    }

    pub(super) fn end_fill(&mut self) {
        self.inflow = None;
        self.feeds = true;
    }

    /// Lets time go on to this second.
    pub(super) fn go_to(&mut self, time: f64) {
        while self.now < time {
            let end = if self.now < self.begins { time.min(self.begins) } else { time };
            let slopes = self.slopes();
            let event =
                self.unit.until_end(slopes.unit).min(self.control.until_end(slopes.control));
            let seconds = event.min(end - self.now);
            self.unit.go(slopes.unit, seconds);
            self.control.go(slopes.control, seconds);
            self.lost += slopes.lost * seconds;
            self.note_dry(slopes.lacking, seconds);
            // The end itself, so that what was lost in adding does not keep it away.
            self.now = if event < end - self.now { self.now + seconds } else { end };
            self.keep_level();
        }
        self.outcome.lowest_control_bits = self.outcome.lowest_control_bits.min(self.control.level);
    }

    fn slopes(&self) -> Slopes {
        let takes = if self.now >= self.begins { self.takes } else { 0.0 };
        let inflow = self.inflow.map_or(0.0, |inflow| inflow.rate);
        // What the unit can give: what it has, or what passes through it.
        let gives = match (self.feeds, self.unit.is_empty()) {
            (false, _) => 0.0,
            (true, false) => self.line,
            (true, true) => self.line.min(inflow),
        };
        let fed = if self.control.is_full() { gives.min(takes) } else { gives };
        let taken = if self.control.is_empty() { takes.min(fed) } else { takes };
        let room = if self.unit.is_full() { fed.min(inflow) } else { inflow };
        let is_blind = self.inflow.is_some_and(|inflow| inflow.is_blind);
        Slopes {
            unit: room - fed,
            control: fed - taken,
            lost: if is_blind { inflow - room } else { 0.0 },
            lacking: takes - taken,
        }
    }

    fn note_dry(&mut self, lacking: f64, seconds: f64) {
        if lacking <= 0.0 {
            return self.end_spell();
        }
        let spell = self.spell.get_or_insert(Spell { from: self.now, until: self.now, lacks: 0.0 });
        spell.until = self.now + seconds;
        spell.lacks += lacking * seconds;
    }

    fn end_spell(&mut self) {
        let Some(spell) = self.spell.take() else { return };
        if spell.lacks <= ROUNDING * self.control.size {
            return;
        }
        let dry = Dry { from: spell.from, seconds: spell.until - spell.from };
        self.outcome.times_dry += 1;
        self.outcome.seconds_dry += dry.seconds;
        if self.outcome.dry.len() < Outcome::MOST_DRY {
            self.outcome.dry.push(dry);
        }
    }

    fn keep_level(&mut self) {
        let levels = &mut self.outcome.levels;
        if self.keeps_levels && levels.len() < Outcome::MOST_SAMPLES {
            let (unit, control) = (self.unit.level, self.control.level);
            levels.push(Sample { at: self.now, unit, control });
        }
    }

    pub(super) fn conclude(mut self) -> MachineOutcome {
        self.end_spell();
        if self.lost > ROUNDING * self.unit.size {
            self.outcome.overflow_bits = self.lost;
        }
        self.outcome
    }
}
