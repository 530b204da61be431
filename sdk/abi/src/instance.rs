//! One running plug-in, as whoever drives a link sees it.

use crate::{Event, Micros};

/// A plug-in that takes events: sandboxed (`softplug-host`) or native
/// (`softplug-plugin`'s `Native`). Both speak in encoded bytes, so that what
/// one accepts the other accepts.
pub trait Instance {
    /// Why the instance ended or did not take the event.
    type Fault: core::error::Error + 'static;

    /// Largest payload of an event in bytes.
    fn input_capacity(&self) -> usize;

    /// Takes one event at `now` and returns the encoded actions.
    ///
    /// If there is more output than fits, [`Output::more`] is set: apply what is
    /// there, then step with [`Event::Continue`] and the same time.
    ///
    /// # Errors
    /// The event was refused, or the instance has ended: it then answers every
    /// later step with the same fault.
    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, Self::Fault>;

    /// Units of fuel that all steps used; 0 where nobody counts.
    fn total_fuel(&self) -> u64 {
        0
    }

    /// What the plug-in said as it trapped.
    fn last_words(&self) -> Option<&str> {
        None
    }
}

/// What a step wrote.
#[derive(Copy, Clone, Debug)]
pub struct Output<'a> {
    /// Encoded actions; not checked yet.
    pub actions: &'a [u8],
    /// The plug-in has more to write.
    pub more: bool,
}
