//! A front-end unit without an operating system: one link, its plug-in where it lies in flash, the unit
//! protocol over a serial line. `docs/unit/firmware.md` is the page for it.
//!
//! This library is all of it but for the board: [`Unit`] works on a [`Board`], and whoever has one calls
//! [`Unit::turn`] again and again. It needs an allocator, no standard library, and no threads. The binary of this package
//! is a unit on the board that QEMU emulates as `mps2-an386`.
#![cfg_attr(not(test), no_std)]
#![forbid(unsafe_code)]

extern crate alloc;

mod board;
mod counters;
mod deliveries;
mod feed;
mod frames;
mod host;
mod lane;
mod memory;
mod outbox;
mod plugin;
mod settings;
mod tell;
mod unit;

pub use board::{Board, FromMachine};
pub use unit::{Options, Unit};
