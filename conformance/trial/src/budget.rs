//! How much a trial may cost, so that whatever plug-in and program it is given, it ends.

use std::cell::Cell;
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use softplug_abi::{Event, Instance, Micros, Output};
use thiserror::Error;

/// Units for a step of the plug-in, beside its fuel.
const STEP: u64 = 1_000;
/// Units for a character on the wire.
const CHARACTER: u64 = 200;

/// How much trials may cost together.
///
/// It is counted in units of about a nanosecond of computing: the fuel that the plug-in uses, 1,000
/// for each of its steps, 200 for each character on the wire. What is past it is given up, with
/// [`TrialError::Spent`](crate::TrialError::Spent). It never depends on the time of day.
///
/// ```
/// use softplug_trial::Budget;
///
/// let budget = Budget::units(5_000_000);
/// assert_eq!(budget.left(), 5_000_000);
/// assert_eq!(Budget::endless().left(), u64::MAX);
/// ```
#[derive(Debug)]
pub struct Budget {
    left: Cell<u64>,
    /// Most different characters of a program that are tried.
    characters: usize,
    stop: Option<Arc<AtomicBool>>,
}

impl Budget {
    /// So many units, and any number of different characters.
    pub fn units(units: u64) -> Self {
        Self { left: Cell::new(units), characters: usize::MAX, stop: None }
    }

    /// As much as it takes.
    pub fn endless() -> Self {
        Self::units(u64::MAX)
    }

    /// A program of more different characters than these is not tried:
    /// [`TrialError::Characters`](crate::TrialError::Characters).
    #[must_use]
    pub fn characters(self, characters: usize) -> Self {
        Self { characters, ..self }
    }

    /// Whoever sets this ends the trial, with
    /// [`TrialError::Stopped`](crate::TrialError::Stopped).
    #[must_use]
    pub fn stopped_by(self, stop: Arc<AtomicBool>) -> Self {
        Self { stop: Some(stop), ..self }
    }

    /// Units that are left.
    pub fn left(&self) -> u64 {
        self.left.get()
    }

    pub(crate) fn most_characters(&self) -> usize {
        self.characters
    }

    pub(crate) fn is_stopped(&self) -> bool {
        self.stop.as_ref().is_some_and(|stop| stop.load(Ordering::Relaxed))
    }

    /// Of an endless one nothing is taken.
    fn take(&self, units: u64) {
        if self.left.get() != u64::MAX {
            self.left.set(self.left.get().saturating_sub(units));
        }
    }

    pub(crate) fn take_character(&self) {
        self.take(CHARACTER);
    }
}

/// An instance whose steps are paid for.
pub(crate) struct Metered<'a, I> {
    instance: I,
    budget: &'a Budget,
    /// Fuel that was taken for it.
    paid: u64,
}

/// Why a step of an instance in a trial did not happen, or failed.
#[derive(Debug, Error)]
pub enum MeteredFault<F: Error + 'static> {
    /// Nothing is left of the budget, or it was stopped.
    #[error("the trial was given up")]
    GivenUp,
    /// The plug-in's own.
    #[error(transparent)]
    Own(F),
}

impl<'a, I: Instance> Metered<'a, I> {
    pub(crate) fn new(instance: I, budget: &'a Budget) -> Self {
        Self { paid: instance.total_fuel(), instance, budget }
    }
}

impl<I: Instance> Instance for Metered<'_, I> {
    type Fault = MeteredFault<I::Fault>;

    fn input_capacity(&self) -> usize {
        self.instance.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Self::Fault> {
        // What the step before this one used; this one's own is bounded by the host.
        let used = self.instance.total_fuel();
        self.budget.take(STEP.saturating_add(used - self.paid));
        self.paid = used;
        if self.budget.left() == 0 || self.budget.is_stopped() {
            return Err(MeteredFault::GivenUp);
        }
        self.instance.step(event, now).map_err(MeteredFault::Own)
    }

    fn total_fuel(&self) -> u64 {
        self.instance.total_fuel()
    }

    fn last_words(&self) -> Option<&str> {
        self.instance.last_words()
    }
}
