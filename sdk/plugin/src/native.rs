//! A converter as native code behind the same encoded events and actions as in
//! the sandbox.

use crate::export::{INPUT, OUTPUT};
use crate::machine::Machine;
use crate::{Converter, StateError};
use softplug_abi::{Event, Instance, Micros, Output, Refusal};
use std::fmt;

/// A converter as an [`Instance`].
///
/// ```
/// use softplug_plugin::Native;
/// # struct Nothing;
/// # impl softplug_plugin::Converter for Nothing {
/// #     type Settings = ();
/// #     const MANIFEST: &'static str = "";
/// #     fn new((): ()) -> Self { Self }
/// # }
/// use softplug_link::{Link, LinkOptions, Recorder};
/// use softplug_abi::Micros;
///
/// let mut link = Link::new(Native::<Nothing>::new(), LinkOptions::default());
/// link.open(Micros::ZERO, &mut Recorder::default())?;
/// # Ok::<(), softplug_link::LinkFault<softplug_plugin::NativeFault>>(())
/// ```
#[derive(Debug)]
pub struct Native<C: Converter> {
    machine: Box<Machine<C>>,
    input: Box<[u8; INPUT]>,
    output: Box<[u8; OUTPUT]>,
    state: Box<[u8]>,
}

impl<C: Converter> Native<C> {
    /// An instance that knows no settings yet.
    pub fn new() -> Self {
        Self {
            machine: Box::new(Machine::new()),
            input: Box::new([0; INPUT]),
            output: Box::new([0; OUTPUT]),
            state: vec![0; C::STATE_CAPACITY].into_boxed_slice(),
        }
    }
}

impl<C: Converter> Default for Native<C> {
    fn default() -> Self {
        Self::new()
    }
}

/// A native converter did not take an event.
///
/// ```
/// use softplug_abi::{Event, Instance, Micros, Refusal};
/// use softplug_plugin::Native;
/// # struct Nothing;
/// # impl softplug_plugin::Converter for Nothing {
/// #     type Settings = ();
/// #     const MANIFEST: &'static str = "";
/// #     fn new((): ()) -> Self { Self }
/// # }
///
/// // Nothing is received before the link is open.
/// let mut native = Native::<Nothing>::new();
/// let fault = native.step(&Event::Received(b"G1"), Micros::ZERO).unwrap_err();
/// assert_eq!(fault.refusal, Refusal::MalformedEvent);
/// ```
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub struct NativeFault {
    /// Why.
    pub refusal: Refusal,
    /// In the converter's words.
    pub words: &'static str,
    /// Where a saved state cannot be taken.
    pub wrong: Option<StateError>,
}

impl fmt::Display for NativeFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "refused: {}", self.refusal.text())?;
        match self.wrong {
            Some(error) => write!(f, " ({error})"),
            None if self.words.is_empty() => Ok(()),
            None => write!(f, " ({})", self.words),
        }
    }
}

impl std::error::Error for NativeFault {}

impl<C: Converter> Instance for Native<C> {
    type Fault = NativeFault;

    fn input_capacity(&self) -> usize {
        INPUT
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, NativeFault> {
        let too_long = NativeFault {
            refusal: Refusal::MalformedEvent,
            words: "the event is longer than the input buffer",
            wrong: None,
        };
        let length = event.encode(&mut self.input[..]).map_err(|_| too_long)?;
        let code = i32::from(event.kind().code());
        let stepped = self.machine.step(
            code,
            &self.input[..length],
            now,
            &mut self.output[..],
            &mut self.state[..],
        );
        let (length, more) = stepped.map_err(|refusal| {
            let (words, wrong) = self.machine.why();
            NativeFault { refusal, words, wrong }
        })?;
        Ok(Output { actions: &self.output[..length], more })
    }
}
