//! A plug-in that fails when it is told to.

use softplug_abi::{Event, Instance, Micros, Output};

/// An instance that traps at a certain event, counted from its opening.
#[derive(Debug)]
pub(crate) struct Fragile<I> {
    inner: I,
    fails_at: Option<u32>,
    events: u32,
    has_failed: bool,
}

/// Why it did not take an event.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Broken<F: std::error::Error + 'static> {
    #[error("it was made to fail here")]
    Here,
    #[error(transparent)]
    Inner(F),
}

impl<I> Fragile<I> {
    pub(crate) fn new(inner: I, fails_at: Option<u32>) -> Self {
        Self { inner, fails_at, events: 0, has_failed: false }
    }

    pub(crate) fn sound(inner: I) -> Self {
        Self::new(inner, None)
    }
}

impl<I: Instance> Instance for Fragile<I> {
    type Fault = Broken<I::Fault>;

    fn input_capacity(&self) -> usize {
        self.inner.input_capacity()
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Self::Fault> {
        let is_counted = !matches!(
            event,
            Event::Settings { .. } | Event::Restore { .. } | Event::Save | Event::Continue
        );
        self.events += u32::from(is_counted);
        self.has_failed |= self.fails_at == Some(self.events);
        if self.has_failed {
            return Err(Broken::Here);
        }
        self.inner.step(event, now).map_err(Broken::Inner)
    }

    fn total_fuel(&self) -> u64 {
        self.inner.total_fuel()
    }

    fn last_words(&self) -> Option<&str> {
        self.inner.last_words()
    }
}
