//! The procedures 3964 and 3964R, and RK512 on top of them.
//!
//! One state machine serves all plug-ins of the family; they differ in the
//! defaults of their [`Options`]. The protocol's page is `docs/protocols/3964r.md`.
#![cfg_attr(target_arch = "wasm32", no_std)]

mod cause;
mod departure;
mod frame;
mod job;
mod machine;
mod phase;
mod procedure;
mod queue;
mod receiver;
mod sender;
mod settings;

pub use procedure::{Procedure, Variant};
pub use settings::{Layer, Options, Priority};
#[doc(hidden)]
pub use softplug_plugin;
