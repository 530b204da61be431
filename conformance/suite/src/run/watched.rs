//! A subject's instances as they are run: their steps are counted and their panics caught.

use super::fault::{FaultClass, WatchedFault, of_instance};
use super::subject::{Fuel, Subject, SubjectError};
use softplug_abi::{Event, Instance, Micros, Output};
use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::rc::Rc;

/// What the instances of one run have used, those that were swapped out included.
#[derive(Debug, Default)]
pub(crate) struct Meter {
    pub(crate) steps: Cell<u64>,
    /// Counted when an instance is dropped.
    pub(crate) fuel: Cell<Fuel>,
    /// How the last step that failed did.
    pub(crate) fault: Cell<Option<FaultClass>>,
}

/// An instance whose steps are counted and whose panics are caught: native code
/// panics where a module traps.
#[derive(Debug)]
pub(crate) struct Watched<I: Instance> {
    inner: I,
    meter: Rc<Meter>,
    fuel: fn(&I) -> Fuel,
    panicked: Option<String>,
}

impl<I: Instance> Watched<I> {
    pub(crate) fn start<S: Subject<Instance = I>>(
        subject: &S,
        meter: Rc<Meter>,
    ) -> Result<Self, SubjectError> {
        Ok(Self { inner: subject.instantiate()?, meter, fuel: S::fuel, panicked: None })
    }
}

impl<I: Instance> Instance for Watched<I> {
    type Fault = WatchedFault<I::Fault>;

    fn input_capacity(&self) -> usize {
        self.inner.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Self::Fault> {
        if let Some(words) = &self.panicked {
            return Err(WatchedFault::Panicked(words.clone()));
        }
        self.meter.steps.set(self.meter.steps.get() + 1);
        let inner = &mut self.inner;
        // A panicked instance is never called again, so that a state that it
        // left half done is not seen.
        let step = move || {
            let inner = inner;
            inner.step(event, now)
        };
        let stepped = match catch_unwind(AssertUnwindSafe(step)) {
            Ok(stepped) => stepped.map_err(WatchedFault::Instance),
            Err(panic) => {
                let words = self.panicked.insert(words(panic.as_ref()));
                Err(WatchedFault::Panicked(words.clone()))
            }
        };
        if let Err(fault) = &stepped {
            self.meter.fault.set(Some(of_instance(event.kind(), fault)));
        }
        stepped
    }
}

impl<I: Instance> Drop for Watched<I> {
    fn drop(&mut self) {
        let (before, used) = (self.meter.fuel.get(), (self.fuel)(&self.inner));
        self.meter.fuel.set(Fuel {
            total: before.total.saturating_add(used.total),
            largest: before.largest.max(used.largest),
        });
    }
}

fn words(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "without a word".to_owned())
}
