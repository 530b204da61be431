//! The front-end unit: a small computer at one machine or several. It keeps the plug-in that a
//! machine needs in its own memory, runs it in its sandbox, keeps time, paces, holds and buffers
//! there, and is fed by a gateway over the unit protocol.
//!
//! [`UnitConfig`] is what `unit.toml` says; [`Unit`] does it. `docs/unit/README.md` is the page for
//! whoever sets one up.
#![cfg(target_os = "linux")]
#![forbid(unsafe_code)]

mod callers;
mod config;
mod door;
mod error;
mod holder;
mod link;
mod memory;
mod mistake;
mod paths;
mod unit;

pub use config::{ConfigError, LinkConfig, MemoryConfig, Reach, SignatureConfig, UnitConfig};
pub use error::UnitError;
pub use unit::{Stop, Unit};
