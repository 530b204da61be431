//! The reference plug-ins as native code, by name: the same converters that are
//! built as WebAssembly, for comparing the two and for running without a sandbox.

use softplug_abi::{Event, Instance, Micros, Output};
use softplug_plugin::{Converter, Native, NativeFault};
use xon_xoff::XonXoff;

/// A reference plug-in.
#[derive(Copy, Clone, PartialEq, Eq, Debug)]
pub enum NativePlugin {
    /// XON/XOFF.
    XonXoff,
}

impl NativePlugin {
    /// All that there are.
    pub const ALL: &'static [Self] = &[Self::XonXoff];

    /// The plug-in with this name.
    ///
    /// ```
    /// use softplug_native::NativePlugin;
    /// assert_eq!(NativePlugin::from_name("xon-xoff"), Some(NativePlugin::XonXoff));
    /// ```
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|plugin| plugin.name() == name)
    }

    /// Its name, as in the manifest.
    pub const fn name(self) -> &'static str {
        match self {
            Self::XonXoff => "xon-xoff",
        }
    }

    /// Its manifest as JSON.
    pub const fn manifest(self) -> &'static str {
        match self {
            Self::XonXoff => XonXoff::MANIFEST,
        }
    }

    /// A new instance.
    pub fn instantiate(self) -> NativeInstance {
        match self {
            Self::XonXoff => NativeInstance::XonXoff(Native::new()),
        }
    }
}

/// An instance of a reference plug-in.
#[derive(Debug)]
pub enum NativeInstance {
    /// XON/XOFF.
    XonXoff(Native<XonXoff>),
}

impl Instance for NativeInstance {
    type Fault = NativeFault;

    fn input_capacity(&self) -> usize {
        match self {
            Self::XonXoff(native) => native.input_capacity(),
        }
    }

    fn step(&mut self, event: &Event<'_>, now: Micros) -> Result<Output<'_>, NativeFault> {
        match self {
            Self::XonXoff(native) => native.step(event, now),
        }
    }
}
