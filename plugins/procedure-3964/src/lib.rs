//! The procedures 3964 and 3964R, and RK512 on top of them.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod options;
mod settings;

pub use options::Options;
pub use settings::{Layer, Priority};
#[doc(hidden)]
pub use softplug_plugin;
