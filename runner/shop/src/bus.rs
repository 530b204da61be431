//! The bus: frames on their way, and the scheduler that says whose turn it is.

use softplug_abi::{Instance, Micros};
use softplug_plan::Bus as PlannedBus;
use softplug_unit_bus::{Bus, BusFigures, BusRates, Grant, Step};

use crate::machine::Machine;

/// Most data bytes of a frame, as the unit protocol has it.
const FRAME: u64 = 1_000;

/// A bus that carries one frame after the other.
pub(crate) struct SimulatedBus {
    bus: Bus,
    /// A frame that is on its way: to whom, with how many bytes, and when it comes.
    frame: Option<(usize, u64, Micros)>,
    last: Option<usize>,
    turns: u64,
}

impl SimulatedBus {
    pub(crate) fn new(planned: &PlannedBus) -> Self {
        let PlannedBus { rate, efficiency, switch, .. } = *planned;
        let bus = Bus::new(BusRates { rate, efficiency, switch }, 0.0);
        Self { bus, frame: None, last: None, turns: 0 }
    }

    /// How often a unit had its turn.
    pub(crate) fn turns(&self) -> u64 {
        self.turns
    }

    pub(crate) fn figures(&self, now: Micros) -> BusFigures {
        self.bus.figures(now.as_secs_f64())
    }

    /// Hands over what has come, and sends what may leave. When to be called again.
    pub(crate) fn go_on<I: Instance>(
        &mut self,
        now: Micros,
        machines: &mut [Machine<I>],
    ) -> Micros {
        if let Some((unit, bytes, _)) = self.frame.take_if(|(.., at)| *at <= now) {
            machines[unit].comes(bytes);
        }
        if let Some((.., at)) = self.frame {
            return at;
        }
        let units: Vec<_> = machines.iter().map(Machine::as_unit).collect();
        match self.bus.poll(now.as_secs_f64(), &units) {
            Step::Send(grant) => self.send(now, grant),
            Step::Wait { until } | Step::Rest { until } => rounded_up(until),
        }
    }

    fn send(&mut self, now: Micros, Grant { unit, bits }: Grant) -> Micros {
        // Less than a byte ends the turn.
        let bytes = ((bits / 8.0) as u64).min(FRAME);
        let carries = self.bus.rates().payload();
        self.bus.sent(now.as_secs_f64(), if bytes == 0 { bits } else { bytes as f64 * 8.0 });
        if self.last.replace(unit) != Some(unit) {
            self.turns += 1;
        }
        let at = rounded_up(now.as_secs_f64() + bytes as f64 * 8.0 / carries);
        self.frame = Some((unit, bytes, at));
        at
    }
}

fn rounded_up(seconds: f64) -> Micros {
    // An endless wait is as long as one can be.
    Micros((seconds * 1e6).ceil() as i64)
}
