//! The slots, held against what `docs/unit/slots.md` says of them.

mod bench;
mod content;
mod downloads;
mod files;
mod flash;
mod geometries;
mod golden;
mod marginal;
mod model;
mod power;
mod random;
mod trials;
mod trust;
