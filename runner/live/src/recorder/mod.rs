//! The flight recorder: the last events that a plug-in was given, within a bound,
//! so that a fault can be shown again.

mod log;
mod recording;

pub use recording::{Entry, Recording};

use log::Log;
use softplug_abi::{Event, Instance, Micros, restore_pieces};
use softplug_link::{Link, LinkFault, LinkHost};
use std::convert::Infallible;

/// An instance of which the events are kept.
///
/// What is kept begins where the instance began, or at a state that it saved: the
/// host takes a [`checkpoint`] whenever the record
/// [wants](Self::wants_checkpoint) one. An instance that saves nothing, or is
/// never asked, is kept from somewhere in the middle.
#[derive(Debug)]
pub struct Recorded<I> {
    inner: I,
    log: Log,
    /// Fuel that had been used before the latest event, and the most that one before
    /// it used.
    fuel: (u64, u64),
}

impl<I: Instance> Recorded<I> {
    /// Keeps some `bytes` of events; none and nothing at all with 0.
    pub fn new(inner: I, bytes: usize) -> Self {
        Self { inner, log: Log::new(bytes), fuel: (0, 0) }
    }

    /// The instance.
    pub fn inner(&self) -> &I {
        &self.inner
    }

    /// The instance. Whoever steps it by himself leaves a gap in the record.
    pub fn inner_mut(&mut self) -> &mut I {
        &mut self.inner
    }

    /// The most fuel that one event used, the latest left out.
    pub fn largest_fuel(&self) -> u64 {
        self.fuel.1
    }

    /// Whether the record is about to lose its beginning.
    pub fn wants_checkpoint(&self) -> bool {
        self.log.wants_checkpoint()
    }
}

impl<I: Instance> Instance for Recorded<I> {
    type Fault = I::Fault;

    fn input_capacity(&self) -> usize {
        self.inner.input_capacity()
    }

    fn step(
        &mut self,
        event: &Event<'_>,
        now: Micros,
    ) -> Result<softplug_abi::Output<'_>, I::Fault> {
        self.log.add(event, now);
        let (before, largest) = self.fuel;
        let total = self.inner.total_fuel();
        self.fuel = (total, largest.max(total.saturating_sub(before)));
        self.inner.step(event, now)
    }

    fn total_fuel(&self) -> u64 {
        self.inner.total_fuel()
    }

    fn last_words(&self) -> Option<&str> {
        self.inner.last_words()
    }
}

/// Has the plug-in save its state, from which its record goes on. To be called
/// only when the record [wants](Recorded::wants_checkpoint) it and nothing of this
/// instant is left to do. A plug-in that saves nothing is not asked again.
///
/// # Errors
/// The plug-in fails as it saves: it has ended.
pub fn checkpoint<I: Instance>(
    link: &mut Link<Recorded<I>>,
    now: Micros,
    host: &mut dyn LinkHost,
) -> Result<(), LinkFault<I::Fault>> {
    let Some(state) = link.save(now, host)? else {
        link.instance_mut().log.never_again();
        return Ok(());
    };
    let now = link.now();
    let (opening, lines) = (link.standing(), link.modem_lines_told());
    let (under_way, settings) = (link.under_way(), link.settings().clone());
    let capacity = link.instance().input_capacity();
    let log = &mut link.instance_mut().log;
    log.begin_from_state(under_way);
    keep(settings.pieces(capacity, |event| {
        log.add_to_head(event, now);
        Ok(())
    }));
    keep(restore_pieces(state.format, &state.bytes, capacity, |event| {
        log.add_to_head(event, now);
        Ok(())
    }));
    log.add_to_head(&opening, now);
    if let Some((known, on)) = lines {
        log.add_to_head(&Event::ModemLines { known, on }, now);
    }
    log.end_of_head();
    Ok(())
}

/// What is only kept cannot fail.
fn keep(kept: Result<(), Infallible>) {
    let Ok(()) = kept;
}

/// What is kept of the events that the plug-in on a link was given.
pub fn recording<I: Instance>(link: &Link<Recorded<I>>) -> Recording {
    link.instance().log.recording(link.taken_over_with())
}

/// The recording of a plug-in that is no longer on a link, where it had taken over
/// with this under way.
pub fn recording_of<I: Instance>(
    instance: &Recorded<I>,
    under_way: &softplug_link::UnderWay,
) -> Recording {
    instance.log.recording(under_way)
}
