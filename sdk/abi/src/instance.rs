//! One running plug-in, as whoever drives a link sees it.

use crate::{Event, Micros};

/// A plug-in that takes events: sandboxed (`softplug-host`) or native
/// (`softplug-plugin`'s `Native`). Both speak in encoded bytes, so that what
/// one accepts the other accepts.
///
/// ```
/// use softplug_abi::{Action, ActionWriter, Event, Instance, Micros, Output};
///
/// /// Sends back what it receives.
/// #[derive(Default)]
/// struct Echo {
///     output: Vec<u8>,
/// }
///
/// impl Instance for Echo {
///     type Fault = std::convert::Infallible;
///
///     fn input_capacity(&self) -> usize {
///         512
///     }
///
///     fn step(&mut self, event: &Event<'_>, _now: Micros) -> Result<Output<'_>, Self::Fault> {
///         self.output.resize(1_024, 0);
///         let mut writer = ActionWriter::new(&mut self.output);
///         if let Event::Received(bytes) = event {
///             writer.transmit(bytes).expect("what comes in is shorter than the output");
///         }
///         let length = writer.len();
///         Ok(Output { actions: &self.output[..length], more: false })
///     }
/// }
///
/// let mut echo = Echo::default();
/// let output = echo.step(&Event::Received(b"G1"), Micros::ZERO).unwrap();
/// assert_eq!(output.actions, [1, 0, 6, 0, 0, 0, 0, 0, b'G', b'1']);
/// ```
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
///
/// ```
/// use softplug_abi::{Action, Actions, Output};
///
/// let output = Output { actions: &[3, 0, 0, 0], more: false };
/// assert_eq!(Actions::new(output.actions).next(), Some(Ok(Action::Hold)));
/// ```
#[derive(Copy, Clone, Debug)]
pub struct Output<'a> {
    /// Encoded actions; not checked yet.
    pub actions: &'a [u8],
    /// The plug-in has more to write.
    pub more: bool,
}
