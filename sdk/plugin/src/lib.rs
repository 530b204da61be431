//! For authors of Softplug plug-ins: implement [`Converter`], name it in
//! [`export!`], build for `wasm32v1-none`.
//!
//! A converter is a deterministic state machine: events in, actions out, time
//! given. It has no clock, no randomness and no I/O, so the same code runs
//! natively under [`mod@bench`], in a sandbox and on a front-end unit.
//!
//! ```
//! use softplug_plugin::{Context, Converter};
//!
//! #[derive(Default)]
//! struct Echo;
//!
//! impl Converter for Echo {
//!     type Settings = ();
//!     const MANIFEST: &'static str = r#"{"abi": "1.0", "name": "echo", "version": "1.0.0",
//!         "licence": "MIT", "protocol": "none", "description": "Sends back what it receives."}"#;
//!
//!     fn new((): ()) -> Self {
//!         Self
//!     }
//!
//!     fn received(&mut self, link: &mut Context<'_>, bytes: &[u8]) {
//!         let room = link.transmit_room() as usize;
//!         link.transmit(&bytes[..bytes.len().min(room)]);
//!     }
//! }
//!
//! softplug_plugin::export!(Echo);
//! ```
#![cfg_attr(not(any(test, feature = "bench")), no_std)]

// What `#[derive(State)]` writes names this crate.
extern crate self as softplug_plugin;

#[cfg(feature = "bench")]
pub mod bench;
mod context;
mod converter;
pub mod export;
mod machine;
pub mod manifest;
#[cfg(feature = "bench")]
mod native;
pub mod parts;
mod saved;
mod settings;
mod state;
mod unread;

pub use context::Context;
pub use converter::{Converter, JobStart, Opening};
#[cfg(feature = "bench")]
pub use native::{Native, NativeFault};
pub use parts::PartEvent;
pub use saved::State;
pub use settings::{Bytes, Choice, SettingSet, SettingType, Text};
pub use softplug_abi::wire::copy;
pub use softplug_abi::{
    DeliveryId, Failure, JobId, LineErrorKind, LineParameters, LinkDownReason, MarkId, MarkState,
    Micros, ModemLines, NoteLevel, Parity, Pass, RawValue, RequestId, Value, ValueWriter, Values,
};
pub use softplug_plugin_derive::State;
pub use state::{StateError, StateReader, StateWriter};
pub use unread::Unread;
