//! The reference plug-ins as native code, by name: the same converters that are
//! built as WebAssembly, for comparing the two and for running without a sandbox.

use fanuc_rs232::FanucRs232;
use heidenhain_fe::HeidenhainFe;
use kermit::Kermit;
use pulse_lathe::PulseLathe;
use r3964::R3964;
use r3964_simplified::R3964Simplified;
use softplug_abi::{Event, Instance, Micros, Output};
use softplug_plugin::{Converter, Native, NativeFault};
use xmodem::Xmodem;
use xon_xoff::XonXoff;

/// The registry from one table: each plug-in's variant, converter and name.
macro_rules! plugins {
    ($($(#[$doc:meta])* $variant:ident($converter:ty) = $name:literal;)*) => {
        /// A reference plug-in.
        #[derive(Copy, Clone, PartialEq, Eq, Debug)]
        pub enum NativePlugin {
            $($(#[$doc])* $variant,)*
        }

        impl NativePlugin {
            /// All that there are.
            pub const ALL: &'static [Self] = &[$(Self::$variant),*];

            /// Its name, as in the manifest.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)*
                }
            }

            /// Its manifest as JSON.
            pub const fn manifest(self) -> &'static str {
                match self {
                    $(Self::$variant => <$converter as Converter>::MANIFEST,)*
                }
            }

            /// A new instance.
            pub fn instantiate(self) -> NativeInstance {
                match self {
                    $(Self::$variant => NativeInstance::$variant(Native::new()),)*
                }
            }
        }

        /// An instance of a reference plug-in.
        #[derive(Debug)]
        pub enum NativeInstance {
            $($(#[$doc])* $variant(Native<$converter>),)*
        }

        impl Instance for NativeInstance {
            type Fault = NativeFault;

            fn input_capacity(&self) -> usize {
                match self {
                    $(Self::$variant(native) => native.input_capacity(),)*
                }
            }

            fn step(
                &mut self,
                event: &Event<'_>,
                now: Micros,
            ) -> Result<Output<'_>, NativeFault> {
                match self {
                    $(Self::$variant(native) => native.step(event, now),)*
                }
            }
        }
    };
}

plugins! {
    /// XON/XOFF.
    XonXoff(XonXoff) = "xon-xoff";
    /// 3964R and 3964, with RK512.
    R3964(R3964) = "r3964";
    /// Simplified 3964R.
    R3964Simplified(R3964Simplified) = "r3964-simplified";
    /// FANUC-style RS-232.
    FanucRs232(FanucRs232) = "fanuc-rs232";
    /// Heidenhain blockwise transfer.
    HeidenhainFe(HeidenhainFe) = "heidenhain-fe";
    /// Pulses for lathes.
    PulseLathe(PulseLathe) = "pulse-lathe";
    /// XMODEM.
    Xmodem(Xmodem) = "xmodem";
    /// Kermit.
    Kermit(Kermit) = "kermit";
}

impl NativePlugin {
    /// The plug-in with this name.
    ///
    /// ```
    /// use softplug_native::NativePlugin;
    /// assert_eq!(NativePlugin::from_name("xon-xoff"), Some(NativePlugin::XonXoff));
    /// ```
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|plugin| plugin.name() == name)
    }
}
