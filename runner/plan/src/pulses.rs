//! How many machines one computer can give their feed pulses, by three ways of serving them.
//!
//! Each machine takes a pulse in each period of `1 / rate`. By *interrupts* each pulse costs its
//! service and the entry of an interrupt; by *polling* one turn serves all machines and one branch more
//! that belongs to nobody; in *batches* the pulses of many periods are computed at one time and written
//! to a port that clocks them out.

use serde::Serialize;

/// What serving costs. All times are in seconds.
///
/// ```
/// use softplug_plan::Pulses;
///
/// // Four lathes at 4,000 pulses a second, an interrupt's entry of 60 µs.
/// let paper = Pulses { rate: 4_000.0, service: 50e-6, interrupt: 60e-6, write: 0.0, batch: 1 };
/// assert_eq!(paper.by_interrupts().machines, 2);
/// assert_eq!(paper.by_polling().machines, 4);
/// ```
#[derive(Copy, Clone, PartialEq, Debug, Serialize)]
pub struct Pulses {
    /// Periods a second, in each of which a machine may take a pulse.
    pub rate: f64,
    /// Computing one period of one machine.
    pub service: f64,
    /// Entering and leaving an interrupt.
    pub interrupt: f64,
    /// Writing one batch to a port.
    pub write: f64,
    /// Periods in a batch.
    pub batch: u32,
}

/// What one way of serving can carry.
#[derive(Copy, Clone, PartialEq, Debug, Serialize)]
pub struct PulseBudget {
    /// The most machines.
    pub machines: u64,
    /// The longest service of one period with `for_machines` machines, in seconds; below 0: none will
    /// do.
    pub longest_service: f64,
    /// For so many.
    pub for_machines: u32,
}

impl Pulses {
    /// Each pulse by an interrupt of its own: N · (service + interrupt) ≤ 1 / rate.
    pub fn by_interrupts(&self) -> PulseBudget {
        self.budget(
            4,
            |machines| self.period() / f64::from(machines) - self.interrupt,
            |of| self.period() / (of + self.interrupt),
        )
    }

    /// All in one turn, with one branch more: (N + 1) · service ≤ 1 / rate.
    pub fn by_polling(&self) -> PulseBudget {
        self.budget(
            4,
            |machines| self.period() / f64::from(machines + 1),
            |of| self.period() / of - 1.0,
        )
    }

    /// In batches: N · (service + write / batch) ≤ 1 / rate.
    pub fn by_batches(&self) -> PulseBudget {
        let write = self.write / f64::from(self.batch.max(1));
        self.budget(
            4,
            |machines| self.period() / f64::from(machines) - write,
            |of| self.period() / (of + write),
        )
    }

    /// For how long a batch lasts, in seconds: so late may it be computed.
    pub fn batch_seconds(&self) -> f64 {
        f64::from(self.batch.max(1)) * self.period()
    }

    fn period(&self) -> f64 {
        1.0 / self.rate
    }

    fn budget(
        &self,
        for_machines: u32,
        longest: impl Fn(u32) -> f64,
        most: impl Fn(f64) -> f64,
    ) -> PulseBudget {
        // A sum of parts that divides the period to the last bit is still within it.
        let machines = (most(self.service) * (1.0 + 1e-12)).floor().max(0.0) as u64;
        PulseBudget { machines, longest_service: longest(for_machines), for_machines }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAPER: Pulses =
        Pulses { rate: 4_000.0, service: 50e-6, interrupt: 60e-6, write: 0.0, batch: 1 };

    fn micros(seconds: f64) -> f64 {
        (seconds * 1e9).round() / 1e3
    }

    #[test]
    fn the_budgets_of_four_lathes_are_those_that_were_published() {
        assert!((micros(PAPER.by_batches().longest_service) - 62.5).abs() < 1e-9);
        // 250 - 4 · 60 = 10 µs are left for four services: not possible.
        assert!((micros(PAPER.by_interrupts().longest_service) - 2.5).abs() < 1e-9);
        assert!((micros(PAPER.by_polling().longest_service) - 50.0).abs() < 1e-9);
        assert_eq!(PAPER.by_polling().machines, 4);
        assert_eq!(PAPER.by_batches().machines, 5);
    }

    #[test]
    fn writing_costs_less_the_larger_the_batch() {
        let with = |batch| Pulses { service: 1e-7, write: 5e-6, batch, ..PAPER };
        assert_eq!(with(1).by_batches().machines, 49);
        assert_eq!(with(100).by_batches().machines, 1_666);
        assert!((with(100).batch_seconds() - 0.025).abs() < 1e-12);
    }

    #[test]
    fn an_interrupt_that_takes_longer_than_a_period_serves_nobody() {
        let slow = Pulses { interrupt: 1e-3, ..PAPER };
        assert_eq!(slow.by_interrupts().machines, 0);
        assert!(slow.by_interrupts().longest_service < 0.0);
    }
}
